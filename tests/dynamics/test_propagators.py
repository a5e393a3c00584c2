"""Propagators: each against another way to the same motion."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posse_core._constants import Constants
from posse_core._dynamics.design import algorithm_3_1, coverage
from posse_core._dynamics.domain import DomainWarning
from posse_core._environment.ephemeris import sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._frames import eci_from_rtn, rtn_from_eci
from posse_core._interfaces.propagator import PropagationProblem
from posse_core._model.trajectory import PLANE_TURN, Motion
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.design import PlanConfig
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._trajectory.problem import orbit_period_s, planned, resolve

CONSTANTS = Constants()
REGISTRY = load_plugins().registry
TLE = (
    "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
)
LEO = {
    "epoch_utc": "2022-01-31T02:02:27.58",
    "a_m": 7.1e6,
    "e": 1e-4,
    "i_deg": 98.2,
    "raan_deg": 10.0,
    "argp_deg": 20.0,
    "mean_anomaly_deg": 30.0,
}
PERIOD_S = 2 * np.pi * np.sqrt(7.1e6**3 / CONSTANTS.mu_earth_m3_s2)


def problem(
    relative: Any, orbit: Any = None, t_s: Any = None, turns_plane: bool = False
) -> PropagationProblem:
    orbit = orbit or {"elements": LEO}
    times = np.linspace(0, PERIOD_S, 101) if t_s is None else np.asarray(t_s, dtype=np.float64)
    return resolve(
        OrbitConfig.model_validate(orbit),
        RelativeConfig.model_validate(relative),
        times,
        CONSTANTS,
        turns_plane=turns_plane,
    )


def flown(name: str, asked: PropagationProblem, **options: Any) -> Motion:
    made: Motion = REGISTRY.create(
        "propagator", name, REGISTRY.options("propagator", name, options)
    ).propagate(asked)
    return made


def ranges(motion: Motion) -> Any:
    return np.linalg.norm(motion.r_chaser_rtn_m, axis=-1)


FLYING = ["hcw", "roe", "roe-near-circular", "yamanaka-ankersen", "j2-roe", "nonlinear", "sgp4"]
TURNING = ["j2-roe", "nonlinear", "sgp4"]
"""Models with J2, which turns the orbit's plane."""


@pytest.mark.parametrize("name", FLYING)
def test_models_say_whether_they_turn_the_plane(name: str) -> None:
    made = REGISTRY.create("propagator", name, REGISTRY.options("propagator", name, {}))
    assert made.turns_plane == (name in TURNING)


@pytest.mark.parametrize("turns_plane", [True, False])
@pytest.mark.parametrize("name", TURNING)
def test_the_motion_says_that_the_axes_turn(name: str, turns_plane: bool) -> None:
    orbit = {"tle": TLE} if name == "sgp4" else None
    asked = problem({"roe_m": [0, 0.5, 6, 8, -7, 4]}, orbit, [0.0, 700.0], turns_plane=turns_plane)
    assert (PLANE_TURN in flown(name, asked).extras) == turns_plane


def test_without_j2_the_plane_keeps_still() -> None:
    still = REGISTRY.options("propagator", "nonlinear", {"gravity": "two-body"})
    assert not REGISTRY.create("propagator", "nonlinear", still).turns_plane


@pytest.mark.parametrize("name", FLYING)
def test_velocities_are_the_slopes_of_positions(name: str) -> None:
    step = 1.0
    t_s = 700 + np.array([-step, 0, step])
    orbit = {"tle": TLE} if name == "sgp4" else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DomainWarning)
        relative = {"roe_m": [0, 10, 60, 80, -70, 40]}
        m = flown(name, problem(relative, orbit, t_s, turns_plane=name in TURNING))
    slope = (m.r_chaser_rtn_m[2] - m.r_chaser_rtn_m[0]) / (2 * step)
    # First-order theories give a velocity that is their position's slope to first order only, and SGP4
    # rounds at 1e-5 m.
    off_m_s = {"sgp4": 2e-4, "j2-roe": 2e-4}.get(name, 1e-7)
    assert m.v_chaser_rtn_m_s[1] == pytest.approx(slope, abs=off_m_s)
    slope = (m.r_target_eci_m[2] - m.r_target_eci_m[0]) / (2 * step)
    off_m_s = {"sgp4": 1.0, "j2-roe": 0.1}.get(name, 0.01)
    assert m.v_target_eci_m_s[1] == pytest.approx(slope, abs=off_m_s)


