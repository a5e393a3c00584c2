"""Behaviour that the conformance kit does not cover: lobes, mirrors and skies against integrals, tiles,
shadows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import (
    BodyState,
    Camera,
    EnvironmentMap,
    FloatArray,
    FrameState,
    Material,
    PixelBox,
    Radiance,
    RenderRequest,
)
from posse_core.testing import scenes
from posse_core.testing.closed_forms import directions
from posse_render_raster.renderer import RasterRenderer

WHITE = Material("white", base_color=(0.8, 0.5, 0.2), specular=0.0)
MIRROR = Material("mirror", metallic=1.0, roughness=0.0)
Open = Callable[..., RasterRenderer]


def shot(
    renderer: RasterRenderer,
    camera: Camera,
    frame: FrameState,
    environment: EnvironmentMap | None = None,
) -> Radiance:
    box = PixelBox(0, 0, camera.width_px, camera.height_px)
    return renderer.render(RenderRequest(frame.craft, box, environment, seed=0))


def sky(function: Callable[[FloatArray], FloatArray], height: int = 64) -> EnvironmentMap:
    """A map of ``function``: directions (h, w, 3) in camera axes → radiance (h, w, 3)."""
    return EnvironmentMap(function(directions(height)).astype(np.float32))


def unit_rays(camera: Camera) -> FloatArray:
    rays = camera.rays(PixelBox(0, 0, camera.width_px, camera.height_px).pixel_centres_px())
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def ggx(n_l: FloatArray, n_v: FloatArray, n_h: FloatArray, roughness: float) -> FloatArray:
    """D G₂/(4 n·l n·v) of Heitz, "Understanding the Masking-Shadowing Function" (JCGT 2014), equations
    72 and 99."""
    a2 = roughness**4
    tan2_h = 1 / n_h**2 - 1
    distribution = 1 / (np.pi * a2 * n_h**4 * (1 + tan2_h / a2) ** 2)
    smith = [(np.sqrt(1 + a2 * (1 / c**2 - 1)) - 1) / 2 for c in (n_l, n_v)]
    return np.asarray(distribution / (1 + smith[0] + smith[1]) / (4 * n_l * n_v))


def test_non_square_pixels_and_a_principal_point_off_the_centre(opened: Open) -> None:
    """A small plate has the position and area of the pinhole projection, and its depth is planar z."""
    camera = Camera(64, 48, fx_px=70.0, fy_px=90.0, cx_px=25.3, cy_px=28.9, sensor_width_m=0.01)
    craft = scenes.rectangle(
        "plate", "white", centre_m=(0.2, 0.1, 0.3), u_m=(0.3, 0, 0), v_m=(0, 0.2, 0)
    )
    R = Rotation.from_rotvec([0.2, -0.3, 0.4]).as_matrix() @ scenes.FACING
    frame = scenes.frame(t_body_cam_m=(0.1, -0.05, 2.5), sun_direction_body=(0, 0, 1), R_cam_from_body=R)
    scene = scenes.scene(craft, materials=(WHITE,), camera=camera)
    image = shot(opened(scene, samples_per_axis=7), camera, frame)
    corners = camera.project(craft.vertices_body_m @ R.T + frame.craft.t_body_cam_m)
    a, b = corners, np.roll(corners, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = cross.sum() / 2
    centroid = ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
    u, v = np.moveaxis(PixelBox(0, 0, 64, 48).pixel_centres_px(), -1, 0)
    covered = image.coverage.sum()
    assert covered == pytest.approx(abs(area), rel=5e-3)
    assert (image.coverage * u).sum() / covered == pytest.approx(centroid[0], abs=0.01)
    assert (image.coverage * v).sum() / covered == pytest.approx(centroid[1], abs=0.01)
    normal = R @ [0, 0, 1]
    rays = camera.rays(np.stack([u, v], axis=-1))
    z = normal @ (R @ [0.2, 0.1, 0.3] + frame.craft.t_body_cam_m) / (rays @ normal)
    inside = image.coverage == 1.0
    assert image.depth_m is not None
    np.testing.assert_allclose(image.depth_m[inside], z[inside], atol=1e-5)
    assert np.isnan(image.depth_m[image.coverage == 0.0]).all()


@pytest.mark.parametrize("samples_per_axis", [1, 5])
def test_a_box_is_the_slice_of_the_whole_image(opened: Open, samples_per_axis: int) -> None:
    """Also across the borders of tiles, whose side is 307 pixels with 5 samples per axis."""
    camera = scenes.camera(330, 320)
    craft = scenes.sphere("ball", "white", rings=24)
    scene = scenes.scene(craft, materials=(WHITE,), camera=camera)
    renderer = opened(scene, samples_per_axis=samples_per_axis)
    frame = scenes.frame(t_body_cam_m=(0.8, 0.6, 3), sun_direction_body=(1, 0.3, 0.5))
    whole = shot(renderer, camera, frame)
    assert whole.coverage[300:, 300:].max() == 1.0
    for box in (PixelBox(0, 0, 20, 48), PixelBox(251, 243, 77, 71), PixelBox(329, 319, 1, 1)):
        part = renderer.render(RenderRequest(frame.craft, box, None, seed=7))
        np.testing.assert_array_equal(part.radiance_rgb, whole.radiance_rgb[box.slices])
        np.testing.assert_array_equal(part.coverage, whole.coverage[box.slices])
        np.testing.assert_array_equal(part.depth_m, whole.depth_m[box.slices])  # type: ignore[index]


@pytest.mark.parametrize("tilt", [-0.4, 0.0, 0.5])
def test_a_shadow_has_the_position_of_the_closed_form(opened: Open, tilt: float) -> None:
    """The roof's edge is at x = 0, 2 m above the ground, so its shadow has a hard edge at
    x = −2 tan(tilt)."""
    camera = scenes.camera(128, 8, hfov_rad=1.2)
    ground = scenes.rectangle("ground", "white", u_m=(4, 0, 0), v_m=(0, 4, 0))
    roof = scenes.rectangle("roof", "white", centre_m=(-2, 0, 2), u_m=(2, 0, 0), v_m=(0, 4, 0))
    renderer = opened(scenes.scene(ground, roof, materials=(WHITE,), camera=camera))
    frame = scenes.frame(t_body_cam_m=(0, 0, 1.9), sun_direction_body=(np.sin(tilt), 0, np.cos(tilt)))
    row = shot(renderer, camera, frame).radiance_rgb[4, :, 1]
    x_m = (np.arange(128) - camera.cx_px) / camera.fx_px * 1.9
    lit = frame.craft.sun_irradiance_rgb_w_m2[1] * WHITE.base_color[1] / np.pi * np.cos(tilt)
    edge_m = -2 * np.tan(tilt)
    texel_m = 10 / 2048
    np.testing.assert_allclose(row[x_m > edge_m + 0.02 + 4 * texel_m], lit, rtol=1e-3)
    assert row[x_m < edge_m - 0.02 - 4 * texel_m].max() == 0


def test_a_distant_image_does_not_depend_on_the_one_before_it(opened: Open) -> None:
    """Its shadow map is small, and around it is what another frame has left, on the Sun's side of it."""
    camera = scenes.camera(64, 64, hfov_rad=0.6)
    ground = scenes.rectangle("ground", "white", u_m=(4, 0, 0), v_m=(0, 4, 0))
    roof = scenes.rectangle("roof", "white", centre_m=(0, 0, 2), u_m=(0.5, 0, 0), v_m=(0, 0.5, 0))
    scene = scenes.scene(ground, roof, materials=(WHITE,), camera=camera)
    fresh, used = opened(scene), opened(scene)
    shot(used, camera, scenes.frame(t_body_cam_m=(0, 0, 9), sun_direction_body=(0.1, 0.1, -1)))
    for k in range(8):
        R = Rotation.from_rotvec([0.1, 0.2, 0.3 * k]).as_matrix() @ scenes.FACING
        far = scenes.frame(t_body_cam_m=(0, 0, 110 + k), sun_direction_body=(0, 0, 1), R_cam_from_body=R)
        alone, after = shot(fresh, camera, far), shot(used, camera, far)
        np.testing.assert_array_equal(after.radiance_rgb, alone.radiance_rgb)


