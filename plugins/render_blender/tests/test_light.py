"""Cycles through the plugin against closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core.model.arrays import FloatArray
from posse_core.model.camera import Camera, PixelBox
from posse_core.model.scene import EnvironmentMap, FrameState, Radiance, RenderRequest
from posse_core.model.spacecraft import Material
from posse_core.testing import scenes
from posse_render_blender.renderer import BlenderRenderer

WHITE = Material("white", base_color=(0.8, 0.5, 0.2), specular=0.0)
MIRROR = Material("mirror", metallic=1.0, roughness=0.0)
Open = Callable[..., BlenderRenderer]


def shot(
    renderer: BlenderRenderer,
    camera: Camera,
    frame: FrameState,
    environment: EnvironmentMap | None = None,
) -> Radiance:
    box = PixelBox(0, 0, camera.width_px, camera.height_px)
    return renderer.render(RenderRequest(frame, box, environment, seed=7))


def sky(function: Callable[[FloatArray], FloatArray], height: int = 64) -> EnvironmentMap:
    """A map of ``function``: directions (h, w, 3) in camera axes → radiance (h, w, 3)."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = 2 * np.pi * (np.arange(2 * height) + 0.5) / (2 * height) - np.pi
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    d = np.stack([np.sin(theta) * np.sin(phi), -np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1)
    return EnvironmentMap(function(d).astype(np.float32))


def test_a_pixel_not_square_and_a_principal_point_off_the_middle(opened: Open) -> None:
    """A small plate is where the pinhole's formula puts it, and its depth is planar z."""
    camera = Camera(64, 48, fx_px=70.0, fy_px=90.0, cx_px=25.3, cy_px=28.9, sensor_width_m=0.01)
    craft = scenes.rectangle(
        "plate", "white", centre_m=(0.2, 0.1, 0.3), u_m=(0.3, 0, 0), v_m=(0, 0.2, 0)
    )
    R = Rotation.from_rotvec([0.2, -0.3, 0.4]).as_matrix() @ scenes.FACING
    frame = scenes.frame(t_body_cam_m=(0.1, -0.05, 2.5), sun_direction_body=(0, 0, 1), R_cam_from_body=R)
    image = shot(opened(scenes.scene(craft, materials=(WHITE,), camera=camera), spp=256), camera, frame)
    corners = camera.project(craft.vertices_body_m @ R.T + frame.t_body_cam_m)
    a, b = corners, np.roll(corners, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = cross.sum() / 2
    centroid = ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
    v, u = np.mgrid[0:48, 0:64]
    covered = image.coverage.sum()
    assert covered == pytest.approx(abs(area), rel=2e-3)
    assert (image.coverage * u).sum() / covered == pytest.approx(centroid[0], abs=0.01)
    assert (image.coverage * v).sum() / covered == pytest.approx(centroid[1], abs=0.01)
    normal = R @ [0, 0, 1]
    rays = camera.rays(np.stack([u, v], axis=-1).astype(np.float64))
    z = normal @ (R @ [0.2, 0.1, 0.3] + frame.t_body_cam_m) / (rays @ normal)
    inside = image.coverage == 1.0
    assert image.depth_m is not None
    np.testing.assert_allclose(image.depth_m[inside], z[inside], atol=1e-4)
    assert np.isnan(image.depth_m[image.coverage == 0.0]).all()


def test_a_box_is_the_slice_of_the_whole_image(opened: Open) -> None:
    camera = scenes.camera(64, 48)
    craft = scenes.sphere("ball", "white", rings=24)
    renderer = opened(scenes.scene(craft, materials=(WHITE,), camera=camera))
    frame = scenes.frame(t_body_cam_m=(0.2, 0.1, 4), sun_direction_body=(1, 0.3, 0.5))
    whole = shot(renderer, camera, frame)
    for box in (PixelBox(0, 0, 20, 48), PixelBox(21, 13, 17, 23), PixelBox(63, 47, 1, 1)):
        part = renderer.render(RenderRequest(frame, box, None, seed=7))
        np.testing.assert_array_equal(part.radiance_rgb, whole.radiance_rgb[box.slices])
        np.testing.assert_array_equal(part.coverage, whole.coverage[box.slices])


def test_the_seed_is_used_and_nothing_else_is_random(opened: Open) -> None:
    camera = scenes.camera(32, 24)
    renderer = opened(
        scenes.scene(scenes.sphere("ball", "white", rings=24), materials=(WHITE,), camera=camera), spp=4
    )
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(1, 0, 0.2))
    box = PixelBox(0, 0, 32, 24)
    first, other, again = (
        renderer.render(RenderRequest(frame, box, None, seed)).radiance_rgb for seed in (1, 2, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_lambertian_plate_on_both_sides(opened: Open, side: float) -> None:
    """E ρ cos/π in each band, whichever side of the face is lit and seen."""
    camera = scenes.camera(16, 12)
    craft = scenes.rectangle("plate", "white", u_m=(9, 0, 0), v_m=(0, 9 * side, 0))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0.5, -0.3, 0.7))
    image = shot(opened(scenes.scene(craft, materials=(WHITE,), camera=camera), spp=64), camera, frame)
    expected = frame.sun_irradiance_rgb_w_m2 * WHITE.base_color / np.pi * frame.sun_direction_body[2]
    np.testing.assert_allclose(image.radiance_rgb.mean(axis=(0, 1)), expected, rtol=2e-3)


def test_lambertian_sphere(opened: Open) -> None:
    """Against E ρ cos/π on a true sphere, met by 4 × 4 rays a pixel."""
    camera = scenes.camera(48, 48, hfov_rad=0.6)
    craft = scenes.sphere("ball", "white", rings=96)
    renderer = opened(scenes.scene(craft, materials=(WHITE,), camera=camera), spp=64)
    place = (np.arange(4 * 48) + 0.5) / 4 - 0.5
    rays = camera.rays(np.stack(np.meshgrid(place, place), axis=-1))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    centre_m = np.array([0.1, -0.2, 4.0])
    along = rays @ centre_m
    inside = along**2 - centre_m @ centre_m + 1.0
    normals = rays * (along - np.sqrt(np.maximum(inside, 0)))[..., None] - centre_m
    for phase in (0.0, 1.0, 2.0):
        sun = (np.sin(phase), 0.0, np.cos(phase))
        frame = scenes.frame(t_body_cam_m=tuple(centre_m), sun_direction_body=sun)
        cosine = np.where(inside > 0, np.maximum(normals @ frame.sun_direction_cam, 0), 0)
        cosine = cosine.reshape(48, 4, 48, 4).mean(axis=(1, 3))[..., None]
        expected = frame.sun_irradiance_rgb_w_m2 * WHITE.base_color / np.pi * cosine
        image = shot(renderer, camera, frame)
        total = image.radiance_rgb.sum(axis=(0, 1))
        np.testing.assert_allclose(total, expected.sum(axis=(0, 1)), rtol=1e-2)
        whole = image.coverage == 1.0
        error = np.abs(image.radiance_rgb - expected)[whole]
        assert error.max() < 0.02 * expected.max()


def test_eclipse_is_black(opened: Open) -> None:
    camera = scenes.camera(16, 12)
    craft = scenes.rectangle("plate", "white", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(WHITE,), camera=camera))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), sun_fraction=0.0)
    image = shot(renderer, camera, frame)
    assert image.radiance_rgb.max() == 0
    assert image.coverage.min() == 1


