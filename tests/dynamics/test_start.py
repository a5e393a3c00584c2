"""Starts by each of their forms, and a problem that no scenario has made."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import posse_core as posse
from posse_core import Burn, Constants, Epoch, Flight, FlightPropagator, Start, Target
from posse_core._arrays import FloatArray
from posse_core._dynamics.elements import state_from_keplerian
from posse_core._frames import eci_from_rtn
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import NoOptions
from posse_core._propagators.roe import RoePropagator
from posse_core._scenario.orbit import ElementsConfig, OrbitConfig, RelativeConfig
from posse_core._trajectory.problem import resolve

CONSTANTS = Constants()
EPOCH = Epoch.from_iso("2022-01-31T02:02:27.58")
T_S = np.linspace(0.0, 5900.0, 13)
ROE_M = np.array([0.5, 10.0, 60.0, 80.0, -70.0, 40.0])


def target(e: float = 0.01, i_deg: float = 98.2, argp_deg: float = 20.0) -> Target:
    elements = np.array([7.5e6, e, *np.radians([i_deg, 10.0, argp_deg, 30.0])])
    return Target(*state_from_keplerian(elements, CONSTANTS.mu_earth_m3_s2), CONSTANTS)


def problem(*starts: Start, burns: tuple[Burn, ...] = ()) -> posse.PropagationProblem:
    return posse.PropagationProblem(EPOCH, starts[0].target, starts, T_S, burns)


def agree(one: Start, other: Start) -> None:
    # Geocentric states round at 1e-9 m and 1e-12 m/s; ROE weigh a velocity by 1/n, some 1e3 s.
    np.testing.assert_allclose(other.rtn[:3], one.rtn[:3], rtol=0, atol=1e-7)
    np.testing.assert_allclose(other.rtn[3:], one.rtn[3:], rtol=0, atol=1e-10)
    np.testing.assert_allclose(other.roe_m, one.roe_m, rtol=0, atol=1e-5)
    np.testing.assert_allclose(other.roe_equinoctial, one.roe_equinoctial, rtol=0, atol=1e-12)


metres = st.floats(-1e3, 1e3)


@given(
    roe_m=st.tuples(st.floats(-10, 10), metres, metres, metres, metres, metres).map(np.array),
    e=st.floats(0.0, 0.1),
    i_deg=st.floats(1.0, 179.0),
    argp_deg=st.floats(0.0, 360.0),
)
def test_all_forms_of_a_start_are_the_same_chaser(
    roe_m: FloatArray, e: float, i_deg: float, argp_deg: float
) -> None:
    chief = target(e, i_deg, argp_deg)
    start = Start.from_roe(chief, roe_m)
    agree(start, Start.from_rtn(chief, start.rtn[:3], start.rtn[3:]))
    eci = eci_from_rtn(chief.r_eci_m, chief.v_eci_m_s, start.rtn[:3], start.rtn[3:])
    agree(start, Start.from_eci(chief, *eci))
    equinoctial_m = start.roe_equinoctial * chief.equinoctial[0]
    agree(start, Start.from_equinoctial_roe(chief, equinoctial_m))


def test_the_form_that_is_given_is_kept_to_the_bit() -> None:
    chief = target()
    rtn = np.array([1 / 3, -np.pi, 1e-9, 1e-3 / 7, 0.0, -1e-17])
    np.testing.assert_array_equal(Start.from_rtn(chief, rtn[:3], rtn[3:]).rtn, rtn)
    np.testing.assert_array_equal(Start.from_roe(chief, ROE_M / 3).roe_m, ROE_M / 3)
    start = Start.from_equinoctial_roe(chief, ROE_M / 3)
    np.testing.assert_array_equal(start.roe_equinoctial, ROE_M / 3 / chief.equinoctial[0])


@pytest.mark.parametrize("name", ["roe", "nonlinear", "j2-roe", "yamanaka-ankersen"])
def test_a_state_without_a_scenario_flies_as_a_scenarios_does(name: str) -> None:
    propagator = load_plugins().registry.create("propagator", name)
    elements = ElementsConfig(
        epoch_utc=EPOCH.iso(), a_m=7.5e6, e=0.01, i_deg=98.2, raan_deg=10.0, argp_deg=20.0,
        mean_anomaly_deg=30.0,
    )  # fmt: skip
    relative = RelativeConfig(roe_m=tuple(ROE_M))
    by_scenario = propagator.propagate(resolve(OrbitConfig(elements=elements), relative, T_S, CONSTANTS))
    alone = propagator.propagate(problem(Start.from_roe(target(), ROE_M)))
    np.testing.assert_array_equal(alone.r_target_eci_m, by_scenario.r_target_eci_m)
    np.testing.assert_array_equal(alone.r_chaser_rtn_m, by_scenario.r_chaser_rtn_m)
    np.testing.assert_array_equal(alone.v_chaser_rtn_m_s, by_scenario.v_chaser_rtn_m_s)


class StraightOn(FlightPropagator):
    """No gravity at all: a model of somebody else's that knows how to fly and nothing more."""

    elliptic = False

    def fly(self, problem: posse.PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        t_s = after_s[:, None]
        still = np.ones_like(t_s)
        position = start.rtn[:3] + t_s * start.rtn[3:]
        chief = start.target
        return Flight(
            chief.r_eci_m * still,
            chief.v_eci_m_s * still,
            np.concatenate([position, start.rtn[3:] * still], axis=-1),
        )


def test_a_foreign_model_has_impulses_and_several_orbits_for_nothing() -> None:
    chief = target()
    first = Start.from_rtn(chief, np.array([0.0, -50.0, 0.0]), np.array([0.0, 0.01, 0.0]))
    second = Start.from_rtn(chief, np.array([5.0, 0.0, 0.0]), np.zeros(3))
    kicks = (Burn(1000.0, np.array([0.02, 0.0, 0.0])), Burn(3000.0, np.array([0.0, 0.0, -0.03])))
    motion = StraightOn(NoOptions()).propagate(problem(first, second, burns=kicks))
    assert motion.sequence.tolist() == [0] * len(T_S) + [1] * len(T_S)
    pushed = np.stack(
        [0.02 * np.maximum(T_S - 1000, 0), 0 * T_S, -0.03 * np.maximum(T_S - 3000, 0)], axis=-1
    )
    for k, start in enumerate((first, second)):
        rows = slice(k * len(T_S), (k + 1) * len(T_S))
        free = start.rtn[:3] + T_S[:, None] * start.rtn[3:]
        np.testing.assert_allclose(motion.r_chaser_rtn_m[rows], free + pushed, atol=1e-9)


def test_a_hyperbola_is_refused_by_a_model_without_hyperbolas() -> None:
    fast = Target(np.array([7e6, 0.0, 0.0]), np.array([0.0, 12e3, 1e3]), CONSTANTS)
    start = Start.from_rtn(fast, np.array([0.0, -50.0, 0.0]), np.zeros(3))
    with pytest.raises(posse.InputError, match="the target: the orbit is not elliptic"):
        RoePropagator(NoOptions()).propagate(problem(start))
    with pytest.raises(posse.InputError, match="the target: the orbit is not elliptic"):
        Start.from_roe(fast, ROE_M)
    assert len(StraightOn(NoOptions()).propagate(problem(start)).t_s) == len(T_S)


def test_a_problem_is_of_one_target_and_its_impulses_are_in_order() -> None:
    whole = problem(Start.from_roe(target(), ROE_M))
    with pytest.raises(ValueError, match="the problem's own target"):
        replace(whole, starts=(Start.from_roe(target(), ROE_M),))
    late, early = Burn(20.0, np.zeros(3)), Burn(10.0, np.zeros(3))
    with pytest.raises(ValueError, match="in order of time"):
        replace(whole, burns=(late, early))


def test_the_documented_example_flies(capsys: pytest.CaptureFixture[str]) -> None:
    text = (Path(__file__).parents[2] / "docs" / "dynamics.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    exec(code, {})
    along_m = float(capsys.readouterr().out.strip("[]\n ").split()[1])
    # Hill's equations: a radial kick of 1 cm/s moves along the track by −2 v (1 − cos nt)/n; the start
    # itself drifts with the slope of 7500 m/s against the circle's speed.
    assert -60 < along_m < -50
