"""The built-in scenario aqua-tracking: its wing against the Sun by ERFA and rotations by SciPy; its
labels against OpenCV's projection; and joints that a caller gives."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import cv2
import erfa
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from posse_core import FloatArray, FrameState, InputError
from posse_core._cli.main import posse
from posse_core._environment.time import Epoch
from posse_core._model.label_line import LabelLine
from posse_core._plugins.loading import Plugins
from posse_core._run.plan import Plan, make_plan
from posse_core._scenario.load import dump_scenario, load_scenario
from posse_core._simulator.simulator import Simulator

FLAT = Path(__file__).parents[1] / "packages" / "flat"
AU_M = 149_597_870_700.0
SMALL = {"camera.width_px": 320, "camera.height_px": 240, "renderer.name": "flat"}
AXIS = np.array([0.0, 1.0, 0.0])
"""Aqua's wing is along −Y."""


@pytest.fixture(scope="module")
def registry():
    """With a renderer that is quick."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FLAT)
        yield Plugins([EntryPoint("render_flat", "posse_flat", "posse")]).registry


@pytest.fixture(scope="module")
def simulator(registry):
    """Of the scenario with other keys; one that has been opened is opened no more."""
    known: dict[str, Simulator] = {}

    def opened(**overrides: object) -> Simulator:
        scenario = load_scenario("aqua-tracking", registry, {**SMALL, **overrides})
        key = dump_scenario(scenario)
        if key not in known:
            known[key] = Simulator(scenario, registry)
        return known[key]

    yield opened
    for each in known.values():
        each.close()


def wing(state: FrameState) -> tuple[float, float]:
    (value,), (rate,) = state.craft.articulation.values, state.craft.articulation.rates
    return float(value), float(rate)


def normal_and_sun(sim: Simulator, index: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The cells' normal, the Sun's direction and the wing's axis, all in GCRF axes: attitude from the
    trajectory's file, Sun from VSOP (Moisson & Bretagnon 2001) instead of DE421."""
    row = sim.trajectory.rows(np.array([index]))
    R = Rotation.from_quat(row.q_eci_from_body[0], scalar_first=True)
    value, _ = wing(sim.state(index))
    normal = R.apply(Rotation.from_rotvec(value * AXIS).apply([1.0, 0.0, 0.0]))
    earth, _ = erfa.epv00(*Epoch.from_iso(row.epoch_utc).tdb(row.t_s[0]))
    sun_m = -earth["p"] * AU_M - row.r_target_eci_m[0]
    return normal, sun_m / np.linalg.norm(sun_m), R.apply(AXIS)


def test_over_an_orbit_the_cells_are_as_near_to_the_sun_as_the_axis_allows(simulator) -> None:
    """That is along the Sun's projection on the plane across the axis. The Sun itself is 22° off."""
    sim = simulator()
    angles = []
    for index in range(0, 101, 4):
        normal, sun, axis = normal_and_sun(sim, index)
        nearest = np.cross(np.cross(axis, sun), axis)
        assert np.linalg.norm(np.cross(normal, nearest)) < 1e-6 * np.linalg.norm(nearest)
        assert normal @ nearest > 0
        angles.append(wing(sim.state(index))[0])
    turns = np.diff(np.unwrap(angles)) / (2 * np.pi)
    assert abs(turns.sum()) == pytest.approx(24 / 25 * 100 / 96, rel=0.02)
    assert (turns > 0).all() or (turns < 0).all()


def test_where_the_axis_is_across_the_sun_the_cells_face_it(simulator) -> None:
    """In attitudes that a caller gives: any that is turned about the Sun or about the axis."""
    sim = simulator(**{"target.panel_angle_deg": 37})
    facing = Rotation.from_rotvec(np.radians(37) * AXIS).apply([1.0, 0.0, 0.0])
    rng = np.random.default_rng(8)
    for index in range(6):
        own = sim.state(index)
        row = sim.trajectory.rows(np.array([index]))
        earth, _ = erfa.epv00(*Epoch.from_iso(row.epoch_utc).tdb(row.t_s[0]))
        sun = -earth["p"] * AU_M - own.r_target_eci_m
        sun = sun / np.linalg.norm(sun)
        axis = np.cross(sun, rng.normal(size=3))
        axis = axis / np.linalg.norm(axis)
        R = Rotation.from_matrix(np.column_stack([np.cross(axis, sun), axis, sun]))
        R = R * Rotation.from_rotvec(rng.uniform(-3, 3) * AXIS)
        state = sim.state(index, q_eci_from_body=R.as_quat(scalar_first=True))
        value, _ = wing(state)
        normal = R.apply(Rotation.from_rotvec(value * AXIS).apply(facing))
        assert np.linalg.norm(np.cross(normal, sun)) < 1e-6
        assert normal @ sun > 0