def test_shadows_where_many_bodies_share_small_maps(opened: Open) -> None:
    """Of 42 texels across, in an image that would do with fewer. The roof's edge is at x = 0, so that
    its shadow ends at x = 2.06 m, between the two pixels."""
    camera, tilt = scenes.camera(128, 8, hfov_rad=1.2), -0.8
    ground = scenes.rectangle("ground", "white", u_m=(4, 0, 0), v_m=(0, 4, 0))
    roof = scenes.rectangle("roof", "white", centre_m=(-2, 0, 2), u_m=(2, 0, 0), v_m=(0, 4, 0))
    beside = tuple(scenes.sphere(f"ball {k}", "white", rings=4) for k in range(8))
    scene = scenes.scene(ground, roof, materials=(WHITE,), camera=camera, others=beside)
    frame = scenes.frame(
        t_body_cam_m=(0, 0, 80),
        sun_direction_body=(np.sin(tilt), 0, np.cos(tilt)),
        others=tuple(BodyState(np.eye(3), np.array([1e3 + 10 * k, 0, 80.0])) for k in range(8)),
    )
    row = shot(opened(scene, shadow_map_px=64), camera, frame).radiance_rgb[4, :, 1]
    dark, bright = (round(camera.cx_px + x_m / 80 * camera.fx_px) for x_m in (1.28, 2.99))
    lit = frame.craft.sun_irradiance_rgb_w_m2[1] * WHITE.base_color[1] / np.pi * np.cos(tilt)
    assert row[dark] == 0
    assert row[bright] == pytest.approx(lit, rel=1e-3)