@pytest.mark.parametrize("name", ["roe", "yamanaka-ankersen", "hcw", "j2-roe", "nonlinear"])
def test_every_way_to_give_the_chaser_is_the_same(name: str) -> None:
    by_roe = flown(name, problem({"roe_m": [0.5, 10, 60, 80, -70, 40]}))
    r, v = by_roe.r_chaser_rtn_m[0], by_roe.v_chaser_rtn_m_s[0]
    target = by_roe.r_target_eci_m[0], by_roe.v_target_eci_m_s[0]
    r_eci, v_eci = eci_from_rtn(*target, r, v)
    ways = [
        {"state_rtn": {"r_m": r.tolist(), "v_m_s": v.tolist()}},
        {"state_eci": {"r_m": r_eci.tolist(), "v_m_s": v_eci.tolist()}},
    ]
    for way in ways:
        # A state in ECI is rounded at 1e-9 m and 1e-12 m/s, which an orbit makes 1e-7 m of.
        assert flown(name, problem(way)).r_chaser_rtn_m == pytest.approx(by_roe.r_chaser_rtn_m, abs=1e-5)


RELATIVE = [
    {"roe_m": [5, 100, 600, 800, -700, 400]},
    {"state_rtn": {"r_m": [1300, -200, 900], "v_m_s": [0.2, -1.1, 0.4]}},
    {"design": {"name": "hold-point", "r_rtn_m": [900, -500, 1300]}},
]


@pytest.mark.parametrize("relative", RELATIVE)
def test_rtn_velocities_are_exact_both_ways_under_j2(relative: Any) -> None:
    """At a separation of 1.3 km: in RTN the slope of the position in RTN, in ECI that of the one in
    ECI."""
    t_s = 2600 + np.arange(-2.0, 3.0)
    m = flown("nonlinear", problem(relative, t_s=t_s, turns_plane=True))
    target, turn = (m.r_target_eci_m, m.v_target_eci_m_s), m.plane_turn_rad_s
    assert 1e-7 < abs(turn[2]) < 1.6e-6
    r_eci, v_eci = eci_from_rtn(*target, m.r_chaser_rtn_m, m.v_chaser_rtn_m_s, turn)
    apart = r_eci - target[0], v_eci - target[1]
    for position, velocity in ((m.r_chaser_rtn_m, m.v_chaser_rtn_m_s), apart):
        slope = (position[0] - 8 * position[1] + 8 * position[3] - position[4]) / 12
        assert velocity[2] == pytest.approx(slope, abs=1e-8)
    back = rtn_from_eci(*target, r_eci, v_eci, turn)
    assert back[1] == pytest.approx(m.v_chaser_rtn_m_s, abs=1e-9)


