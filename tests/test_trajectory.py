"""The trajectory: motion in, attitude and light added, to the bit, and through files and back."""

from __future__ import annotations

import csv
import dataclasses
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import erfa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from laws import laws_of

from posse_core._constants import WGS84_FLATTENING, Constants
from posse_core._environment.time import Epoch
from posse_core._errors import ComponentError, InputError
from posse_core._files.trajectory import load_trajectory, save_trajectory
from posse_core._frames import matrix_from_quaternion, unit
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion, Trajectory
from posse_core._plugins.options import NoOptions
from posse_core._scenario.orbit import ElementsConfig, OrbitConfig, RelativeConfig
from posse_core._trajectory.attitude import GivenAttitude, Laws
from posse_core._trajectory.build import build_trajectory, trajectory_of
from posse_core._trajectory.problem import resolve
from posse_core._trajectory.state import frame_state

HERE = Path(__file__).parent
RADIUS_M = 7.08e6
PERIOD_S = 2 * np.pi * np.sqrt(RADIUS_M**3 / Constants().mu_earth_m3_s2)
T_S = np.linspace(0, PERIOD_S, 200)


class Circle(Propagator):
    """A circular polar orbit over the equator's x axis, with the chaser on a ring about the target."""

    def propagate(self, problem: PropagationProblem) -> Motion:
        n = 2 * np.pi / PERIOD_S
        u = (n * problem.t_s)[:, None]
        x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        ring = np.concatenate([10 * np.cos(u), -20 * np.sin(u), 5 * np.cos(u)], axis=-1)
        rate = n * np.concatenate([-10 * np.sin(u), -20 * np.cos(u), -5 * np.sin(u)], axis=-1)
        return Motion(
            t_s=problem.t_s,
            r_target_eci_m=RADIUS_M * (np.cos(u) * x + np.sin(u) * z),
            v_target_eci_m_s=RADIUS_M * n * (-np.sin(u) * x + np.cos(u) * z),
            r_chaser_rtn_m=ring,
            v_chaser_rtn_m_s=rate,
            sequence=np.zeros(len(problem.t_s), dtype=np.int64),
        )


def build(
    t_s: np.ndarray = T_S,
    laws: Laws | None = None,
    seed: int = 7,
    epoch_utc: str = "2022-03-20T15:33:00",
    propagator: Propagator | None = None,
    **constants: float,
) -> Trajectory:
    # At the equinox the Sun is near ECI +x, so the orbit passes through the shadow's axis.
    elements = ElementsConfig(
        epoch_utc=epoch_utc, a_m=RADIUS_M, e=0, i_deg=90, raan_deg=0, argp_deg=0, mean_anomaly_deg=0
    )
    problem = resolve(
        orbit=OrbitConfig(elements=elements),
        relative=RelativeConfig(roe_m=(0, 0, 10, 0, 5, 0)),
        t_s=t_s,
        constants=Constants(**constants),
    )
    return build_trajectory(
        propagator=propagator or Circle(NoOptions()),
        problem=problem,
        laws=laws or laws_of(),
        seed=seed,
        name="circle",
    )


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    return build()


def assert_same_bits(a: Trajectory, b: Trajectory) -> None:
    assert a.epoch_utc == b.epoch_utc
    for name, array in {**a.arrays(), **a.extras}.items():
        np.testing.assert_array_equal({**b.arrays(), **b.extras}[name], array, name)
    assert a.extras.keys() == b.extras.keys()


def test_shadow_lasts_as_geometry_says(trajectory: Trajectory) -> None:
    # A circle through the shadow's axis is dark over 2 asin(R/a) of arc, less or more half a Sun.
    share = 2 * np.arcsin(Constants().earth_radius_m / RADIUS_M) / (2 * np.pi)
    assert np.mean(1 - trajectory.sun_fraction_target[:-1]) == pytest.approx(share, abs=0.01)
    at_noon, at_midnight = 0, 100
    assert trajectory.sun_fraction_target[at_noon] == 1
    assert trajectory.sun_fraction_target[at_midnight] == 0


