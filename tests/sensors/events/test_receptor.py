"""The photoreceptor's logarithm and low-pass against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from posse_core._sensors.events.receptor import Receptor


@given(light=st.lists(st.floats(0, 1e12), min_size=2, max_size=20))
def test_the_response_rises_and_is_finite_in_the_dark(light: list[float]) -> None:
    response = Receptor(25.0, 1e6, None).log(np.sort(light))
    assert np.isfinite(response).all()
    assert (np.diff(response) >= 0).all()


def test_the_response_is_linear_below_the_floor_and_logarithmic_above_without_a_kink() -> None:
    receptor = Receptor(25.0, 1e6, None)
    np.testing.assert_allclose(receptor.log(np.array([0.0, 10.0, 25.0])), [-1.0, -0.6, 0.0])
    np.testing.assert_allclose(
        receptor.log(np.array([25.0 * np.e, 2.5e5])), [1.0, np.log(1e4)], rtol=1e-14
    )
    below, at, above = receptor.log(np.array([25.0 - 1e-4, 25.0, 25.0 + 1e-4]))
    assert above - at == pytest.approx(at - below, rel=1e-5)


@given(
    brightness=st.floats(0, 2),
    rise=st.floats(-3, 3),
    start=st.floats(-3, 3),
    duration_s=st.floats(1e-4, 0.1),
)
def test_the_low_pass_is_that_of_its_differential_equation(
    brightness: float, rise: float, start: float, duration_s: float
) -> None:
    """τ dV/dt = L − V under a ramp L, integrated by scipy; τ by v2e's bandwidth (255 Y + 20) / 275."""
    receptor = Receptor(1.0, 1e6, 200.0)
    tau_s = 1 / (2 * np.pi * 200.0 * (255 * min(brightness, 1.0) + 20) / 275)
    level = receptor.follow(
        np.array([start]),
        np.array([1.0]),
        np.array([1.0 + rise]),
        np.array([brightness * 1e6]),
        duration_s,
    )
    solved = solve_ivp(
        lambda t_s, v: (1.0 + rise * t_s / duration_s - v) / tau_s,
        (0, duration_s),
        [start],
        rtol=1e-9,
        atol=1e-10,
    )
    assert level[0] == pytest.approx(solved.y[0, -1], abs=1e-7)


def test_a_sine_is_weakened_and_late_by_the_bandwidth() -> None:
    """At the −3 dB frequency: gain 1/√2 and 45° of lag, after the start has died out."""
    receptor = Receptor(1.0, 1.0, 50.0)
    bright, steps = np.array([1.0]), 400
    t_s = np.arange(20 * steps + 1) / (50.0 * steps)
    log = np.sin(2 * np.pi * 50.0 * t_s)
    level = np.zeros(1)
    out = [0.0]
    for before, after in pairwise(log):
        level = receptor.follow(level, np.array([before]), np.array([after]), bright, 1 / (50.0 * steps))
        out.append(float(level[0]))
    wave = np.mean(np.array(out)[-10 * steps :] * np.exp(-2j * np.pi * 50.0 * t_s[-10 * steps :]))
    assert 2 * abs(wave) == pytest.approx(np.sqrt(0.5), abs=1e-4)
    assert np.angle(wave * 2j) == pytest.approx(-np.pi / 4, abs=1e-4)


def test_without_a_bandwidth_the_light_is_followed_at_once() -> None:
    after = np.array([1.0, -2.0])
    level = Receptor(1.0, 1.0, None).follow(np.zeros(2), np.zeros(2), after, np.ones(2), 1e-6)
    np.testing.assert_array_equal(level, after)
