"""Recorded motion at times that its file does not have, against closed forms and another library."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from posse_core._arrays import FloatArray
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.oem import read_oem
from posse_core._files.tables import write_table
from posse_core._frames import rtn_from_eci
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion, Trajectory
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import NoOptions
from posse_core._scenario.load import dump_scenario, load_scenario
from posse_core._trajectory.build import frames_problem, make_trajectory
from posse_core._trajectory.returned import propagated

REGISTRY = load_plugins().registry
DOCS = Path(__file__).parents[1] / "docs"
AUTHORITY = Path(__file__).parent / "authorities" / "oem.json"
EPOCH = "2022-01-31T02:02:27.58"


@dataclass(frozen=True)
class Circle:
    """A circular orbit in closed form."""

    radius_m: float = 7.1e6
    phase_rad: float = 0.0
    tilt_rad: float = 0.3

    @property
    def rate_rad_s(self) -> float:
        return math.sqrt(3.986004418e14 / self.radius_m**3)

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = self.rate_rad_s * t_s + self.phase_rad
        cosine, sine = np.cos(angle), np.sin(angle)
        up, across = math.sin(self.tilt_rad), math.cos(self.tilt_rad)
        r_m = self.radius_m * np.stack([cosine, across * sine, up * sine], axis=-1)
        v_m_s = (
            self.radius_m * self.rate_rad_s * np.stack([-sine, across * cosine, up * cosine], axis=-1)
        )
        return r_m, v_m_s


TARGET = Circle()
CHASER = Circle(phase_rad=1e-5, tilt_rad=0.30001)


def write_oem(path: Path, circle: Circle, t_s: FloatArray, *segments: str) -> Path:
    """Write an OEM. Each segment has these metadata and the whole path."""
    text = "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-02-01T00:00:00\nORIGINATOR = TEST\n"
    for meta in segments or ("",):
        text += "META_START\nOBJECT_NAME = A\nOBJECT_ID = 2022-001A\nCENTER_NAME = EARTH\n"
        text += f"REF_FRAME = ICRF\nTIME_SYSTEM = UTC\nSTART_TIME = {EPOCH}\n"
        text += f"STOP_TIME = {Epoch.from_iso(EPOCH).shifted(float(t_s[-1])).iso()}\n{meta}META_STOP\n"
        for time_s, r_m, v_m_s in zip(t_s, *circle.at(t_s), strict=True):
            numbers = " ".join(f"{x / 1e3:.15g}" for x in (*r_m, *v_m_s))
            text += f"{Epoch.from_iso(EPOCH).shifted(float(time_s)).iso()} {numbers}\n"
    path.write_text(text)
    return path


def meta(method: str, degree: int) -> str:
    return f"INTERPOLATION = {method}\nINTERPOLATION_DEGREE = {degree}\n"


def made(folder: Path, path: Path, chaser: Path | None = None, **keys: Any) -> Trajectory:
    """The trajectory of a recorded motion, by a scenario without an orbit."""
    propagator = {"name": "file", "path": str(path)}
    if chaser is not None:
        propagator["chaser_path"] = str(chaser)
    keys = {"target": {"name": "aqua"}, "propagator": propagator, "renderer": "raster", **keys}
    (folder / "s.yaml").write_text(yaml.safe_dump(keys))
    return make_trajectory(load_scenario(str(folder / "s.yaml"), REGISTRY), REGISTRY)


def write_circles(path: Path, t_s: FloatArray, **more: FloatArray) -> Path:
    r_m, v_m_s = TARGET.at(t_s)
    rtn = dict(
        zip(
            ("r_chaser_rtn_m", "v_chaser_rtn_m_s"),
            rtn_from_eci(r_m, v_m_s, *CHASER.at(t_s)),
            strict=True,
        )
    )
    arrays = {"t_s": t_s, "r_target_eci_m": r_m, "v_target_eci_m_s": v_m_s, **rtn, **more}
    write_table(path, EPOCH, arrays)
    return path


@pytest.mark.parametrize(
    ("method", "degree", "points"),
    [("HERMITE", 3, 2), ("HERMITE", 7, 4), ("LAGRANGE", 5, 6), ("LAGRANGE", 7, 8), ("LINEAR", 1, 2)],
)
def test_an_oem_is_interpolated_as_it_says(tmp_path, method, degree, points):
    """The remainder of polynomial interpolation: the next derivative over its factorial, ωᵏ r / k!,
    times the product of the distances from the points, which are squared where velocities count too."""
    t_s = 300.0 * np.arange(12)
    path = write_oem(tmp_path / "a.oem", TARGET, t_s, meta(method, degree))
    at_s = np.linspace(5 * 300.0, 6 * 300.0, 31)
    r_m, v_m_s = read_oem(path, Epoch.from_iso(EPOCH)).at(at_s)
    near_s = 300.0 * (5.5 + np.arange(points) - (points - 1) / 2)
    product = np.prod(np.abs(at_s[:, None] - near_s), axis=1)
    order = degree + 1
    if method == "HERMITE":
        product = product**2
    bound_m = (TARGET.rate_rad_s**order * TARGET.radius_m / math.factorial(order) * product).max()
    error_m = np.linalg.norm(r_m - TARGET.at(at_s)[0], axis=1).max()
    assert 0.5 * bound_m < error_m < 1.01 * bound_m + 1e-6
    if method == "HERMITE":  # the velocity is the derivative of the position
        inner_s = at_s[1:-1]
        ends = [read_oem(path, Epoch.from_iso(EPOCH)).at(inner_s + h)[0] for h in (-0.5, 0.5)]
        np.testing.assert_allclose(v_m_s[1:-1], ends[1] - ends[0], atol=1e-3)


def test_an_oem_is_interpolated_as_by_the_library_oem(tmp_path):
    """oem 0.4.5 (B. Reiter), see ``authorities/regenerate_oem.py``."""
    known = json.loads(AUTHORITY.read_text())
    for case in known["cases"]:
        path = tmp_path / "a.oem"
        path.write_text(case["text"])
        at_s = np.array(known["t_s"])
        r_m, v_m_s = read_oem(path, Epoch.from_iso(EPOCH)).at(at_s)
        np.testing.assert_allclose(r_m, case["r_m"], rtol=0, atol=case["atol_m"])
        np.testing.assert_allclose(v_m_s, case["v_m_s"], rtol=0, atol=case["atol_m_s"])


def test_segments_are_interpolated_apart_and_the_later_counts(tmp_path):
    t_s = 300.0 * np.arange(6)
    path = write_oem(tmp_path / "a.oem", TARGET, t_s, meta("HERMITE", 7), meta("LINEAR", 1))
    read = read_oem(path, Epoch.from_iso(EPOCH))
    middle = read.at(np.array([750.0]))[0][0]
    np.testing.assert_allclose(
        middle, np.mean(TARGET.at(np.array([600.0, 900.0]))[0], axis=0), atol=1e-6
    )
    np.testing.assert_array_equal(read.at(t_s)[0], read.r_eci_m)


@pytest.mark.parametrize("times", [{"rate_hz": 0.1}, {"t_s": [0, 137.5, 600]}])
def test_a_table_at_a_rate(tmp_path, times):
    """Cubic Hermite's error is h⁴/384 times the fourth derivative: ω⁴ of the radius and of the range."""
    path = write_circles(tmp_path / "t.csv", 60.0 * np.arange(11))
    motion = made(tmp_path, path, times=times)
    expected_s = np.arange(61) * 10.0 if "rate_hz" in times else np.array([0, 137.5, 600])
    np.testing.assert_allclose(motion.t_s, expected_s, atol=1e-9)
    target, chaser = TARGET.at(motion.t_s), CHASER.at(motion.t_s)
    share = 60.0**4 * TARGET.rate_rad_s**4 / 384
    r_rtn_m, v_rtn_m_s = rtn_from_eci(*target, *chaser)
    np.testing.assert_allclose(motion.r_target_eci_m, target[0], atol=1.05 * share * TARGET.radius_m)
    np.testing.assert_allclose(motion.r_chaser_rtn_m, r_rtn_m, atol=100 * share)
    np.testing.assert_allclose(motion.v_chaser_rtn_m_s, v_rtn_m_s, atol=1e-5)