def test_the_camera_is_shaded_apart_from_the_target() -> None:
    entry = build(np.linspace(0, PERIOD_S, 3001))
    differ = entry.sun_fraction_target != entry.sun_fraction_camera
    partial = (entry.sun_fraction_target > 0) & (entry.sun_fraction_target < 1)
    assert np.any(differ)
    assert np.all(partial[differ] | (entry.sun_fraction_camera[differ] > 0))


def test_flux_is_that_of_the_sun_of_another_ephemeris(trajectory: Trajectory) -> None:
    jd1, jd2 = Epoch.from_iso(trajectory.epoch_utc).tdb(trajectory.t_s)
    sun_m = -erfa.epv00(jd1, jd2)[0]["p"] * 149_597_870_700.0
    distance_au = np.linalg.norm(sun_m - trajectory.r_target_eci_m, axis=-1) / 149_597_870_700.0
    np.testing.assert_allclose(trajectory.solar_flux_w_m2, 1361 / distance_au**2, rtol=1e-6)
    double = build(solar_constant_w_m2=2722.0)
    np.testing.assert_allclose(double.solar_flux_w_m2, 2 * trajectory.solar_flux_w_m2, rtol=1e-15)


def test_the_sun_stands_over_the_equator_at_the_equinox(trajectory: Trajectory) -> None:
    # 2022-03-20 15:33 UTC (published): declination 0 on the equator of date, 0.12° on GCRF's.
    sun = unit(trajectory.r_sun_eci_m[0])
    assert np.degrees(np.arcsin(sun[2])) == pytest.approx(-0.124, abs=0.01)
    assert sun[0] > 0.9999


def test_chaser_states_agree(trajectory: Trajectory) -> None:
    apart = np.linalg.norm(trajectory.r_chaser_eci_m - trajectory.r_target_eci_m, axis=-1)
    np.testing.assert_allclose(apart, np.linalg.norm(trajectory.r_chaser_rtn_m, axis=-1), atol=1e-7)
    # The inertial velocity is the derivative of the inertial position.
    t = np.array([1000.0, 1000.5, 1001.0])
    three = build(t)
    slope = (three.r_chaser_eci_m[2] - three.r_chaser_eci_m[0]) / 1.0
    np.testing.assert_allclose(slope, three.v_chaser_eci_m_s[1], atol=1e-3)


def test_the_earth_turns_by_15_degrees_in_an_hour_of_stars() -> None:
    two = build(np.array([0.0, 3600.0]))
    turned = np.mod(np.diff(two.earth_rotation_rad)[0], 2 * np.pi)
    assert np.degrees(turned) == pytest.approx(15.041067, abs=1e-6)


def test_quaternions_are_unit_with_positive_scalar(trajectory: Trajectory) -> None:
    for q in (trajectory.q_eci_from_body, trajectory.q_eci_from_camera):
        np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-15)
        assert np.all(q[:, 0] >= 0)


def test_frame_state_is_seen_from_the_camera(trajectory: Trajectory) -> None:
    exact = build(laws=laws_of(camera="track"))
    for index in (0, 13, 199):
        frame = frame_state(exact, index, Constants())
        range_m = np.linalg.norm(exact.r_chaser_rtn_m[index])
        np.testing.assert_allclose(frame.craft.t_body_cam_m, [0, 0, range_m], atol=1e-10)
        # A body point, by way of ECI and by way of the camera.
        point_body = np.array([1.0, -2.0, 3.0])
        R_eci_from_body = matrix_from_quaternion(exact.q_eci_from_body[index])
        point_eci = exact.r_target_eci_m[index] + R_eci_from_body @ point_body
        by_eci = frame.R_cam_from_eci @ (point_eci - frame.r_camera_eci_m)
        np.testing.assert_allclose(
            frame.craft.R_cam_from_body @ point_body + frame.craft.t_body_cam_m, by_eci, atol=1e-7
        )
        # Nadir law: the Earth's centre is on body +z.
        earth_body = R_eci_from_body.T @ -exact.r_target_eci_m[index]
        np.testing.assert_allclose(unit(earth_body), [0, 0, 1], atol=1e-14)
        assert frame.craft.sun_angular_radius_rad == pytest.approx(np.radians(0.2677), rel=1e-3)
    assert frame.epoch_jd_tt == pytest.approx(2459659.14792 + (PERIOD_S + 69.184) / 86400, abs=1e-5)