def test_the_rate_is_how_the_value_changes(simulator) -> None:
    sim = simulator()
    for index in (0, 30, 77):
        t_s = float(sim.trajectory.t_s[index])
        before, after = (wing(sim.state(index, t_s=t_s + d))[0] for d in (-0.5, 0.5))
        value, rate = wing(sim.state(index))
        assert rate == pytest.approx((after - before + np.pi) % (2 * np.pi) - np.pi, abs=2e-7)
        assert abs(rate) > 1e-4
        onward = sim.state(index).onward
        assert onward is not None
        soon, by_rates = onward.at(0.5), sim.state(index).after(0.5)
        assert wing(soon)[0] == wing(sim.state(index, t_s=t_s + 0.5))[0]
        assert wing(by_rates)[0] == pytest.approx(value + 0.5 * rate, abs=1e-15)
        following = onward.next_frame()
        assert following is not None
        assert wing(following) == wing(sim.state(index + 1))


def projected(sim: Simulator, x_link_m: FloatArray, R: Rotation, t_m: FloatArray) -> FloatArray:
    camera = sim.camera
    K = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1.0]])
    px, _ = cv2.projectPoints(x_link_m[None], R.as_rotvec(), t_m, K, None)
    return px.ravel()


@pytest.mark.parametrize("index", [3, 40, 90])
def test_keypoints_are_where_the_joints_labels_say(simulator, index: int) -> None:
    """Those on the wing by its link's pose, those on the bus by the body's; and the wing's pose follows
    from the body's and from the joint's value."""
    sim = simulator()
    labels: LabelLine = sim.frame(sim.state(index)).labels
    craft = sim.spacecraft
    assert {name for name, joint in craft.keypoint_joints.items() if joint == "wing"} == {
        *("S1", "S2", "S3", "S4")
    }
    link = labels.joints["wing"]
    R_link = Rotation.from_quat(link.q_cam_from_link, scalar_first=True)
    R_body = Rotation.from_quat(labels.q_cam_from_body, scalar_first=True)
    t_body_m = np.array(labels.t_body_cam_m)
    (joint,) = craft.joints
    turn = Rotation.from_rotvec(link.value * joint.axis_body)
    np.testing.assert_allclose(R_link.as_matrix(), (R_body * turn).as_matrix(), atol=1e-12)
    still_m = joint.origin_body_m - turn.apply(joint.origin_body_m)
    np.testing.assert_allclose(link.t_link_cam_m, R_body.apply(still_m) + t_body_m, atol=1e-12)
    for name, x_m in craft.keypoints_body_m.items():
        moved = name in craft.keypoint_joints
        pose = (R_link, np.array(link.t_link_cam_m)) if moved else (R_body, t_body_m)
        if labels.keypoints[name].u_px is not None:
            found = labels.keypoints[name].u_px, labels.keypoints[name].v_px
            np.testing.assert_allclose(found, projected(sim, x_m, *pose), atol=1e-6)
    assert any(labels.keypoints[f"S{k}"].visibility == 2 for k in (1, 2, 3, 4))


def test_the_wing_at_zero_is_the_rigid_aqua(simulator) -> None:
    """A joint that is held shows what a joint without a law does."""
    held, rigid = simulator(**{"joints.wing.law": "fixed"}), simulator(joints={})
    assert not rigid.spacecraft.joints
    one, other = held.frame(held.state(5)), rigid.frame(rigid.state(5))
    assert not other.labels.has("joints")
    for key in ("mask_rle", "part_area_px", "box_visible_px", "q_cam_from_body", "t_body_cam_m"):
        assert getattr(one.labels, key) == getattr(other.labels, key)
    for name, keypoint in other.labels.keypoints.items():
        np.testing.assert_allclose(one.labels.keypoints[name], keypoint, atol=1e-9)
    np.testing.assert_array_equal(one.arrays["part_id"], other.arrays["part_id"])
    np.testing.assert_allclose(one.arrays["depth_m"], other.arrays["depth_m"], rtol=1e-6)