def test_frames_at_instants_of_the_file_have_its_states_to_the_bit(tmp_path):
    path = write_circles(tmp_path / "t.npz", 60.0 * np.arange(11))
    own = made(tmp_path, path)
    picked = made(tmp_path, path, times={"t_s": [120, 300]})
    for name, array in own.arrays().items():
        np.testing.assert_array_equal(picked.arrays()[name], array[[2, 5]])


def test_two_oem_of_different_instants(tmp_path):
    target = write_oem(tmp_path / "t.oem", TARGET, 60.0 * np.arange(11))
    chaser = write_oem(tmp_path / "c.oem", CHASER, 10.0 + 45.0 * np.arange(12))
    motion = made(tmp_path, target, chaser)
    np.testing.assert_allclose(motion.t_s, 60.0 * np.arange(1, 9), atol=1e-6)
    exact = rtn_from_eci(*TARGET.at(motion.t_s), *CHASER.at(motion.t_s))
    np.testing.assert_allclose(motion.r_chaser_rtn_m, exact[0], atol=1e-5)
    often = made(tmp_path, target, chaser, times={"rate_hz": 2})
    assert len(often.t_s) == 2 * 420 + 1
    exact = rtn_from_eci(*TARGET.at(often.t_s), *CHASER.at(often.t_s))
    np.testing.assert_allclose(often.r_chaser_rtn_m, exact[0], atol=1e-5)
    with pytest.raises(InputError, match=r"c\.oem does not cover.*times: null"):
        made(tmp_path, target, chaser, times={"t_s": [0, 60]})


