"""Random poses, and closed forms against what another formula says of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posse_core._errors import InputError
from posse_core._evaluation.crosscheck.closed_forms import CLOSED_FORMS, ClosedFormCase
from posse_core._evaluation.crosscheck.settings import CLEARANCE_RADII, ScenarioCase
from posse_core._evaluation.crosscheck.silhouette import Geometry, landmark_errors_px
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario

SMALL = {"camera.width_px": 80, "camera.height_px": 60, "sky.earth": False, "sky.stars": None}


def scenario_case(count: int) -> ScenarioCase:
    scenario = load_scenario("cluster", load_plugins().registry, SMALL)
    return ScenarioCase("cluster", scenario, "random", count)


def test_random_poses_are_in_view_lit_and_everywhere() -> None:
    setting = scenario_case(100).build()
    geometry = Geometry(setting.scene)
    radius_m = setting.scene.spacecraft.radius_m
    suns, boresights = [], []
    for frame in setting.frames:
        assert not geometry.box(frame).is_empty
        assert frame.craft.range_m >= CLEARANCE_RADII * radius_m * (1 - 1e-12)
        assert frame.sun_fraction_target > 0.98
        for R in (frame.craft.R_cam_from_body, frame.R_cam_from_eci):
            np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
            assert np.linalg.det(R) > 0
        to_target = frame.R_cam_from_eci @ (frame.r_target_eci_m - frame.r_camera_eci_m)
        np.testing.assert_allclose(to_target, frame.craft.t_body_cam_m, atol=1e-6)
        suns.append(frame.craft.sun_direction_body)
        boresights.append(frame.craft.R_cam_from_body[2])
    for directions in (np.array(suns), np.array(boresights)):
        # An even spread over the sphere: mean 0, covariance I/3; both within four standard errors.
        assert np.abs(directions.mean(axis=0)).max() < 4 * np.sqrt(1 / 3 / 100)
        assert np.abs(np.cov(directions.T) - np.eye(3) / 3).max() < 4 * np.sqrt(4 / 45 / 100)


def test_a_setting_is_the_same_each_time_and_follows_the_seed() -> None:
    case = scenario_case(3)
    one, two = case.build(), case.build()
    seed = case.scenario.model_copy(update={"seed": 1})
    other = ScenarioCase(case.name, seed, "random", 3).build()
    for a, b, c in zip(one.frames, two.frames, other.frames, strict=True):
        assert a.craft.R_cam_from_body.tobytes() == b.craft.R_cam_from_body.tobytes()
        assert a.craft.t_body_cam_m.tobytes() == b.craft.t_body_cam_m.tobytes()
        assert not np.allclose(a.craft.R_cam_from_body, c.craft.R_cam_from_body)


def test_trajectory_poses_are_the_scenarios() -> None:
    case = scenario_case(4)
    setting = ScenarioCase(case.name, case.scenario, "trajectory", 4).build()
    assert [frame.index for frame in setting.frames] == [0, 1, 2, 3]
    spread = np.diff([frame.t_s for frame in setting.frames])
    assert spread.min() > 0
    assert np.ptp(spread) < 0.05 * spread.mean()


def test_a_target_that_is_never_in_sunlight_is_refused() -> None:
    registry = load_plugins().registry
    times = {"t_s": [2000.0]}
    aqua = load_scenario("aqua", registry, {**SMALL, "times": times, "target.name": "cluster"})
    dark = ScenarioCase("aqua", aqua, "trajectory", 1).build().frames[0]
    assert dark.sun_fraction_target == 0.0, "the time was chosen to be in eclipse"
    with pytest.raises(InputError, match="never in full sunlight; take --poses trajectory"):
        ScenarioCase("aqua", aqua, "random", 2).build()


@pytest.mark.parametrize("name", sorted(CLOSED_FORMS))
def test_closed_forms_are_finite_where_known_and_cover_the_craft(name: str) -> None:
    setting = ClosedFormCase(name).build()
    geometry = Geometry(setting.scene)
    assert [frame.index for frame in setting.frames] == list(range(len(setting.frames)))
    for frame in setting.frames[:2]:
        exact = geometry.exact(frame)
        expected = setting.expected_rgb(frame)
        if expected is not None:
            known = np.isfinite(expected).all(axis=-1)[exact.box.slices] & (exact.coverage == 1)
            assert known.sum() > 0.15 * (exact.coverage == 1).sum()
            assert np.nanmin(expected) >= 0
        places = setting.landmarks_px(frame)
        if places is not None:
            for part, (u, v) in enumerate(np.round(places).astype(int) - [exact.box.x0, exact.box.y0]):
                assert exact.part_id[v, u] == part


def test_landmarks_tell_a_joint_that_is_one_degree_off() -> None:
    setting = ClosedFormCase("moved-fiducials").build()
    frame = setting.frames[0]
    exact = Geometry(setting.scene).exact(frame)
    joints = frame.craft.articulation
    off = replace(joints, values=joints.values + np.radians([1.0, 0.0, 0.0]))
    there = setting.landmarks_px(frame)
    elsewhere = setting.landmarks_px(replace(frame, craft=replace(frame.craft, articulation=off)))
    assert there is not None
    assert elsewhere is not None
    assert landmark_errors_px(exact.coverage, exact, there).max() < 0.03
    errors = landmark_errors_px(exact.coverage, exact, elsewhere)
    moved = np.linalg.norm(elsewhere - there, axis=1)
    assert moved[3:6].min() > 0.3
    np.testing.assert_array_equal(np.delete(moved, [3, 4, 5]), 0.0)
    np.testing.assert_allclose(errors[3:6], moved[3:6], atol=0.03)


def test_a_white_metal_reflects_no_more_than_falls_on_it() -> None:
    """The lobe of the glossy sphere, integrated over directions: below E, and most of it, since one
    reflection loses what would scatter between facets."""
    setting = ClosedFormCase("glossy-sphere").build()
    frame = setting.frames[0]
    expected = setting.expected_rgb(frame)
    assert expected is not None
    # A sphere in sunlight intercepts E π R²; seen from all sides it sends that out, on average
    # E π R² / 4π towards each. A metal's intensity does not depend much on the phase angle.
    pixel_sr = 1 / setting.scene.camera.fx_px**2
    sums = [np.sum(setting.expected_rgb(f), axis=(0, 1)) for f in setting.frames]
    intensity = np.mean(sums, axis=0) * pixel_sr * frame.craft.range_m**2
    even = frame.craft.sun_irradiance_rgb_w_m2 / 4
    assert (intensity / even > 0.7).all()
    assert (intensity / even < 1.3).all()


def test_the_checkers_cells_alternate_and_hold_their_codes() -> None:
    setting = ClosedFormCase("checker").build()
    frame = setting.frames[0]
    expected = setting.expected_rgb(frame)
    assert expected is not None
    white = frame.craft.sun_irradiance_rgb_w_m2 / np.pi * frame.craft.sun_direction_body[2]
    levels = np.unique((expected / white)[np.isfinite(expected)].round(9))
    assert levels == pytest.approx([0.0512695, 1.0], abs=1e-6)  # IEC 61966-2-1 of code 64, and 255