def test_a_caller_gives_the_wing(simulator) -> None:
    """Labels say what was given; the state goes on by the given rate and not by the law."""
    sim = simulator()
    own = sim.state(7)
    state = sim.state(7, joints={"wing": 0.3}, joint_rates={"wing": -0.02})
    assert wing(state) == (0.3, -0.02)
    assert wing(sim.state(7, joints={"wing": np.float64(0.3)})) == (0.3, 0.0)
    assert state.onward is None
    assert own.onward is not None
    np.testing.assert_array_equal(state.craft.R_cam_from_body, own.craft.R_cam_from_body)
    given = sim.frame(state).labels
    assert (given.joints["wing"].value, given.joints["wing"].rate) == (0.3, -0.02)
    by_law = sim.frame(sim.state(7)).labels
    assert given.keypoints["T1"][:2] == by_law.keypoints["T1"][:2]
    away = sim.state(3, r_rtn_m=[0, -30, 0], joints={"wing": 1.0})
    assert wing(away) == (1.0, 0.0)
    for wrong, words in (
        ({"joints": {"wnig": 0.1}}, "joints has 'wnig'; did you mean 'wing'?"),
        ({"joint_rates": {"wing": 0.1}}, "joint_rates has 'wing', and joints has not"),
    ):
        with pytest.raises(InputError, match="state: ") as told:
            sim.state(3, **wrong)
        assert words in str(told.value)
    with pytest.raises(InputError, match="the scenario's key joints moves are: none"):
        simulator(joints={}).state(3, joints={"wing": 0.1})


def test_frames_that_are_chosen_from_more_keep_their_random_joints(simulator) -> None:
    """As their pointing errors do: by the index before the choice."""
    drawn = {"joints.wing": {"law": "random", "range_deg": [-40, 90]}}
    every, some = simulator(**drawn), simulator(**drawn, frames=5)
    for index in range(5):
        state = some.state(index)
        assert wing(state) == wing(every.state(25 * index))
        assert state.onward is not None
        assert wing(state.onward.at(1.0)) == wing(state)
    assert wing(every.state(3)) != wing(every.state(4))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"joints.wnig": "fixed"}, "joints.wnig: aqua has no such joint; did you mean 'wing'?"),
        (
            {"joints.wing": "sun-traking"},
            "no joint-law named 'sun-traking'; did you mean 'sun-tracking'?",
        ),
        ({"joints.wing": {"law": "fixed", "vlaue_deg": 3}}, "did you mean 'value_deg'?"),
        (
            {"target": "cluster", "joints": {"boom_1": "fixed"}},
            "joints.boom_1: the joint of cluster is fixed, so no law can move it",
        ),
        (
            {"target": "cubesat", "joints": {"wing_left": {"law": "fixed", "value_deg": 91}}},
            "joints.wing_left: 91 deg at frame 0 is beyond the joint's limits, 0 deg to 90 deg",
        ),
    ],
)
def test_a_plan_tells_what_is_wrong(registry, keys: dict[str, Any], words: str) -> None:
    """Before a run begins."""

    def plan() -> Plan:
        return make_plan(load_scenario("aqua-tracking", registry, {**SMALL, **keys}), registry)

    with pytest.raises(InputError) as told:
        plan()
    assert words in str(told.value)


def test_the_scenario_comes_back_from_its_yaml(registry, tmp_path: Path) -> None:
    turning = {**SMALL, "joints.wing": {"law": "rate", "rate_deg_s": 0.5}}
    scenario = load_scenario("aqua-tracking", registry, turning)
    path = tmp_path / "again.yaml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(str(path), registry) == scenario
    assert "joints" not in dump_scenario(load_scenario("aqua", registry, SMALL))


def test_a_plan_tries_the_joints_of_other_bodies(registry) -> None:
    arm = {"spacecraft": "arm", "mount": {"position_m": [0.5, 0.5, 0.5]}}
    bent = {"bodies.arm": {**arm, "joints": {"elbow": {"law": "fixed", "value_deg": 170}}}}
    scenario = load_scenario("aqua-tracking", registry, {**SMALL, **bent})
    with pytest.raises(InputError, match=r"bodies\.arm\.joints\.elbow: 170 deg .* -150 deg to 150 deg"):
        make_plan(scenario, registry)


def test_a_description_lists_the_joints() -> None:
    shown = CliRunner().invoke(posse, ["describe", "scene", "cubesat"]).output
    assert "wing_right: turns from 0 to 90 deg; sun-tracking can turn it\n" in shown
    assert (
        "  boom_2: does not move\n" in CliRunner().invoke(posse, ["describe", "scene", "cluster"]).output
    )
    assert "joints, moved" not in CliRunner().invoke(posse, ["describe", "scene", "fragment"]).output