def test_a_shadow_has_the_suns_penumbra(opened: Open) -> None:
    """An edge 2 m above a plate: light rises over 2 m · 2 tan α as the disc comes out behind it."""
    camera = scenes.camera(64, 8, hfov_rad=0.4)
    alpha = 0.05
    ground = scenes.rectangle("ground", "white", u_m=(9, 0, 0), v_m=(0, 9, 0))
    # The roof is seen by the Sun alone: it hangs behind the camera.
    roof = scenes.rectangle("roof", "white", centre_m=(-5, 0, 2), u_m=(5, 0, 0), v_m=(0, 9, 0))
    scene = scenes.scene(ground, roof, materials=(WHITE,), camera=camera)
    frame = scenes.frame(
        t_body_cam_m=(0, 0, 1.5), sun_direction_body=(0, 0, 1), sun_angular_radius_rad=alpha
    )
    image = shot(opened(scene, spp=256, max_bounces=0), camera, frame)
    x = (np.arange(64) - camera.cx_px) / camera.fx_px * 1.5 / (2 * np.tan(alpha))
    x = np.clip(x, -1, 1)
    free = 0.5 + (x * np.sqrt(1 - x**2) + np.arcsin(x)) / np.pi
    expected = free * frame.sun_irradiance_rgb_w_m2[1] * WHITE.base_color[1] / np.pi
    got = image.radiance_rgb[..., 1].mean(axis=0)
    np.testing.assert_allclose(got, expected, atol=0.02 * expected.max())