def test_the_earth_fixed_axes_put_greenwich_under_the_sun_at_noon() -> None:
    # At 12:00 UTC less the equation of time (2022-06-13: +0.0 min) the Sun stands over 0° longitude.
    state = frame_state(build(np.array([0.0]), epoch_utc="2022-06-13T12:00:00"), 0, Constants())
    sun = state.R_ecef_from_eci @ unit(state.r_sun_eci_m)
    assert np.degrees(np.arctan2(sun[1], sun[0])) == pytest.approx(0.0, abs=0.1)
    assert np.degrees(np.arcsin(sun[2])) == pytest.approx(23.2, abs=0.1)


def test_a_frame_does_not_depend_on_the_others(trajectory: Trajectory) -> None:
    laws = laws_of(target="spin")
    whole, part = build(laws=laws), build(T_S[:50], laws=laws)
    assert_same_bits(part, whole.rows(slice(50)))


def test_the_same_bits_in_another_process(trajectory: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    save_trajectory(trajectory, path)
    code = (
        f"import sys; sys.path[:0] = {[str(HERE), str(HERE / 'support')]!r}\n"
        "from pathlib import Path\n"
        "from test_trajectory import build\n"
        "from posse_core._files.trajectory import save_trajectory\n"
        f"save_trajectory(build(), Path({str(tmp_path / 'b.npz')!r}))\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
    assert path.read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_recorded_attitude_comes_back(trajectory: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    save_trajectory(trajectory, path)
    recorded = {"law": "file", "path": path}
    again = build(laws=laws_of(target=recorded, camera=recorded), seed=99)
    np.testing.assert_allclose(again.q_eci_from_body, trajectory.q_eci_from_body, atol=1e-12)
    np.testing.assert_allclose(again.q_eci_from_camera, trajectory.q_eci_from_camera, atol=1e-12)


def test_the_ellipsoid_is_asked_for_by_its_flattening(trajectory: Trajectory) -> None:
    t_s = np.linspace(0, PERIOD_S, 1501)
    sphere, ellipsoid = build(t_s), build(t_s, eclipse_flattening=WGS84_FLATTENING)
    # In a polar orbit the shadow is entered over high latitudes, where the ellipsoid is lower.
    assert np.mean(ellipsoid.sun_fraction_target) > np.mean(sphere.sun_fraction_target) + 1e-3


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_files_return_the_same_bits(trajectory: Trajectory, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"trajectory{suffix}"
    save_trajectory(trajectory, path)
    assert_same_bits(load_trajectory(path), trajectory)


def test_csv_columns_are_named_with_units_and_axes(trajectory: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    save_trajectory(trajectory, path)
    with open(path, newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(trajectory)
    assert float(rows[3]["v_chaser_rtn_m_s_y"]) == trajectory.v_chaser_rtn_m_s[3, 1]
    assert float(rows[3]["q_eci_from_camera_w"]) == trajectory.q_eci_from_camera[3, 0]
    assert float(rows[3]["r_sun_eci_m_z"]) == trajectory.r_sun_eci_m[3, 2]
    assert rows[3]["sequence"] == "0"
    assert rows[3]["epoch_utc"] == "2022-03-20T15:33:00"


def test_npz_holds_plain_arrays(trajectory: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    save_trajectory(trajectory, path)
    with np.load(path, allow_pickle=False) as archive:
        assert set(archive.files) == {"epoch_utc", *trajectory.arrays()}
        assert archive["q_eci_from_body"].shape == (200, 4)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.npz", None, "there is no such file"),
        ("t.txt", "", r"must end in \.npz or \.csv"),
        ("t.npz", "not a zip", "cannot be read as NPZ"),
        ("t.npz", "", "cannot be read as NPZ"),
        ("t.csv", "", "none of t_s, sequence"),
        ("t.csv", "t_s\n0\n", "no 'epoch_utc'"),
        ("t.csv", "epoch_utc,t_s\n2022-01-01,0\n", "no sequence"),
        ("t.csv", "epoch_utc,t_s\n", "t_s is empty"),
        ("t.csv", "t_s,sequence\n0,0\n1\n", "has no value in column 'sequence'"),
        ("t.csv", "\xff\xfe", "cannot be read as CSV|none of"),
    ],
)
def test_a_file_that_is_no_trajectory(
    tmp_path: Path, name: str, content: str | None, message: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=message) as error:
        load_trajectory(path)
    assert name in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("value", ["nan", "word", ""])
def test_a_value_that_is_no_number(trajectory: Trajectory, tmp_path: Path, value: str) -> None:
    path = tmp_path / "t.csv"
    save_trajectory(trajectory, path)
    lines = path.read_text().split("\n")
    cells = lines[5].split(",")
    cells[lines[0].split(",").index("r_moon_eci_m_y")] = value
    lines[5] = ",".join(cells)
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="r_moon_eci_m"):
        load_trajectory(path)


def test_an_array_of_another_shape(trajectory: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    save_trajectory(trajectory, path)
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["r_sun_eci_m"] = arrays["r_sun_eci_m"][:-1]
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=r"r_sun_eci_m has shape \(199, 3\)"):
        load_trajectory(path)


def test_an_array_file_under_a_wrong_name(tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    with open(path, "wb") as stream:
        np.save(stream, np.zeros(3))
    with pytest.raises(InputError, match="cannot be read as NPZ"):
        load_trajectory(path)


def test_times_outside_the_ephemeris_are_refused() -> None:
    with pytest.raises(InputError, match="outside the ephemeris"):
        build(np.array([0.0, 200 * 365.25 * 86400]))


def test_a_trajectory_of_another_kind_of_file_is_not_written(
    trajectory: Trajectory, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r"\.npz or \.csv"):
        save_trajectory(trajectory, tmp_path / "t.mat")
    assert list(tmp_path.iterdir()) == []


EXTRA_NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
EXTRA_SHAPES = st.lists(st.integers(1, 3), max_size=3).map(lambda shape: (4, *shape))
FINITE = st.floats(allow_nan=False, allow_infinity=False)
EXTRAS = st.dictionaries(EXTRA_NAMES, arrays(np.float64, EXTRA_SHAPES, elements=FINITE), max_size=3)


@settings(deadline=None)
@given(extras=EXTRAS, suffix=st.sampled_from([".npz", ".csv"]))
def test_extras_come_back_from_files_to_the_bit(extras: dict[str, np.ndarray], suffix: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        whole = dataclasses.replace(build(T_S[:4]), extras=extras)
        path = Path(folder) / f"t{suffix}"
        save_trajectory(whole, path)
        back = load_trajectory(path)
    assert_same_bits(back, whole)
    assert {name: x.tobytes() for name, x in back.extras.items()} == {
        name: x.tobytes() for name, x in extras.items()
    }


class WithExtras(Circle):
    extras: Mapping[str, Any]

    def propagate(self, problem: PropagationProblem) -> Motion:
        return dataclasses.replace(super().propagate(problem), extras=self.extras)


def built_with(extras: dict[str, Any]) -> Trajectory:
    propagator = WithExtras(NoOptions())
    propagator.extras = extras
    return build(propagator=propagator)


def test_extras_go_with_their_frames() -> None:
    torque = np.arange(600.0).reshape(200, 3)
    chosen = built_with({"torque_n_m": torque, "mode": np.arange(200)}).rows([3, 199])
    np.testing.assert_array_equal(chosen.extras["torque_n_m"], torque[[3, 199]])
    np.testing.assert_array_equal(chosen.extras["mode"], [3.0, 199.0])
    assert chosen.t_s.tolist() == T_S[[3, 199]].tolist()


@pytest.mark.parametrize(
    ("extras", "words"),
    [
        ({"Torque": np.zeros(200)}, "'Torque' needs a name"),
        ({"a/b": np.zeros(200)}, "'a/b' needs a name"),
        ({"mode": np.zeros(199)}, r"'mode' is float64 of shape \(199,\); it must be"),
        ({"mode": 3.0}, r"'mode' is float64 of shape \(\)"),
        ({"mode": np.zeros((200, 0))}, r"'mode' is float64 of shape \(200, 0\)"),
        ({"mode": ["on"] * 200}, "'mode' is <U2"),
        ({"mode": np.full(200, np.nan)}, "'mode' has a value that is not a finite number"),
    ],
)
def test_extras_that_no_file_could_hold_are_refused(extras: dict[str, Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        built_with(extras)


def test_a_csv_that_lacks_a_column_of_an_extra(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    save_trajectory(built_with({"torque_n_m": np.zeros((200, 3))}), path)
    path.write_text(path.read_text().replace("extra_torque_n_m[1]", "other", 1))
    with pytest.raises(InputError, match=r"no column 'extra_torque_n_m\[1\]'"):
        load_trajectory(path)


def motion_rows(trajectory: Trajectory, rows: list[int]) -> Motion:
    chosen = trajectory.rows(rows)
    return Motion(
        chosen.t_s,
        chosen.r_target_eci_m,
        chosen.v_target_eci_m_s,
        chosen.r_chaser_rtn_m,
        chosen.v_chaser_rtn_m_s,
        chosen.sequence,
    )


def at_one(trajectory: Trajectory, index: int, given: GivenAttitude | None = None) -> Trajectory:
    return trajectory_of(
        motion_rows(trajectory, [index]),
        epoch=Epoch.from_iso(trajectory.epoch_utc),
        laws=laws_of(),
        constants=Constants(),
        seed=7,
        indices=np.array([index]),
        given=given,
    )


@pytest.mark.parametrize("index", [0, 57, 199])
def test_one_frame_alone_is_its_row_of_the_whole(trajectory: Trajectory, index: int) -> None:
    assert_same_bits(at_one(trajectory, index), trajectory.rows([index]))
    given = GivenAttitude(
        q_eci_from_body=trajectory.q_eci_from_body[[index]],
        q_eci_from_camera=trajectory.q_eci_from_camera[[index]],
        omega_body_rad_s=trajectory.omega_body_rad_s[[index]],
        omega_camera_rad_s=trajectory.omega_camera_rad_s[[index]],
    )
    assert_same_bits(at_one(trajectory, index, given), trajectory.rows([index]))


def test_an_attitude_that_is_given_is_at_rest_and_leaves_the_other_to_its_law(
    trajectory: Trajectory,
) -> None:
    q = np.array([[-0.5, 0.5, -0.5, 0.5 + 1e-6]])
    one = at_one(trajectory, 12, GivenAttitude(q_eci_from_camera=q))
    np.testing.assert_allclose(one.q_eci_from_camera, -q / np.linalg.norm(q), rtol=0, atol=1e-16)
    np.testing.assert_array_equal(one.omega_camera_rad_s, np.zeros((1, 3)))
    np.testing.assert_array_equal(one.q_eci_from_body, trajectory.q_eci_from_body[[12]])
    np.testing.assert_array_equal(one.omega_body_rad_s, trajectory.omega_body_rad_s[[12]])


def test_a_law_that_has_no_answer_is_not_asked_where_the_attitude_is_given(
    trajectory: Trajectory,
) -> None:
    at_target = dataclasses.replace(trajectory, r_chaser_rtn_m=np.zeros((200, 3)))
    with pytest.raises(InputError, match="at the target at frame 31"):
        at_one(at_target, 31)
    q = np.array([[1.0, 0.0, 0.0, 0.0]])
    assert len(at_one(at_target, 31, GivenAttitude(q_eci_from_camera=q))) == 1


@pytest.mark.parametrize("q", [[1.0, 1.0, 0.0, 0.0], [0.0] * 4, [np.nan, 0.0, 0.0, 1.0]])
def test_a_given_attitude_that_is_no_rotation(trajectory: Trajectory, q: list[float]) -> None:
    with pytest.raises(InputError, match="q_eci_from_body: a quaternion is not of length one"):
        at_one(trajectory, 0, GivenAttitude(q_eci_from_body=np.array([q])))


def test_an_epoch_that_is_none(trajectory: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    save_trajectory(dataclasses.replace(trajectory, epoch_utc="[]"), path)
    with pytest.raises(InputError, match=r"t\.npz: epoch '\[\]' is not ISO 8601"):
        load_trajectory(path)