def test_a_start_in_rtn_is_the_state_that_was_given() -> None:
    """The motion at the start, and from there 100 s back and again."""
    given = {"r_m": [1300.0, -200.0, 900.0], "v_m_s": [0.2, -1.1, 0.4]}
    m = flown("nonlinear", problem({"state_rtn": given}, t_s=[-100, 0], turns_plane=True))
    np.testing.assert_allclose(m.v_chaser_rtn_m_s[1], given["v_m_s"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(m.r_chaser_rtn_m[1], given["r_m"], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("hcw", "yamanaka-ankersen or roe"),
        ("roe-near-circular", "roe"),
    ],
)
def test_a_circular_model_on_an_ellipse_tells_its_error_and_another(name: str, instead: str) -> None:
    orbit = {"elements": {**LEO, "a_m": 7.5e6, "e": 0.1}}
    asked = problem({"roe_m": [0, 0, 0, 100, 0, 100]}, orbit)
    with pytest.warns(DomainWarning) as caught:
        got = flown(name, asked)
    exact = flown("roe", asked)
    worst = np.linalg.norm(got.r_chaser_rtn_m - exact.r_chaser_rtn_m, axis=-1).max()
    assert f"errors of up to {worst:.3g} m" in str(caught[0].message)
    assert str(caught[0].message).endswith(f"use propagator {instead}")


def test_a_close_circular_orbit_tells_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in ("hcw", "roe-near-circular", "yamanaka-ankersen", "j2-roe"):
            flown(name, problem({"roe_m": [0, 0, 10, 0, 10, 0]}))


def test_mean_elements_at_the_critical_inclination_need_the_canonical_theory() -> None:
    orbit = {"elements": {**LEO, "i_deg": 63.4}}
    asked = problem({"roe_m": [0, 0, 50, 0, 50, 0]}, orbit)
    with pytest.raises(InputError, match=r"set propagator\.mean_elements to canonical"):
        flown("j2-roe", asked)
    got = flown("j2-roe", asked, mean_elements="canonical")
    exact = flown("nonlinear", asked)
    assert np.max(np.abs(got.r_chaser_rtn_m - exact.r_chaser_rtn_m)) < 0.02


def test_sgp4_keeps_the_target_and_the_chasers_start() -> None:
    asked = problem({"roe_m": [0, 0, 50, 0, 50, 0]}, {"tle": TLE})
    exact, got = flown("roe", asked), flown("sgp4", asked)
    assert got.r_chaser_rtn_m[0] == pytest.approx(exact.r_chaser_rtn_m[0], abs=1e-3)
    # J2 and the theory's own rounding move a 100 m ellipse by metres in an orbit.
    assert np.max(np.abs(got.r_chaser_rtn_m - exact.r_chaser_rtn_m)) < 5


def test_a_hyperbola_is_flown_by_the_integrated_model_alone() -> None:
    orbit = {"state_eci": {"epoch_utc": "2022-01-31", "r_m": [7e6, 0, 0], "v_m_s": [0, 12e3, 1e3]}}
    chaser = {"state_rtn": {"r_m": [0, -50, 0], "v_m_s": [0, 0, 0]}}
    asked = problem(chaser, orbit, [0, 600, 1200])
    with pytest.raises(InputError, match="use propagator nonlinear"):
        flown("roe", asked)
    m = flown("nonlinear", asked, gravity="two-body")
    energy = np.sum(m.v_target_eci_m_s**2, axis=-1) / 2
    energy -= CONSTANTS.mu_earth_m3_s2 / np.linalg.norm(m.r_target_eci_m, axis=-1)
    assert energy == pytest.approx(energy[0], rel=1e-12)


def test_all_forces_together_are_small_beside_j2() -> None:
    surface = {"target_m2_kg": 0.01, "chaser_m2_kg": 0.02}
    asked = problem({"roe_m": [0, 0, 50, 0, 50, 0]})
    plain = flown("nonlinear", asked)
    all_of_them = flown("nonlinear", asked, drag=surface, solar_pressure=surface, third_body=True)
    apart = np.linalg.norm(all_of_them.r_target_eci_m - plain.r_target_eci_m, axis=-1)
    assert 0.1 < apart[-1] < 100
    lit = flown("nonlinear", asked, gravity="two-body", solar_pressure=surface)
    dark = flown("nonlinear", asked, gravity="two-body")
    # In the first minutes a constant push of P C_R A/m away from the Sun.
    epoch = Epoch.from_iso(LEO["epoch_utc"])
    sun = sun_eci_m(*epoch.tdb(np.zeros(())))
    k = 2
    push = 0.5 * 1361 / 299792458 * 0.01 * asked.t_s[k] ** 2 * -sun / np.linalg.norm(sun)
    moved = lit.r_target_eci_m[k] - dark.r_target_eci_m[k]
    assert moved == pytest.approx(push, rel=0.1, abs=1e-7) or np.linalg.norm(moved) < 1e-7


def test_the_thesis_is_followed_literally() -> None:
    m = flown("thesis", problem({"roe_m": [0, 0, 15, 0, 15, 5]}), relative_orbits=25)
    assert m.r_chaser_rtn_m.shape == (2525, 3)
    assert m.sequence.tolist() == np.repeat(np.arange(25), 101).tolist()
    # Eq. 2.10 at t = 0: R = −δex, T = −2 δey, N = −δiy, whatever the place in the orbit.
    assert m.r_chaser_rtn_m[0] == pytest.approx([-15, 0, -5])
    # A quarter of an orbit on: R = −δey, T = 2 δex, N = δix, of the first relative orbit.
    quarter = m.r_chaser_rtn_m[25]
    assert quarter == pytest.approx([0, 30, 15 + 2 * 5 / 25], abs=1e-6)
    # In the same (R, T) for all h: the cameras of an instant lie on one line.
    assert np.ptp(m.r_chaser_rtn_m.reshape(25, 101, 3)[:, :, :2], axis=0).max() < 1e-12


def test_algorithm_3_1_branches_and_jumps_as_the_thesis_has_it() -> None:
    rows = algorithm_3_1(np.array([0, 0, 15.0, 0, 10.0, 5.0]), 25)
    dix, diy = rows[:, 4], rows[:, 5]
    assert dix[:6] == pytest.approx(10 + 0.4 * np.arange(1, 7))
    assert dix[6] - dix[5] == pytest.approx(-1.04 * 5)
    assert dix[12:] == pytest.approx(dix[11])
    assert diy[:12] == pytest.approx(5)
    assert diy[18] - diy[17] == pytest.approx(-1.48 * 5)


def test_the_thesis_refuses_what_it_does_not_have() -> None:
    with pytest.raises(InputError, match="δa = δλ = 0"):
        flown("thesis", problem({"roe_m": [0, 5, 15, 0, 15, 0]}))
    with pytest.raises(InputError, match=r"starts from relative\.roe_m"):
        flown("thesis", problem({"state_rtn": {"r_m": [0, 9, 0], "v_m_s": [0, 0, 0]}}))


DESIGNS: list[tuple[dict[str, Any], float, float, float]] = [
    # design, least and largest range, least coverage of 288 bins
    ({"name": "fly-around", "range_m": 20}, 19.99, 20.01, 0.1),
    ({"name": "safe-ellipse", "radial_m": 50, "normal_m": 30}, 50, np.hypot(100, 30), 0.05),
    ({"name": "v-bar-hop", "start_m": -200, "end_m": -100}, 95, 205, 0),
    ({"name": "v-bar-approach", "start_m": -100, "end_m": -10, "duration_s": 3000}, 10, 100, 0),
    ({"name": "r-bar-approach", "start_m": 100, "end_m": 10, "duration_s": 3000}, 10, 100, 0),
    ({"name": "hold-point", "r_rtn_m": [0, -20, 0]}, 20, 20, 0),
    ({"name": "algorithm-3-1", "delta_e_m": [10, 0], "delta_i_m": [0, 10]}, 10, 25, 0.35),
    ({"name": "algorithm-3-1-repaired", "size_m": 10}, 10, 45, 0.95),
]


@pytest.mark.parametrize(("design", "least", "largest", "covered"), DESIGNS, ids=lambda d: str(d)[:30])
def test_a_design_keeps_the_ranges_of_its_name(
    design: Any, least: float, largest: float, covered: float
) -> None:
    m = flown("roe", problem({"design": design}))
    assert ranges(m).min() > 0.999 * least
    assert ranges(m).max() < 1.003 * largest
    assert coverage(m.r_chaser_rtn_m) >= covered


def test_the_hop_ends_where_it_should() -> None:
    m = flown("roe", problem({"design": {"name": "v-bar-hop", "start_m": -200, "end_m": -100}}))
    assert m.r_chaser_rtn_m[-1] == pytest.approx([0, -100, 0], abs=0.5)


def test_a_safe_ellipse_keeps_away_from_the_line_of_flight() -> None:
    m = flown(
        "roe",
        problem({"design": {"name": "safe-ellipse", "radial_m": 50, "normal_m": 30, "along_m": 80}}),
    )
    radial, _, normal = m.r_chaser_rtn_m.T
    assert np.hypot(radial, normal).min() > 0.99 * 30


def test_the_repaired_algorithm_has_neither_jumps_nor_twins() -> None:
    m = flown("roe", problem({"design": {"name": "algorithm-3-1-repaired", "size_m": 10}}))
    orbits = m.r_chaser_rtn_m.reshape(25, 101, 3)
    steps = np.linalg.norm(np.diff(orbits, axis=0, append=orbits[:1]), axis=-1).max(axis=1)
    assert steps.max() < 35
    assert steps.min() > 1


def test_the_view_sphere_sees_every_side_at_every_range() -> None:
    design = {"name": "view-sphere", "range_m": [10, 40], "range_law": "logarithmic"}
    m = flown("roe", problem({"design": design}, t_s=np.linspace(0, 1000, 2525)))
    assert coverage(m.r_chaser_rtn_m) == 1.0
    assert ranges(m).min() >= 10
    assert ranges(m).max() <= 40
    # As many below the geometric mean as above, in every octant.
    near = ranges(m) < 20
    octant = (m.r_chaser_rtn_m > 0) @ [1, 2, 4]
    for k in range(8):
        assert near[octant == k].mean() == pytest.approx(0.5, abs=0.06)
    assert len(set(m.sequence.tolist())) == 2525


TRANSFER = {"to_roe_m": [0, -50, 30, 10, 20, 60], "start_s": 100.0}


@pytest.mark.parametrize(
    ("e", "a_m", "off_m"), [(1e-4, 7.1e6, 0.1), (0.05, 7.5e6, 0.1), (0.52, 1.6e7, 0.1)]
)
def test_a_transfer_arrives(e: float, a_m: float, off_m: float) -> None:
    period_s = 2 * np.pi * np.sqrt(a_m**3 / CONSTANTS.mu_earth_m3_s2)
    plan = {"transfer": {**TRANSFER, "end_s": 3 * period_s}}
    orbit = {"elements": {**LEO, "a_m": a_m, "e": e}}
    asked = problem(
        {"roe_m": [0, 0, 0, 100, 0, 100], "plan": plan}, orbit, [0, 3 * period_s, 4 * period_s]
    )
    m = flown("roe", asked)
    arrived = {"r_m": m.r_chaser_rtn_m[1].tolist(), "v_m_s": m.v_chaser_rtn_m_s[1].tolist()}
    state = {"r_m": m.r_target_eci_m[1].tolist(), "v_m_s": m.v_target_eci_m_s[1].tolist()}
    orbit = {"state_eci": {"epoch_utc": "2022-01-31", **state}}
    (start,) = problem({"state_rtn": arrived}, orbit).starts
    assert start.roe * a_m == pytest.approx(np.array(TRANSFER["to_roe_m"]), abs=off_m)
    plan_made = planned(PlanConfig.model_validate(plan), asked.starts[0])
    assert plan_made.least_dv_m_s <= plan_made.dv_m_s < 2 * plan_made.least_dv_m_s


def test_a_pure_change_of_eccentricity_costs_its_least() -> None:
    # na |δe|/2: D'Amico's closed form for two tangential impulses; the third holds δλ.
    plan = {"transfer": {"to_roe_m": [0, 0, 130, 0, 0, 0], "end_s": 3 * PERIOD_S}}
    asked = problem({"roe_m": [0, 0, 100, 0, 0, 0], "plan": plan})
    made = planned(PlanConfig.model_validate(plan), asked.starts[0])
    n = 2 * np.pi / PERIOD_S
    assert made.dv_m_s == pytest.approx(n * 30 / 2, rel=1e-6)
    assert made.least_dv_m_s == pytest.approx(n * 30 / 2, rel=1e-6)


@pytest.mark.parametrize("name", ["roe", "nonlinear", "j2-roe", "hcw", "sgp4"])
def test_an_impulse_turns_the_velocity_and_not_the_position(name: str) -> None:
    kick = [0.01, -0.02, 0.03]
    orbit = {"tle": TLE} if name == "sgp4" else None
    relative = {"roe_m": [0, 0, 5, 0, 5, 0]}
    t_s = [999.999, 1000.0, 1000.001]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DomainWarning)
        m = flown(
            name,
            problem({**relative, "plan": {"burns": [{"t_s": 1000.0, "dv_rtn_m_s": kick}]}}, orbit, t_s),
        )
        free = flown(name, problem(relative, orbit, t_s))
    assert m.r_chaser_rtn_m == pytest.approx(free.r_chaser_rtn_m, abs=1e-3)
    assert m.v_chaser_rtn_m_s[0] == pytest.approx(free.v_chaser_rtn_m_s[0], abs=1e-12)
    assert m.v_chaser_rtn_m_s[1:] - free.v_chaser_rtn_m_s[1:] == pytest.approx(
        np.array([kick] * 2), abs=2e-5
    )


