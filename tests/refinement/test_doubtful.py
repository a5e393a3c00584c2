"""Where no pose is certain, more of them are sought."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import CraftState, PixelBox, PoseEstimate, Renderer, RenderRequest, Scene
from posse_core._evaluation.poses import pose_errors
from posse_core._frames import matrix_from_quaternion
from posse_core._imaging.grey import to_grey
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.registry import Registry
from posse_core._randomness import random_generator
from posse_core._refinement.follower import Follower
from posse_core._refinement.opening import open_refiner
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Studio
from posse_core._refinement.turns import BESIDE, CLOSE, FAR, Around, half_turn_axes, half_turned, tilted
from posse_core._scenario.component import ComponentChoice
from posse_core.testing import scenes
from tests.support.raycast_images import CAMERA, HERE, SUN, light_of, needs_raster, with_booms

CLUSTERS_SUN = np.array([-0.335, -0.8133, -0.4757]) / np.linalg.norm([-0.335, -0.8133, -0.4757])


@needs_raster
@pytest.mark.slow
def test_a_trusted_start_that_leads_nowhere_does_not_hide_another() -> None:
    """It is 100° off, and the other start 35° and 7 % of the range. The spacecraft looks alike from a
    pose turned by half a turn about its short boom."""
    craft = with_booms(0.012, (0.25, 0.2, 0.2))
    image = np.rint(255 * np.clip(0.8 * light_of(craft)[0], 0, 1)).astype(np.uint8)
    draw = random_generator(3, 0, "start")
    starts = []
    for off_deg, share, certainty in ((100, 1.05, 0.3), (35, 1.07, 0.05)):
        axis = draw.standard_normal(3)
        turn = Rotation.from_rotvec(np.radians(off_deg) * axis / np.linalg.norm(axis)).as_matrix()
        place_m = share * HERE.t_body_cam_m
        covariance, inliers = np.eye(6) * 1e-3, np.ones(8, bool)
        starts.append(
            PoseEstimate(
                turn @ HERE.R_cam_from_body, place_m, covariance, inliers, 1.0, certainty=certainty
            )
        )
    choice = ComponentChoice(name="render-compare")
    with contextlib.closing(open_refiner(load_plugins().registry, choice, craft, CAMERA)) as refiner:
        made = refiner.refine(image, starts, SUN)
    half = Rotation.from_rotvec([np.pi, 0, 0]).as_matrix()
    e_t, e_q = pose_errors(*HERE, made.pose.R_cam_from_body, made.pose.t_body_cam_m, (half,))
    assert made.is_better
    assert e_t < 0.002
    assert np.degrees(e_q) < 0.5


@needs_raster
@pytest.mark.slow
def test_steps_that_end_beside_the_right_pose_are_made_again_from_its_neighbours() -> None:
    """Cluster in noise, a hundred pixels wide, from 12° off, from where steps alone end 0.4° off, at a
    lesser agreement."""
    registry, setting, image, right, start = _cluster(58.83)
    choice = ComponentChoice(name="render-compare")
    with contextlib.closing(
        open_refiner(registry, choice, setting.spacecraft, setting.camera)
    ) as refiner:
        made = refiner.refine(image, [start], CLUSTERS_SUN)
    _, e_q_rad = pose_errors(*right, made.pose.R_cam_from_body, made.pose.t_body_cam_m, ())
    assert made.is_better
    assert np.degrees(e_q_rad) < 0.3
    assert made.agreement > 0.977


@needs_raster
@pytest.mark.parametrize(("range_m", "number_of_scales"), [(500.0, 1), (400.0, 2)])
@pytest.mark.parametrize("around", [FAR, CLOSE, BESIDE])
def test_of_few_pixels_poses_nearby_are_drawn_at_the_finest_scale_that_there_is(
    range_m: float, number_of_scales: int, around: Around
) -> None:
    """Cluster, twelve pixels wide or fifteen."""
    _, setting, image, right, start = _cluster(range_m)
    with contextlib.closing(Studio(setting, ComponentChoice(name="raster"))) as studio:
        follower = Follower(
            setting, studio, to_grey(image), CLUSTERS_SUN, 192.0, 0.7, lambda: True, None
        )
        follower.starts = [start]
        several = follower.scales(right)
        assert len(several) == number_of_scales
        (drawn,) = follower.drawn([right], around.scale, CLUSTERS_SUN)
    index = around.scale if around.scale < number_of_scales else -1
    assert {crop.scale for crop in drawn.crops} == {several[index]}


def _cluster(
    range_m: float,
) -> tuple[Registry, RefinerSetting, np.ndarray, Placement, PoseEstimate]:
    """Cluster in noise as an image (h, w), its pose in it, and a start 12° off."""
    registry = load_plugins().registry

    def renderer(name: str, options: Mapping[str, Any], scene: Scene) -> Renderer:
        made: Renderer = registry.create("renderer", name, registry.options("renderer", name, options))
        made.open(scene)
        return made

    craft = registry.create("scene", "cluster", registry.options("scene", "cluster", {})).build()
    setting = RefinerSetting(
        craft.welded(()), scenes.camera(256, 192, 2 * np.arctan(128 / 640)), renderer
    )
    R = matrix_from_quaternion(np.array([0.570042, -0.618009, -0.529651, 0.112195]))
    t_m = np.array([0.35, -0.19, range_m])
    state = CraftState(
        R,
        t_m,
        sun_direction_cam=CLUSTERS_SUN,
        sun_irradiance_rgb_w_m2=np.full(3, np.pi),
        sun_angular_radius_rad=0.0047,
    )
    box = PixelBox(0, 0, setting.camera.width_px, setting.camera.height_px)
    with contextlib.closing(renderer("raster", {}, Scene(setting.spacecraft, setting.camera))) as by:
        light = by.render(RenderRequest(state, box, None, 0)).radiance_rgb.mean(axis=-1)
    coded = 255 * np.clip(1.2 * light, 0, 1) ** (1 / 2.2)
    noise = np.random.default_rng(0).normal(0, 6, coded.shape)
    image = np.rint(np.clip(coded + noise, 0, 255)).astype(np.uint8)
    turn = np.radians(12) * np.array([0.5, -0.8, 0.2]) / np.linalg.norm([0.5, -0.8, 0.2])
    start = PoseEstimate(
        Rotation.from_rotvec(turn).as_matrix() @ R,
        1.002 * t_m,
        np.diag([0.03, 0.03, 0.03, 0.01, 0.01, 1.0]),
        np.ones(8, bool),
        1.0,
        certainty=0.9,
    )
    return registry, setting, image, Placement(R, t_m), start


@pytest.mark.parametrize(
    ("around", "angles_deg"), [(FAR, [12] * 6 + [25] * 8), (CLOSE, [5] * 6), (BESIDE, [10] * 6)]
)
def test_poses_nearby_are_tilted_about_axes_across_the_line_of_sight(
    around: Around, angles_deg: list[float]
) -> None:
    turns = [
        Rotation.from_matrix(each.R_cam_from_body @ HERE.R_cam_from_body.T).as_rotvec(degrees=True)
        for each in tilted(HERE, around)
    ]
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), angles_deg, atol=1e-9)
    np.testing.assert_allclose(np.array(turns)[:, 2], 0, atol=1e-9)
    np.testing.assert_allclose(np.sum(turns, axis=0), 0, atol=1e-9)


def test_half_turns_are_about_axes_that_stand_apart_and_end_at_the_start_if_made_twice() -> None:
    """The body axes, and fifteen across the principal axes, of which no two are nearer than 30°."""
    vertices_m = np.random.default_rng(0).normal(size=(200, 3)) * [3, 2, 1]
    axes = half_turn_axes(vertices_m)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1)
    across = np.abs(axes[3:] @ axes[3:].T) - np.eye(15)
    assert np.degrees(np.arccos(across.max())) == pytest.approx(30)
    for axis, turned in zip(axes, half_turned(HERE, axes), strict=True):
        np.testing.assert_allclose(
            turned.R_cam_from_body @ axis, HERE.R_cam_from_body @ axis, atol=1e-12
        )
        twice = half_turned(turned, axis[None])[0]
        np.testing.assert_allclose(twice.R_cam_from_body, HERE.R_cam_from_body, atol=1e-12)
        np.testing.assert_allclose(twice.t_body_cam_m, HERE.t_body_cam_m)
