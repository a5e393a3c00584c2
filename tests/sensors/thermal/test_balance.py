"""Heat balance: closed forms, energy, and integrators of others."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from thermal_bodies import SIGMA

from posse_core._sensors.thermal.balance import CLOSED_K, Balance
from posse_core._sensors.thermal.planck import SPACE_K


def one(emissivity: float = 0.8, capacity: float = 5000.0) -> Balance:
    """A facet that sees nothing but the sky."""
    return Balance(np.array([emissivity]), np.array([emissivity]), np.array([capacity]), np.ones(1))


def several(rng: np.random.Generator, count: int = 40) -> Balance:
    """Facets that see each other."""
    emissivity = rng.uniform(0.05, 1.8, count)
    return Balance(
        emissivity,
        emissivity * rng.uniform(0, 1, count),
        rng.uniform(500, 20000, count),
        rng.uniform(0.01, 2, count),
    )


def test_a_plate_cools_in_eclipse_as_the_closed_form_says():
    """C dT/dt = −εσT⁴: T = (T₀⁻³ + 3εσt/C)^(−1/3). 30 minutes by steps of a minute."""
    balance, temperature_k = one(), np.array([350.0])
    errors_k = []
    for minute in range(1, 31):
        temperature_k = balance.after_k(temperature_k, np.zeros(1), 60.0)
        exact_k = (350.0**-3 + 3 * 0.8 * SIGMA * 60.0 * minute / 5000.0) ** (-1 / 3)
        errors_k.append(abs(temperature_k[0] - exact_k))
    assert max(errors_k) < 0.05


def test_the_step_is_of_second_order():
    balance, exact_k = one(), (350.0**-3 + 3 * 0.8 * SIGMA * 1800 / 5000.0) ** (-1 / 3)

    def error_k(steps: int) -> float:
        temperature_k = np.array([350.0])
        for _ in range(steps):
            temperature_k = balance.after_k(temperature_k, np.zeros(1), 1800 / steps)
        return float(abs(temperature_k[0] - exact_k))

    # Half the step, a quarter of the error; the cosmic background adds 1e-6 K.
    assert 3.5 < error_k(6) / error_k(12) < 4.5
    assert 3.5 < error_k(12) / error_k(24) < 4.5


@given(
    st.floats(3.0, 600.0),
    st.floats(0.0, 5000.0),
    st.floats(0.02, 2.0),
    st.floats(10.0, 1e5),
    st.floats(0.1, 1e6),
)
def test_no_step_passes_the_equilibrium(start_k, absorbed_w_m2, emissivity, capacity, step_s):
    balance = one(emissivity, capacity)
    after_k = balance.after_k(np.array([start_k]), np.array([absorbed_w_m2]), step_s)[0]
    rest_k = balance.steady_k(np.array([absorbed_w_m2]))[0]
    slack_k = 1e-9 * max(start_k, rest_k)
    assert min(start_k, rest_k) - slack_k <= after_k <= max(start_k, rest_k) + slack_k


def test_the_steady_state_solves_the_equations_of_all_facets_and_the_wall():
    """Against a linear system in the fourth powers, with the wall as one more unknown."""
    rng = np.random.default_rng(5)
    balance = several(rng)
    absorbed = rng.uniform(0, 1500, 40)
    to_wall = balance.emissivity - balance.open
    system = np.zeros((41, 41))
    system[:40, :40] = np.diag(balance.emissivity)
    system[:40, 40] = -to_wall
    system[40, :40] = balance.area_m2 * to_wall
    system[40, 40] = -np.sum(balance.area_m2 * to_wall)
    right = np.append(absorbed / SIGMA + balance.open * SPACE_K**4, 0.0)
    exact_k = np.linalg.solve(system, right) ** 0.25
    temperature_k = balance.steady_k(absorbed)
    np.testing.assert_allclose(temperature_k, exact_k[:40], rtol=1e-9)
    assert balance.wall_k(temperature_k) == pytest.approx(exact_k[40], rel=1e-9)


def test_what_is_absorbed_leaves_to_space():
    rng = np.random.default_rng(6)
    balance = several(rng)
    absorbed = rng.uniform(0, 1500, 40)
    temperature_k = balance.steady_k(absorbed)
    out_w_m2 = balance.open * SIGMA * (temperature_k**4 - SPACE_K**4)
    assert np.sum(balance.area_m2 * out_w_m2) == pytest.approx(
        np.sum(balance.area_m2 * absorbed), rel=1e-12
    )


def test_a_resting_history_is_the_steady_state():
    rng = np.random.default_rng(7)
    balance = several(rng)
    absorbed = rng.uniform(0, 1500, 40)
    temperature_k, change_k = balance.periodic_k(np.full(20, 60.0), np.tile(absorbed, (20, 1)))
    np.testing.assert_allclose(temperature_k, balance.steady_k(absorbed), atol=0.02)
    assert change_k <= CLOSED_K


def orbit(steps: int, sun_w_m2: float = 900.0) -> tuple[np.ndarray, np.ndarray]:
    """Length and absorbed heat of the steps of an orbit of 5900 s, the last 35 % of it in the dark."""
    middle = (np.arange(steps) + 0.5) / steps
    heat = np.where(middle < 0.65, sun_w_m2 * np.sin(np.pi * middle / 0.65) + 50, 50.0)
    return np.full(steps, 5900.0 / steps), heat[:, None]


@pytest.mark.parametrize("capacity", [300.0, 5000.0, 40000.0])
def test_a_periodic_history_is_that_of_another_integrator(capacity: float):
    """Twenty and more periods by Radau's method, with the same steps of heat."""
    balance = one(0.8, capacity)
    steps_s, heat = orbit(90)
    temperature_k, change_k = balance.periodic_k(steps_s, heat)
    state = balance.steady_k(heat.mean(axis=0))
    for _ in range(25):
        for step_s, absorbed in zip(steps_s, heat[:, 0], strict=True):
            state = solve_ivp(
                lambda t, y, q=absorbed: (q - 0.8 * SIGMA * (y**4 - SPACE_K**4)) / capacity,
                (0, step_s), state, method="LSODA", rtol=1e-8, atol=1e-8,
            ).y[:, -1]  # fmt: skip
    assert temperature_k[0] == pytest.approx(state[0], abs=0.1)
    assert change_k <= CLOSED_K


@settings(max_examples=20)
@given(st.floats(300.0, 30000.0), st.floats(0.1, 1.8))
def test_over_a_period_as_much_is_emitted_as_absorbed(capacity: float, emissivity: float):
    """The steps' own temperatures, by Simpson's rule with the middles of the steps: within 0.1 %."""
    balance = one(emissivity, capacity)
    steps_s, heat = orbit(180)
    start_k, _ = balance.periodic_k(steps_s, heat)
    temperature_k, emitted_j_m2 = start_k, 0.0
    for step_s, absorbed in zip(steps_s, heat, strict=True):
        middle_k = balance.after_k(temperature_k, absorbed, step_s / 2)
        end_k = balance.after_k(temperature_k, absorbed, step_s)
        mean4 = (temperature_k**4 + 4 * middle_k**4 + end_k**4) / 6
        emitted_j_m2 += step_s * emissivity * SIGMA * float(mean4[0])
        temperature_k = end_k
    assert emitted_j_m2 == pytest.approx(float(np.sum(steps_s * heat[:, 0])), rel=1e-3)