def test_the_lit_side_of_a_sphere_has_no_shadow(opened: Open) -> None:
    """Shadow maps tend to leave stripes where light grazes a curved surface."""
    camera = scenes.camera(96, 96, hfov_rad=0.6)
    renderer = opened(
        scenes.scene(scenes.sphere("ball", "white", rings=96), materials=(WHITE,), camera=camera)
    )
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(1, 0, 0))
    image = shot(renderer, camera, frame)
    rays = unit_rays(camera)
    along = rays[..., 2] * 4
    inside = along**2 - 15
    normals = rays * (along - np.sqrt(np.maximum(inside, 0)))[..., None] - [0, 0, 4]
    cosine = normals @ frame.craft.sun_direction_cam
    day = (image.coverage == 1) & (cosine > 0.05)
    lit = frame.craft.sun_irradiance_rgb_w_m2[1] * WHITE.base_color[1] / np.pi
    np.testing.assert_allclose(image.radiance_rgb[day][:, 1], lit * cosine[day], rtol=0.03)


def test_the_sun_is_mirrored_but_not_seen(opened: Open) -> None:
    """The centre of the Sun's reflection has the radiance of the disc, E/(π sin²α)."""
    camera = scenes.camera(33, 33, hfov_rad=0.2)
    craft = scenes.rectangle("plate", "mirror", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(MIRROR,), camera=camera))
    alpha = 0.05
    frame = scenes.frame(
        t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), sun_angular_radius_rad=alpha
    )
    image = shot(renderer, camera, frame)
    expected = frame.craft.sun_irradiance_rgb_w_m2 / (np.pi * np.sin(alpha) ** 2)
    np.testing.assert_allclose(image.radiance_rgb[16, 16], expected, rtol=2e-2)
    away = scenes.frame(t_body_cam_m=(0, 0, -4), sun_direction_body=(0, 0, -1))
    image = shot(renderer, camera, away)
    assert image.radiance_rgb.max() == 0
    assert image.coverage.max() == 0


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_a_rough_metal_under_the_sun(opened: Open, roughness: float) -> None:
    """F D G₂/4 with Schlick's F, in another form than the shader's."""
    gold = Material("gold", base_color=(0.9, 0.7, 0.3), metallic=1.0, roughness=roughness)
    camera = scenes.camera(16, 12)
    craft = scenes.rectangle("plate", "gold", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(gold,), camera=camera))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0.6, 0.2, 0.5))
    image = shot(renderer, camera, frame)
    v, l, n = -unit_rays(camera), frame.craft.sun_direction_cam, scenes.FACING @ [0, 0, 1]
    h = (v + l) / np.linalg.norm(v + l, axis=-1, keepdims=True)
    fresnel = np.array(gold.base_color)
    fresnel = fresnel + (1 - fresnel) * (1 - (v * h).sum(axis=-1, keepdims=True)) ** 5
    lobe = ggx(np.full((12, 16), n @ l), v @ n, h @ n, roughness)[..., None]
    expected = frame.craft.sun_irradiance_rgb_w_m2 * fresnel * lobe * (n @ l)
    np.testing.assert_allclose(image.radiance_rgb, expected, rtol=5e-3)