def test_a_transfer_without_time_for_it_is_refused() -> None:
    plan = {"transfer": {**TRANSFER, "end_s": 2000.0}}
    with pytest.raises(InputError, match=r"1\.5 orbits or longer"):
        flown("roe", problem({"roe_m": [0, 0, 0, 100, 0, 100], "plan": plan}))


def test_the_period_is_the_tles_own() -> None:
    assert orbit_period_s(OrbitConfig(tle=TLE), CONSTANTS) == pytest.approx(86400 / 10.82419157)


def write_csv(path: Path, motion: Motion) -> None:
    names = ["r_target_eci_m", "v_target_eci_m_s", "r_chaser_rtn_m", "v_chaser_rtn_m_s"]
    header = ["t_s", *(f"{name}_{axis}" for name in names for axis in "xyz")]
    columns = np.column_stack([motion.t_s, *(getattr(motion, name) for name in names)])
    rows = "\n".join(",".join(map(repr, row)) for row in columns.tolist())
    path.write_text(",".join(header) + "\n" + rows + "\n")


def oem_lines(t_iso: list[str], r: Any, v: Any, **meta: str) -> str:
    known = {
        "OBJECT_NAME": "X",
        "CENTER_NAME": "EARTH",
        "REF_FRAME": "GCRF",
        "TIME_SYSTEM": "UTC",
        **meta,
    }
    head = ["CCSDS_OEM_VERS = 2.0", "CREATION_DATE = 2022-01-01T00:00:00", "META_START"]
    head += [f"{key} = {word}" for key, word in known.items()] + ["META_STOP", "COMMENT states"]
    rows = [
        " ".join([when, *(f"{x:.15g}" for x in [*(p / 1e3), *(s / 1e3)])])
        for when, p, s in zip(t_iso, r, v, strict=True)
    ]
    return "\n".join([*head, *rows, "COVARIANCE_START", "EPOCH = 2022-01-01", "1.0", "COVARIANCE_STOP"])


