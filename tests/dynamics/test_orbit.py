"""From what the user writes to states, and what is refused in one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from posse_core._constants import Constants
from posse_core._dynamics.tle import Tle
from posse_core._errors import InputError
from posse_core._interfaces.propagator import PropagationProblem
from posse_core._plugins.options import NoOptions
from posse_core._propagators.roe import RoePropagator
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._trajectory.problem import orbit_epoch, orbit_period_s, resolve, target_at_epoch

CONSTANTS = Constants()
# The 2006 verification set's first case (Vallado et al. 2006): state at the epoch in TEME, km.
VANGUARD = (
    "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
)
VANGUARD_KM = np.array([7022.46529266, -1400.08296755, 0.03995155])
ELEMENTS = {
    "epoch_utc": "2022-01-31T02:02:27.58",
    "a_m": 7.1e6,
    "e": 0.001,
    "i_deg": 98.2,
    "raan_deg": 10.0,
    "argp_deg": 20.0,
    "mean_anomaly_deg": 30.0,
}


def problem(orbit: dict[str, Any], relative: dict[str, Any]) -> PropagationProblem:
    return resolve(
        OrbitConfig.model_validate(orbit),
        RelativeConfig.model_validate(relative),
        np.zeros(1),
        CONSTANTS,
    )


def mended(line: str) -> str:
    total = sum(int(c) if c.isdigit() else c == "-" for c in line[:68])
    return line[:68] + str(total % 10)


def test_a_tle_is_flown_from_its_own_epoch() -> None:
    orbit = OrbitConfig(tle=VANGUARD)
    assert orbit_epoch(orbit).iso().startswith("2000-06-27T18:50:19.7")
    r = target_at_epoch(orbit, CONSTANTS).r_eci_m
    # Only the axes differ: precession from J2000 to mid-2000 is below 30″.
    assert np.linalg.norm(r) == pytest.approx(np.linalg.norm(VANGUARD_KM) * 1e3, abs=0.02)
    assert np.linalg.norm(r - VANGUARD_KM * 1e3) < 30 / 206265 * 7.2e6
    assert orbit_period_s(orbit, CONSTANTS) == pytest.approx(86400 / 10.82419157, rel=1e-8)


def test_the_neighbour_of_a_tle_has_the_wanted_state_and_the_same_drag() -> None:
    tle = Tle(VANGUARD)
    for at_s in (0.0, 5000.0):
        r, v = (x[0] for x in tle.state(np.array([at_s])))
        apart, speed = np.array([50.0, -80.0, 30.0]), np.array([0.01, 0.02, -0.03])
        got_r, got_v = tle.neighbour(r + apart, v + speed, at_s).state(np.array([at_s]))
        # SGP4 solves Kepler's equation to 1e-12.
        assert got_r[0] - r == pytest.approx(apart, abs=1e-3)
        assert got_v[0] - v == pytest.approx(speed, abs=1e-6)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ((VANGUARD[0][:-1] + "9", VANGUARD[1]), "line 1 has the checksum '9', its characters give 3"),
        ((VANGUARD[0][:-3], VANGUARD[1]), "line 1 has 66 characters, not 69"),
        ((VANGUARD[1], VANGUARD[0]), "line 1 begins with '2', not with '1'"),
        (
            (VANGUARD[0], mended("2 00006" + VANGUARD[1][7:])),
            "line 1 is of satellite 00005, line 2 of 00006",
        ),
        ((VANGUARD[0], mended(VANGUARD[1].replace("34.2682", "34,2682"))), "line 2 does not have"),
        ((VANGUARD[0], mended(VANGUARD[1][:52] + "99.82419157" + VANGUARD[1][63:])), "SGP4 fails"),
    ],
)
def test_a_malformed_tle_is_refused_with_its_line(lines: tuple[str, str], words: str) -> None:
    with pytest.raises(InputError, match=r"^orbit\.tle: [^\n]*$") as caught:
        Tle(lines)
    assert words in str(caught.value)


FAST = {"epoch_utc": "2022-01-31", "r_m": [7e6, 0, 0], "v_m_s": [0, 12e3, 0]}
SMALL = {"roe_m": [0, 0, 9, 0, 9, 0]}
MANY = {
    "design": {"name": "algorithm-3-1-repaired", "size_m": 9},
    "plan": {"burns": [{"t_s": 1, "dv_rtn_m_s": [0, 0, 0]}]},
}


@pytest.mark.parametrize(
    ("orbit", "relative", "words"),
    [
        ({"state_eci": FAST}, SMALL, "not elliptic (e = 1.5288"),
        ({"state_eci": {**FAST, "v_m_s": [0, 5e3, 0]}}, SMALL, "km below the Earth's surface"),
        ({"state_eci": {**FAST, "v_m_s": [1e3, 0, 0]}}, SMALL, "below the Earth's surface"),
        ({"state_eci": {**FAST, "r_m": [0, 0, 0]}}, SMALL, "not an orbit"),
        ({"elements": {**ELEMENTS, "e": 0.5}}, SMALL, "orbit.elements: the orbit's perigee"),
        (
            {"elements": ELEMENTS},
            {"roe_m": [-9e5, 0, 0, 0, 0, 0]},
            "relative.roe_m: the orbit's perigee",
        ),
        (
            {"elements": ELEMENTS},
            {"state_rtn": {"r_m": [0, 0, 0], "v_m_s": [0, 5e3, 0]}},
            "relative.state_rtn: the orbit is not elliptic",
        ),
        ({"elements": {**ELEMENTS, "i_deg": 0}}, SMALL, "give relative.roe_equinoctial_m"),
        ({"elements": {**ELEMENTS, "i_deg": 180}}, SMALL, "inclination of 180°"),
        ({"elements": ELEMENTS}, MANY, "manoeuvres cannot start from it"),
    ],
)
def test_what_is_no_orbit_is_refused_in_one_line(orbit: Any, relative: Any, words: str) -> None:
    with pytest.raises(InputError) as caught:
        RoePropagator(NoOptions()).propagate(problem(orbit, relative))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_equinoctial_relative_elements_work_on_the_equator() -> None:
    (start,) = problem(
        {"elements": {**ELEMENTS, "i_deg": 0}}, {"roe_equinoctial_m": [0, 0, 0, 0, 50, 0]}
    ).starts
    # δp tilts the plane by 2 δp about the x axis of the elements' frame: N = −2 a δp cos L.
    r = start.target.r_eci_m / np.linalg.norm(start.target.r_eci_m)
    assert start.rtn[2] == pytest.approx(-100 * r[0], abs=0.1)
    assert np.linalg.norm(start.dr_eci_m) == pytest.approx(np.linalg.norm(start.rtn[:3]))


def test_sgp4_in_gcrf_axes_is_skyfields() -> None:
    skyfield = pytest.importorskip("skyfield.api")
    scale = skyfield.load.timescale(builtin=True)
    lines = (
        "1 27424U 02022A   22031.08504144  .00000000  00000-0  00000-0 0  9999",
        "2 27424  98.2300 334.4000 0000898  52.4400 318.1000 14.57112000 53087",
    )
    t_s = np.array([0.0, 3000.0, 86400.0])
    r, v = Tle(lines).state(t_s)
    satellite = skyfield.EarthSatellite(*lines, "", scale)
    theirs = satellite.at(scale.tt_jd(satellite.epoch.tt + t_s / 86400))
    # A Julian date in one double counts to 40 µs, 0.3 m of flight.
    assert np.linalg.norm(r - theirs.position.m.T, axis=-1).max() < 0.5
    assert np.linalg.norm(v - theirs.velocity.m_per_s.T, axis=-1).max() < 1e-3