def test_radiance_is_finite_where_the_sun_is_behind_the_camera(opened: Open) -> None:
    """There v·h and n·l may exceed 1 by rounding, and a power or root of 1 minus them would be NaN."""
    gold = Material("gold", base_color=(0.9, 0.7, 0.3), metallic=1.0, roughness=0.6)
    camera = scenes.camera(64, 48, hfov_rad=1.5)
    craft = scenes.sphere("ball", "gold", rings=48)
    renderer = opened(scenes.scene(craft, materials=(gold,), camera=camera))
    rays = unit_rays(camera)
    for row, column in np.random.default_rng(0).integers(8, 40, (40, 2)):
        towards = -scenes.FACING.T @ rays[row, column]
        frame = scenes.frame(t_body_cam_m=(0, 0, 1.6), sun_direction_body=tuple(towards))
        assert np.isfinite(shot(renderer, camera, frame).radiance_rgb).all()


def test_a_mirror_shows_the_sky_in_the_right_direction(opened: Open) -> None:
    """Each band is linear in one camera axis, so the radiance gives the mirrored direction."""
    camera = scenes.camera(24, 18)
    craft = scenes.rectangle("plate", "mirror", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(MIRROR,), camera=camera))
    rays = unit_rays(camera)
    for scale, turn in ((1.0, [0.3, -0.2, 0.5]), (2.0, [-0.4, 0.1, 2.0])):
        environment = sky(lambda d, scale=scale: scale * (2.0 + d))
        R = Rotation.from_rotvec(turn).as_matrix() @ scenes.FACING
        frame = scenes.frame(
            t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), R_cam_from_body=R, sun_fraction=0.0
        )
        image = shot(renderer, camera, frame, environment)
        normal = R @ [0, 0, 1]
        mirrored = rays - 2 * (rays @ normal)[..., None] * normal
        np.testing.assert_allclose(image.radiance_rgb, scale * (2.0 + mirrored), rtol=5e-3)


def test_matt_plates_under_a_sky_brighter_on_one_side(opened: Open) -> None:
    """A sky of radiance a + b·d gives a plate the irradiance π (a + ⅔ b·n)."""
    camera = scenes.camera(8, 6)
    craft = scenes.rectangle("plate", "white", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(WHITE,), camera=camera))
    environment = sky(lambda d: 2.0 + d)
    for turn in ([0.0, 0.0, 0.0], [0.9, 0.3, 0.0], [-0.5, 0.8, 1.0]):
        R = Rotation.from_rotvec(turn).as_matrix() @ scenes.FACING
        frame = scenes.frame(
            t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), R_cam_from_body=R, sun_fraction=0.0
        )
        image = shot(renderer, camera, frame, environment)
        expected = WHITE.base_color * (2.0 + 2 / 3 * (R @ [0, 0, 1]))
        np.testing.assert_allclose(image.radiance_rgb.mean(axis=(0, 1)), expected, rtol=1e-2)
    assert shot(renderer, camera, frame).radiance_rgb.max() == 0


@pytest.mark.parametrize(("metallic", "roughness"), [(1.0, 0.25), (1.0, 0.8), (0.0, 0.4)])
def test_a_uniform_sky_on_a_rough_surface(opened: Open, metallic: float, roughness: float) -> None:
    """The reflectance is the integral of the lobe over the hemisphere."""
    paint = Material("paint", base_color=(0.9, 0.6, 0.2), metallic=metallic, roughness=roughness)
    camera = scenes.camera(9, 9, hfov_rad=0.01)
    craft = scenes.rectangle("plate", "paint", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(paint,), camera=camera))
    R = Rotation.from_rotvec([0.0, 0.9, 0.0]).as_matrix() @ scenes.FACING
    frame = scenes.frame(
        t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), R_cam_from_body=R, sun_fraction=0.0
    )
    image = shot(renderer, camera, frame, sky(lambda d: np.full_like(d, 3.0)))
    cosine = (np.arange(600) + 0.5) / 600
    phi = 2 * np.pi * (np.arange(600) + 0.5) / 600
    n_l, phi = np.meshgrid(cosine, phi, indexing="ij")
    sine = np.sqrt(1 - n_l**2)
    l = np.stack([sine * np.cos(phi), sine * np.sin(phi), n_l], axis=-1)
    v = np.array([np.sin(0.9), 0, np.cos(0.9)])
    h = (l + v) / np.linalg.norm(l + v, axis=-1, keepdims=True)
    lobe = ggx(n_l, np.full_like(n_l, v[2]), h[..., 2], roughness) * n_l
    schlick = (1 - h @ v) ** 5
    f0 = np.array(paint.base_color) * metallic + 0.04 * (1 - metallic)
    albedo = (lobe[..., None] * (f0 + (1 - f0) * schlick[..., None])).mean(axis=(0, 1)) * 2 * np.pi
    diffuse = (1 - metallic) * np.array(paint.base_color) * (1 - albedo)
    np.testing.assert_allclose(image.radiance_rgb[4, 4], 3.0 * (albedo + diffuse), rtol=1e-2)