def test_the_sun_is_mirrored_but_not_seen(opened: Open) -> None:
    """A mirror shows the Sun's disc with its radiance E/(π sin²α); looking at it shows nothing."""
    camera = scenes.camera(33, 33, hfov_rad=0.2)
    craft = scenes.rectangle("plate", "mirror", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(MIRROR,), camera=camera), spp=256)
    alpha = 0.05
    frame = scenes.frame(
        t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), sun_angular_radius_rad=alpha
    )
    image = shot(renderer, camera, frame)
    expected = frame.sun_irradiance_rgb_w_m2 / (np.pi * np.sin(alpha) ** 2)
    np.testing.assert_allclose(image.radiance_rgb[16, 16], expected, rtol=5e-3)
    assert image.radiance_rgb[0].max() == 0
    away = scenes.frame(
        t_body_cam_m=(0, 0, -4), sun_direction_body=(0, 0, -1), sun_angular_radius_rad=alpha
    )
    image = shot(renderer, camera, away)
    assert image.radiance_rgb.max() == 0
    assert image.coverage.max() == 0


def test_a_mirror_shows_the_sky_where_it_is(opened: Open) -> None:
    """Each band is linear in one camera axis, so the mirrored direction can be read off."""
    camera = scenes.camera(24, 18)
    craft = scenes.rectangle("plate", "mirror", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(MIRROR,), camera=camera), spp=64)
    v, u = np.mgrid[0:18, 0:24]
    rays = camera.rays(np.stack([u, v], axis=-1).astype(np.float64))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    for scale, turn in ((1.0, [0.3, -0.2, 0.5]), (2.0, [-0.4, 0.1, 2.0])):
        environment = sky(lambda d, scale=scale: scale * (2.0 + d))
        R = Rotation.from_rotvec(turn).as_matrix() @ scenes.FACING
        frame = scenes.frame(
            t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, -1), R_cam_from_body=R, sun_fraction=0.0
        )
        image = shot(renderer, camera, frame, environment)
        normal = R @ [0, 0, 1]
        mirrored = rays - 2 * (rays @ normal)[..., None] * normal
        np.testing.assert_allclose(image.radiance_rgb, scale * (2.0 + mirrored), rtol=3e-3)


def test_a_sphere_under_an_even_sky_and_then_none(opened: Open) -> None:
    camera = scenes.camera(24, 24, hfov_rad=0.3)
    renderer = opened(
        scenes.scene(scenes.sphere("ball", "white", rings=24), materials=(WHITE,), camera=camera), spp=64
    )
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), sun_fraction=0.0)
    image = shot(renderer, camera, frame, sky(lambda d: np.full_like(d, 3.0)))
    np.testing.assert_allclose(
        image.radiance_rgb.mean(axis=(0, 1)), 3.0 * np.array(WHITE.base_color), rtol=1e-2
    )
    assert shot(renderer, camera, frame).radiance_rgb.max() == 0