def test_a_file_gives_back_what_it_holds(tmp_path: Path) -> None:
    asked = problem({"roe_m": [0, 0, 50, 0, 50, 0]}, t_s=np.arange(0, 600, 60))
    made = flown("roe", asked)
    write_csv(tmp_path / "a.csv", made)
    r, v = eci_from_rtn(
        made.r_target_eci_m, made.v_target_eci_m_s, made.r_chaser_rtn_m, made.v_chaser_rtn_m_s
    )
    later = Epoch.from_iso(LEO["epoch_utc"]).shifted(10.0).iso()
    np.savez(
        tmp_path / "b.npz",
        epoch_utc=np.array(later),
        t_s=made.t_s - 10.0,
        r_target_eci_m=made.r_target_eci_m,
        v_target_eci_m_s=made.v_target_eci_m_s,
        r_chaser_eci_m=r,
        v_chaser_eci_m_s=v,
    )
    epoch = Epoch.from_iso(LEO["epoch_utc"])
    instants = [epoch.shifted(t).iso() for t in made.t_s]
    (tmp_path / "t.oem").write_text(oem_lines(instants, made.r_target_eci_m, made.v_target_eci_m_s))
    (tmp_path / "c.oem").write_text(oem_lines(instants, r, v))
    files = [{"path": "a.csv"}, {"path": "b.npz"}, {"path": "t.oem", "chaser_path": "c.oem"}]
    for options in files:
        got = flown("file", asked, **{key: tmp_path / name for key, name in options.items()})
        assert got.t_s == pytest.approx(made.t_s, abs=2e-6)
        assert got.r_target_eci_m == pytest.approx(made.r_target_eci_m, abs=1e-5)
        assert got.r_chaser_rtn_m == pytest.approx(made.r_chaser_rtn_m, abs=1e-5)
        assert got.v_chaser_rtn_m_s == pytest.approx(made.v_chaser_rtn_m_s, abs=1e-7)