def test_a_distant_texture_keeps_its_mean_reflectance(opened: Open) -> None:
    """Many black and white stripes within a pixel are half as bright as white. (An average of sRGB codes
    would give 21 %.)"""
    texture = np.zeros((256, 250, 3), dtype=np.uint8)
    texture[:, ::2] = 255
    paint = Material("paint", specular=0.0, base_color_texture=texture)
    camera = scenes.camera(16, 12)
    craft = scenes.rectangle("plate", "paint", u_m=(3, 0, 0), v_m=(0, 3, 0))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1))
    image = shot(opened(scenes.scene(craft, materials=(paint,), camera=camera)), camera, frame)
    reflectance = image.radiance_rgb * np.pi / frame.craft.sun_irradiance_rgb_w_m2
    assert reflectance.mean() == pytest.approx(0.5, rel=1e-2)


def test_a_normal_map_turns_the_normal(opened: Open) -> None:
    texel = np.array([180, 90, 230], dtype=np.uint8)
    paint = Material("paint", specular=0.0, normal_texture=np.tile(texel, (4, 4, 1)))
    camera = scenes.camera(16, 12)
    normal = 2 * (texel / 255) - 1
    normal /= np.linalg.norm(normal)
    u, v = np.array([0.8, 0.6, 0.0]), np.array([-0.6, 0.8, 0.0])
    craft = scenes.rectangle("plate", "paint", u_m=tuple(9 * u), v_m=tuple(9 * v))
    renderer = opened(scenes.scene(craft, materials=(paint,), camera=camera))
    turned = normal[0] * u + normal[1] * v + normal[2] * np.array([0, 0, 1])
    for sun in ((0.5, 0.0, 0.8), (0.0, 0.5, 0.8)):
        frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=sun)
        image = shot(renderer, camera, frame)
        expected = (
            frame.craft.sun_irradiance_rgb_w_m2 / np.pi * (turned @ frame.craft.sun_direction_body)
        )
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
    lit = frame.craft.sun_irradiance_rgb_w_m2 * 0.8 / np.pi
    assert (
        image.radiance_rgb[:, 1:5].max() < 1e-2 * lit.min()
    )  # the Sun's reflection is outside the image
    np.testing.assert_allclose(image.radiance_rgb[6, 12], lit, rtol=1e-2)


def test_the_maps_of_an_environment_are_kept_until_another_one_comes(opened: Open) -> None:
    """The same bits as from a renderer that made them for this image, in any order."""
    ball = scenes.sphere("ball", "white", rings=16)
    scene = scenes.scene(ball, materials=(WHITE,), camera=scenes.camera(48, 36))
    frame = scenes.frame(
        t_body_cam_m=(0.0, 0.0, 8.0), sun_direction_body=(0.0, 0.0, 1.0), solar_flux_w_m2=0.0
    )
    dim, bright = (sky(lambda d, level=level: level * (1 + d)) for level in (1.0, 3.0))
    alone = [shot(opened(scene), scene.camera, frame, each).radiance_rgb for each in (dim, bright)]
    assert (alone[1] > alone[0]).any()
    renderer = opened(scene)
    for which in (0, 0, 1, None, 1, 0):
        environment = None if which is None else (dim, bright)[which]
        light = shot(renderer, scene.camera, frame, environment).radiance_rgb
        if which is None:
            assert not light.any()
        else:
            np.testing.assert_array_equal(light, alone[which])
