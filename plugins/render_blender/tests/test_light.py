"""Behaviour that the conformance kit does not cover: mirrors, cameras without square pixels, and equal
bits for any box and the same seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import (
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
    return renderer.render(RenderRequest(frame.craft, box, environment, seed=7))


def sky(function: Callable[[FloatArray], FloatArray], height: int = 64) -> EnvironmentMap:
    """A map of ``function``: directions (h, w, 3) in camera axes → radiance (h, w, 3)."""
    return EnvironmentMap(function(directions(height)).astype(np.float32))


def test_non_square_pixels_and_a_principal_point_off_the_centre(opened: Open) -> None:
    """A small plate has the position and area of the pinhole projection, and its depth is planar z."""
    camera = Camera(64, 48, fx_px=70.0, fy_px=90.0, cx_px=25.3, cy_px=28.9, sensor_width_m=0.01)
    craft = scenes.rectangle(
        "plate", "white", centre_m=(0.2, 0.1, 0.3), u_m=(0.3, 0, 0), v_m=(0, 0.2, 0)
    )
    R = Rotation.from_rotvec([0.2, -0.3, 0.4]).as_matrix() @ scenes.FACING
    frame = scenes.frame(t_body_cam_m=(0.1, -0.05, 2.5), sun_direction_body=(0, 0, 1), R_cam_from_body=R)
    image = shot(opened(scenes.scene(craft, materials=(WHITE,), camera=camera), spp=256), camera, frame)
    corners = camera.project(craft.vertices_body_m @ R.T + frame.craft.t_body_cam_m)
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
    z = normal @ (R @ [0.2, 0.1, 0.3] + frame.craft.t_body_cam_m) / (rays @ normal)
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
        part = renderer.render(RenderRequest(frame.craft, box, None, seed=7))
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
        renderer.render(RenderRequest(frame.craft, box, None, seed)).radiance_rgb for seed in (1, 2, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_the_sun_is_mirrored_but_not_seen(opened: Open) -> None:
    """A mirror shows the Sun's disc with the radiance E/(π sin²α); the camera does not see it
    directly."""
    camera = scenes.camera(33, 33, hfov_rad=0.2)
    craft = scenes.rectangle("plate", "mirror", u_m=(9, 0, 0), v_m=(0, 9, 0))
    renderer = opened(scenes.scene(craft, materials=(MIRROR,), camera=camera), spp=256)
    alpha = 0.05
    frame = scenes.frame(
        t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), sun_angular_radius_rad=alpha
    )
    image = shot(renderer, camera, frame)
    expected = frame.craft.sun_irradiance_rgb_w_m2 / (np.pi * np.sin(alpha) ** 2)
    np.testing.assert_allclose(image.radiance_rgb[16, 16], expected, rtol=5e-3)
    assert image.radiance_rgb[0].max() == 0
    away = scenes.frame(
        t_body_cam_m=(0, 0, -4), sun_direction_body=(0, 0, -1), sun_angular_radius_rad=alpha
    )
    image = shot(renderer, camera, away)
    assert image.radiance_rgb.max() == 0
    assert image.coverage.max() == 0


def test_a_mirror_shows_the_sky_in_the_right_direction(opened: Open) -> None:
    """Each band is linear in one camera axis, so the radiance gives the mirrored direction."""
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
    assert image.radiance_rgb[:, 1:5].max() == 0  # the Sun's reflection is outside the image
    np.testing.assert_allclose(
        image.radiance_rgb[6, 12], frame.craft.sun_irradiance_rgb_w_m2 * 0.8 / np.pi, rtol=1e-2
    )


def test_describe_reports_versions_and_device(opened: Open) -> None:
    camera = scenes.camera(16, 12)
    renderer = opened(
        scenes.scene(scenes.rectangle("plate", "white"), materials=(WHITE,), camera=camera)
    )
    described = renderer.describe()
    assert described["device"] == "cpu"
    assert tuple(int(n) for n in described["blender"].split()[0].split(".")[:2]) >= (4, 5)