@pytest.mark.parametrize("kind", ["csv", "oem"])
def test_epoch_and_orbit_are_those_of_the_file(tmp_path, kind):
    t_s = 60.0 * np.arange(11)
    if kind == "csv":
        motion = made(tmp_path, write_circles(tmp_path / "t.csv", t_s))
    else:
        paths = [
            write_oem(tmp_path / name, circle, t_s)
            for name, circle in (("t.oem", TARGET), ("c.oem", CHASER))
        ]
        motion = made(tmp_path, *paths)
    assert motion.epoch_utc == EPOCH
    np.testing.assert_allclose(motion.t_s, t_s, atol=1e-9)
    scenario = load_scenario(str(tmp_path / "s.yaml"), REGISTRY)
    assert scenario.orbit.state_eci.epoch_utc == EPOCH
    np.testing.assert_allclose(scenario.orbit.state_eci.r_m, TARGET.at(np.zeros(1))[0][0], atol=1e-6)
    (tmp_path / "dumped.yaml").write_text(dump_scenario(scenario))
    assert load_scenario(str(tmp_path / "dumped.yaml"), REGISTRY) == scenario


def test_a_table_that_begins_later_begins_the_scenario(tmp_path):
    t_s = 3600.0 + 60.0 * np.arange(11)
    motion = made(tmp_path, write_circles(tmp_path / "t.csv", t_s))
    assert motion.epoch_utc == "2022-01-31T03:02:27.58"
    np.testing.assert_allclose(motion.t_s, t_s - 3600, atol=1e-9)


def test_a_table_without_an_epoch_needs_an_orbit(tmp_path):
    path = write_circles(tmp_path / "t.csv", 60.0 * np.arange(3))
    path.write_text(path.read_text().replace("epoch_utc", "epoch"))
    with pytest.raises(InputError, match="has no epoch_utc, and the scenario no orbit"):
        made(tmp_path, path)


def test_the_times_of_a_scenario_are_not_ignored(tmp_path):
    path = write_circles(tmp_path / "t.csv", 60.0 * np.arange(11))
    with pytest.raises(InputError, match=r"to be at 900 s, which .*t\.csv does not cover.*times: null"):
        made(tmp_path, path, times={"t_s": [0, 900]})
    with pytest.raises(InputError, match=r"times: .*count or rate_hz"):
        made(tmp_path, path, times={"rate_hz": 2, "count": 7})
    with pytest.raises(InputError, match=r"times\.rate_hz: .*more than 500000"):
        made(tmp_path, path, times={"rate_hz": 1e9})