def test_textures_lie_the_right_way_round_and_are_decoded(opened: Open) -> None:
    """Row 0 is at v = 1, column 0 at u = 0; sRGB 188 is 0.5029 linear; the factor multiplies."""
    texture = np.zeros((16, 16, 3), dtype=np.uint8)
    texture[:8, :8] = [188, 0, 0]  # u < ½, v > ½
    texture[:8, 8:] = [0, 188, 0]
    texture[8:, :8] = [0, 0, 188]
    texture[8:, 8:] = [255, 255, 255]
    paint = Material("paint", base_color=(0.5, 0.6, 0.7), specular=0.0, base_color_texture=texture)
    camera = scenes.camera(16, 12)
    craft = scenes.rectangle("plate", "paint", u_m=(3, 0, 0), v_m=(0, 3, 0))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1))
    image = shot(opened(scenes.scene(craft, materials=(paint,), camera=camera)), camera, frame)
    level = ((188 / 255 + 0.055) / 1.055) ** 2.4
    reflectance = image.radiance_rgb * np.pi / frame.sun_irradiance_rgb_w_m2 / paint.base_color
    for (row, column), expected in {
        (2, 3): (level, 0, 0),
        (2, 12): (0, level, 0),
        (9, 3): (0, 0, level),
        (9, 12): (1, 1, 1),
    }.items():
        np.testing.assert_allclose(reflectance[row, column], expected, atol=3e-3)


def test_a_normal_map_turns_the_normal(opened: Open) -> None:
    texel = np.array([180, 90, 230], dtype=np.uint8)
    paint = Material("paint", specular=0.0, normal_texture=np.tile(texel, (4, 4, 1)))
    camera = scenes.camera(16, 12)
    craft = scenes.rectangle("plate", "paint", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(paint,), camera=camera))
    normal = 2 * (texel / 255) - 1
    normal /= np.linalg.norm(normal)
    for sun in ((0.5, 0.0, 0.8), (0.0, 0.5, 0.8)):
        frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=sun)
        image = shot(renderer, camera, frame)
        expected = frame.sun_irradiance_rgb_w_m2 / np.pi * (normal @ frame.sun_direction_body)
        np.testing.assert_allclose(image.radiance_rgb.mean(axis=(0, 1)), expected, rtol=1e-2)


def test_metallic_and_roughness_are_read_from_their_own_channels(opened: Open) -> None:
    """The left half is a mirror (metallic 1, roughness 0), the right half Lambertian."""
    texture = np.zeros((16, 16, 2), dtype=np.uint8)
    texture[:, :8] = [255, 0]
    texture[:, 8:] = [0, 255]
    paint = Material("paint", metallic=1.0, specular=0.0, metallic_roughness_texture=texture)
    camera = scenes.camera(16, 12)
    craft = scenes.rectangle("plate", "paint", u_m=(3, 0, 0), v_m=(0, 3, 0))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0.6, 0, 0.8))
    image = shot(opened(scenes.scene(craft, materials=(paint,), camera=camera)), camera, frame)
    assert image.radiance_rgb[:, 1:5].max() == 0  # the Sun is mirrored elsewhere
    np.testing.assert_allclose(
        image.radiance_rgb[6, 12], frame.sun_irradiance_rgb_w_m2 * 0.8 / np.pi, rtol=1e-2
    )


def test_the_two_descriptions_of_versions(opened: Open) -> None:
    camera = scenes.camera(16, 12)
    renderer = opened(
        scenes.scene(scenes.rectangle("plate", "white"), materials=(WHITE,), camera=camera)
    )
    described = renderer.describe()
    assert described["device"] == "cpu"
    assert tuple(int(n) for n in described["blender"].split()[0].split(".")[:2]) >= (4, 5)
