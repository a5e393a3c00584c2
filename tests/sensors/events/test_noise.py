"""Shot noise against the Poisson process of v2e's model, within what chance allows."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from posse_core._arrays import FloatArray
from posse_core._sensors.events.noise import Noise
from posse_core._sensors.events.pixels import Array, Crossings, advance, begin
from posse_core._sensors.events.receptor import Receptor

PIXELS, WINDOW_S, RATE_HZ = 5000, 2.0, 5.0
WHITE_E_S = 1e6


def noisy(
    brightness: FloatArray, *, renders: int = 4, refractory_s: float = 0.0, seed: int = 1
) -> Crossings:
    """Events by noise alone: thresholds are out of reach. ``brightness``: at start and end, even in
    time."""
    never = np.full(PIXELS, 1e12)
    pixels = Array(Receptor(1.0, WHITE_E_S, None), never, never, 0.0, refractory_s)
    noise = Noise.drawn(np.random.default_rng(seed), RATE_HZ, PIXELS, WINDOW_S)
    state = begin(pixels, np.full(PIXELS, WHITE_E_S * brightness[0]), np.random.default_rng(0))
    made = []
    for share in np.arange(1, renders + 1) / renders:
        light = WHITE_E_S * (brightness[0] + share * (brightness[1] - brightness[0]))
        state, crossings = advance(pixels, state, np.full(PIXELS, light), share * WINDOW_S, noise)
        made.append(crossings)
    return Crossings(
        *(np.concatenate([getattr(part, name) for part in made]) for name in ("t_s", "pixel", "on"))
    )


@pytest.mark.parametrize("brightness", [0.0, 0.3, 1.0, 3.0])
def test_the_rate_falls_with_the_light_as_in_v2e(brightness: float) -> None:
    """R (1 − 0.75 Y) for both polarities together, half of each; Y is 1 for all that is brighter than
    white. Four standard deviations of a Poisson count are allowed."""
    made = noisy(np.array([brightness, brightness]))
    expected = RATE_HZ * (1 - 0.75 * min(brightness, 1.0)) * PIXELS * WINDOW_S
    assert len(made.t_s) == pytest.approx(expected, abs=4 * np.sqrt(expected))
    assert made.on.sum() == pytest.approx(expected / 2, abs=4 * np.sqrt(expected / 2))


def test_it_is_a_poisson_process_in_time_and_among_the_pixels() -> None:
    made = noisy(np.array([0.0, 0.0]))
    counts = np.bincount(made.pixel, minlength=PIXELS)
    assert counts.var(ddof=1) / counts.mean() == pytest.approx(1, abs=4 * np.sqrt(2 / PIXELS))
    assert stats.kstest(made.t_s, stats.uniform(0, WINDOW_S).cdf).pvalue > 1e-3
    gaps_s = np.diff(np.sort(made.t_s))
    assert stats.kstest(gaps_s, stats.expon(scale=gaps_s.mean()).cdf).pvalue > 1e-3


def test_under_growing_light_it_thins_out_evenly() -> None:
    """Brightness rises from 0 to 1: the rate falls linearly to a quarter, so the share of events until t
    is (t − 0.375 t² / T) / (0.625 T)."""
    made = noisy(np.array([0.0, 1.0]), renders=3)
    expected = 0.625 * RATE_HZ * PIXELS * WINDOW_S
    assert len(made.t_s) == pytest.approx(expected, abs=4 * np.sqrt(expected))

    def share(t_s: FloatArray) -> FloatArray:
        return (t_s - 0.375 * t_s**2 / WINDOW_S) / (0.625 * WINDOW_S)

    assert stats.kstest(made.t_s, share).pvalue > 1e-3


def test_it_does_not_depend_on_the_number_of_renders() -> None:
    few, many = (noisy(np.array([0.0, 1.0]), renders=renders) for renders in (1, 50))
    first, second = (np.lexsort((made.pixel, made.t_s)) for made in (few, many))
    np.testing.assert_array_equal(few.t_s[first], many.t_s[second])
    np.testing.assert_array_equal(few.pixel[first], many.pixel[second])
    np.testing.assert_array_equal(few.on[first], many.on[second])


def test_a_pixel_that_is_held_makes_no_noise() -> None:
    """Gaps are the dead time and an exponential one: mean μ = 0.3 s, standard deviation σ = 0.2 s. The
    mean number of a renewal process until T, whose first gap has the mean m = 0.2 s, tends to
    T/μ + (σ² + μ²) / (2μ²) − m/μ, its variance to σ² T/μ³ (Cox 1962, Renewal Theory, section 4.2)."""
    made = noisy(np.array([0.0, 0.0]), refractory_s=0.1)
    order = np.lexsort((made.t_s, made.pixel))
    same = np.diff(made.pixel[order]) == 0
    assert np.diff(made.t_s[order])[same].min() >= 0.1
    expected = PIXELS * (WINDOW_S / 0.3 + (0.04 + 0.09) / (2 * 0.09) - 0.2 / 0.3)
    spread = np.sqrt(PIXELS * WINDOW_S * 0.04 / 0.3**3)
    assert len(made.t_s) == pytest.approx(expected, abs=4 * spread)


def test_a_noise_event_starts_the_pixel_anew() -> None:
    """So signal follows it by a whole threshold, and not by the rest of one."""
    pixels = Array(Receptor(1.0, 1e30, None), np.full(200, 0.5), np.full(200, 0.5), 0.0, 0.0)
    noise = Noise(
        t_s=np.full(200, 0.3),
        pixel=np.arange(200),
        on=np.arange(200) % 2 == 0,
        mark=np.full(200, 0.5),
    )
    state = begin(pixels, np.full(200, 1e6), np.random.default_rng(0))
    _, made = advance(pixels, state, np.full(200, 1e6 * np.exp(1.4)), 1.0, noise)
    for pixel in range(200):
        times_s = np.sort(made.t_s[made.pixel == pixel])
        at_noise = np.flatnonzero(times_s == 0.3)[0]
        assert times_s[at_noise + 1] - 0.3 == pytest.approx(0.5 / 1.4, abs=1e-12)
        assert (times_s[:at_noise] < 0.3).all()