def test_time_systems_and_frames_of_an_oem(tmp_path: Path) -> None:
    r, v = np.array([[7e6, 1e5, 2e5]]), np.array([[0.0, 7.5e3, 100.0]])
    asked = problem(
        {"roe_m": [0, 0, 50, 0, 50, 0]}, {"elements": {**LEO, "epoch_utc": "2022-01-31T00:00:00"}}
    )

    def read(when: str, **meta: str) -> Motion:
        (tmp_path / "t.oem").write_text(oem_lines([when], r, v, **meta))
        (tmp_path / "c.oem").write_text(oem_lines([when], r + 10, v, **meta))
        return flown("file", asked, path=tmp_path / "t.oem", chaser_path=tmp_path / "c.oem")

    # TAI − UTC was 37 s in 2022, TT − TAI is 32.184 s, TAI − GPS 19 s.
    assert read("2022-01-31T00:01:00").t_s == pytest.approx([60])
    assert read("2022-031T00:01:00").t_s == pytest.approx([60])
    assert read("2022-01-31T00:01:37", TIME_SYSTEM="TAI").t_s == pytest.approx([60], abs=1e-5)
    assert read("2022-031T00:02:09.184", TIME_SYSTEM="TT").t_s == pytest.approx([60], abs=1e-5)
    assert read("2022-01-31T00:01:18", TIME_SYSTEM="GPS").t_s == pytest.approx([60], abs=1e-5)
    # Frame bias 23 mas, TEME against GCRF 0.3° in 2022.
    for frame, least, most in (("ICRF", 0, 0), ("EME2000", 0.1, 1), ("TEME", 2e4, 5e4)):
        moved = np.linalg.norm(read("2022-01-31T00:01:00", REF_FRAME=frame).r_target_eci_m - r)
        assert least <= moved <= most


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nothing", "CCSDS_OEM_VERS"),
        (
            oem_lines([], [], [], REF_FRAME="ITRF2000"),
            "line 8: REF_FRAME is 'ITRF2000'; supported values",
        ),
        (oem_lines([], [], [], CENTER_NAME="MOON"), "CENTER_NAME is 'MOON'"),
        (oem_lines([], [], [], TIME_SYSTEM="UT1"), "TIME_SYSTEM is 'UT1'"),
        (oem_lines([], [], []), "contains no states"),
        (oem_lines(["2022-01-31"], [np.ones(3)], [np.ones(3)]), "the epoch '2022-01-31' is not"),
        (
            "CCSDS_OEM_VERS = 2.0\n2022-01-31T00:00:00 1 2 3 4 5 6",
            "line 2: data line before the first META",
        ),
        (oem_lines([], [], []).replace("COMMENT states", "2022-01-31T00:00:00 1 2 x"), "finite numbers"),
    ],
)
def test_an_unusable_oem_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "t.oem"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        flown("file", problem({"roe_m": [0, 0, 50, 0, 50, 0]}), path=path, chaser_path=path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_oem_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="chaser_path"):
        flown("file", problem({"roe_m": [0, 0, 50, 0, 50, 0]}), path=tmp_path / "only.oem")