class Own(Propagator[NoOptions]):
    """A propagator with frames of its own that knows nothing of requests."""

    needs_starts = False

    def propagate(self, problem: PropagationProblem) -> Motion:
        t_s = np.array([0.0, 60.0])
        r, v = TARGET.at(t_s)
        return Motion(t_s, r, v, 0 * r + 1, 0 * v, np.zeros(2, dtype=np.int64))


def test_a_propagator_that_ignores_times_is_refused():
    for times, fits in (
        (None, True),
        ({"t_s": [0, 60]}, True),
        ({"t_s": [0, 30]}, False),
        ({"rate_hz": 2}, False),
    ):
        scenario = load_scenario("aqua", REGISTRY, {"times": times})
        problem = frames_problem(scenario, Own(NoOptions()))
        if fits:
            propagated(Own(NoOptions()), problem, "own", own_frames=True)
            continue
        with pytest.raises(
            InputError, match=r"times: propagator 'own' has frames of its own.*times: null"
        ):
            propagated(Own(NoOptions()), problem, "own", own_frames=True)


def test_a_rate_of_a_computed_motion():
    scenario = load_scenario("aqua", REGISTRY, {"times": {"rate_hz": 2, "duration_s": 3}})
    np.testing.assert_allclose(make_trajectory(scenario, REGISTRY).t_s, np.arange(7) / 2, atol=1e-12)


def test_times_that_earlier_versions_wrote_beside_a_file(tmp_path):
    """They wrote the defaults, or what a user had given in vain, and took the file's own instants."""
    path = write_circles(tmp_path / "t.csv", 60.0 * np.arange(11))
    written = {"t_s": None, "duration_orbits": 1.0, "duration_s": None, "count": 101}
    assert len(made(tmp_path, path, times=written)) == 11


def test_the_example_of_the_documentation(tmp_path):
    page = (DOCS / "dynamics.md").read_text()
    found = re.search(r"```yaml\n(target:.*?)```", page, re.DOTALL)
    assert found is not None
    (tmp_path / "s.yaml").write_text(found[1])
    (tmp_path / "flown.csv").write_bytes((DOCS / "flown.csv").read_bytes())
    scenario = load_scenario(str(tmp_path / "s.yaml"), REGISTRY)
    motion = make_trajectory(scenario, REGISTRY)
    np.testing.assert_allclose(motion.t_s, np.arange(151) * 2.0, atol=1e-6)
    computed = load_scenario("aqua", REGISTRY, {"times": {"t_s": motion.t_s.tolist()}})
    exact = make_trajectory(computed, REGISTRY)
    np.testing.assert_allclose(motion.r_chaser_rtn_m, exact.r_chaser_rtn_m, atol=2e-4)
    columns = (DOCS / "flown.csv").read_text().split("\n", 1)[0].split(",")
    for name in columns:
        assert f"`{name.removesuffix('_y').removesuffix('_z')}" in page or name[-2:] in ("_y", "_z")


def test_natural_names_are_told_what_is_missing_and_the_nearest(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("time,r_target_x,r_target_y,r_target_z,v_target_eci_m_s_x\n0,7e6,0,0,0\n")
    with pytest.raises(InputError) as refused:
        made(tmp_path, path)
    said = str(refused.value)
    for words in (
        "none of t_s, r_target_eci_m",
        "'r_target_x' for 'r_target_eci_m_x'",
        "dynamics.md",
        "time",
    ):
        assert words in said
    path.write_text("t_s,r_target_x,r_target_y,r_target_z,v_target_eci_m_s_x\n0,7e6,0,0,0\n")
    with pytest.raises(InputError) as refused:
        made(tmp_path, path)
    said = str(refused.value)
    for words in ("no r_target_eci_m_x", "v_target_eci_m_s_y", "'r_target_x' for 'r_target_eci_m_x'"):
        assert words in said
    assert "v_target_eci_m_s_x, " not in said.split("did you mean")[0]
    np.savez(
        tmp_path / "t.npz", t_s=np.zeros(2), r_target_eci_m=np.ones((2, 3)), v_target=np.ones((2, 3))
    )
    with pytest.raises(InputError, match="did you mean 'v_target' for 'v_target_eci_m_s'"):
        made(tmp_path, tmp_path / "t.npz")
