"""The pixels of an event camera against closed forms and a simulation event by event."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from operator import mul

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posse_core._arrays import FloatArray
from posse_core._sensors.events.noise import Noise
from posse_core._sensors.events.pixels import Array, Crossings, advance, begin
from posse_core._sensors.events.receptor import Receptor

QUIET = Noise.drawn(np.random.default_rng(0), 0.0, 1, 1.0)
ALL_LOG = Receptor(floor_e_s=1.0, white_e_s=1e30, bandwidth_hz=None)
BASE = 1e6
"""A light that is far above the floor, electrons per second."""


def array(
    pixels: int,
    *,
    on: float = 0.25,
    off: float = 0.25,
    leak_per_s: float = 0.0,
    refractory_s: float = 0.0,
    receptor: Receptor = ALL_LOG,
) -> Array:
    """Pixels that are all alike."""
    return Array(receptor, np.full(pixels, on), np.full(pixels, off), leak_per_s, refractory_s)


def mismatched(seed: int, pixels: int, *, threshold_on: float = 0.2, leak_hz: float = 0.0) -> Array:
    """Pixels whose thresholds differ by 0.03."""
    return Array.drawn(
        np.random.default_rng(seed),
        pixels,
        receptor=ALL_LOG,
        threshold_on=threshold_on,
        threshold_off=0.2,
        threshold_sigma=0.03,
        leak_hz=leak_hz,
        refractory_s=0.0,
    )


def run(
    pixels: Array,
    instants_s: Sequence[float] | FloatArray,
    log: Callable[[float], float | FloatArray],
    *,
    noise: Noise = QUIET,
    seed: int = 1,
) -> tuple[FloatArray, Crossings]:
    """What each pixel's change is at the start, and the events while the light is BASE exp(log(t))."""

    def light(t_s: float) -> FloatArray:
        return BASE * np.exp(np.broadcast_to(log(t_s), pixels.on.shape))

    state = begin(pixels, light(0.0), np.random.default_rng(seed))
    change, made = state.change, []
    for t_s in instants_s[1:]:
        state, crossings = advance(pixels, state, light(float(t_s)), float(t_s), noise)
        made.append(crossings)
    return change, together(made)


def together(made: Sequence[Crossings]) -> Crossings:
    t_s, pixel, on = (
        np.concatenate([getattr(part, name) for part in made]) for name in ("t_s", "pixel", "on")
    )
    order = np.lexsort((t_s, pixel))
    return Crossings(t_s[order], pixel[order], on[order])


def of(crossings: Crossings, pixel: int) -> FloatArray:
    """Times of a pixel's events."""
    return crossings.t_s[crossings.pixel == pixel]


def test_an_edge_makes_the_events_of_its_contrast_at_the_times_of_its_passage() -> None:
    """An edge of log contrast 3.1 over 4 px moves by 80 px/s; a render falls on every half pixel."""
    width, speed_px_s, edge_px, contrast = 40, 80.0, 4.0, 3.1
    columns = np.arange(width)

    def log(t_s: float) -> FloatArray:
        return contrast * np.clip((speed_px_s * t_s - columns) / edge_px, 0.0, 1.0)

    pixels = array(width, on=0.25)
    change, made = run(pixels, np.arange(89) / 160, log)
    assert made.on.all()
    for column in range(width):
        count = int(np.floor((contrast + change[column]) / 0.25))
        crossed = 0.25 * np.arange(1, count + 1) - change[column]
        expected_s = (column + edge_px * crossed / contrast) / speed_px_s
        np.testing.assert_allclose(of(made, column), expected_s, rtol=0, atol=1e-12)


@pytest.mark.parametrize("renders", [64, 256])
def test_a_flickering_plate_makes_the_events_of_the_levels_that_it_crosses(renders: int) -> None:
    """The logarithm is A sin(2πft). With thresholds of one size the crossed levels are a lattice, of
    which a pixel crosses all between the outermost that the sine reaches, once each way. Between renders
    the sine is taken as straight, which is off by less than A (2πf Δt)² / 8."""
    amplitude, f_hz, threshold, periods = 1.0, 5.0, 0.25, 3
    pixels = array(200, on=threshold, off=threshold)
    instants_s = np.arange(periods * renders + 1) / (f_hz * renders)
    change, made = run(pixels, instants_s, lambda t_s: amplitude * np.sin(2 * np.pi * f_hz * t_s))
    straight = amplitude * (2 * np.pi / renders) ** 2 / 8
    tested = 0
    for pixel in range(200):
        phase = -change[pixel]  # the remembered level
        highest = phase + threshold * np.floor((amplitude - phase) / threshold)
        lowest = phase - threshold * np.floor((amplitude + phase) / threshold)
        if min(amplitude - highest, amplitude + lowest) < straight:
            continue  # the straight lines may miss the outermost level
        tested += 1
        steps = round((highest - lowest) / threshold)
        first = round((highest - phase) / threshold)
        rising = lowest + threshold * np.arange(1, steps + 1)
        falling = highest - threshold * np.arange(1, steps + 1)
        levels = np.concatenate(
            [phase + threshold * np.arange(1, first + 1), falling, *[rising, falling] * (periods - 1)]
        )
        last_rising = rising[rising < 0]  # the last period ends at 0, on its way up
        levels = np.concatenate([levels, last_rising])
        times_s = of(made, pixel)
        assert len(times_s) == len(levels)
        np.testing.assert_allclose(
            amplitude * np.sin(2 * np.pi * f_hz * times_s), levels, rtol=0, atol=1.001 * straight
        )
        slope = 2 * np.pi * f_hz * np.sqrt(amplitude**2 - levels**2)
        steep = np.abs(levels) < 0.9 * amplitude
        nearest_s = nearest_crossing_s(levels / amplitude, f_hz, times_s)
        off_s = np.abs(times_s - nearest_s)[steep]
        assert (off_s < 1.5 * straight / slope[steep]).all()
    assert tested > 150


def nearest_crossing_s(sine: FloatArray, f_hz: float, near_s: FloatArray) -> FloatArray:
    """The time nearest to each of ``near_s`` at which the sine has a value, by its inverse."""
    first_s = np.arcsin(sine) / (2 * np.pi * f_hz)
    both_s = np.stack([first_s, 0.5 / f_hz - first_s])
    both_s = both_s + np.round((near_s - both_s) * f_hz) / f_hz
    return both_s[np.abs(both_s - near_s).argmin(axis=0), np.arange(len(near_s))]


@given(slope_per_s=st.floats(1.0, 1e5), lost=st.floats(0.01, 20.0))
def test_refractory_time_limits_the_rate(slope_per_s: float, lost: float) -> None:
    """Under a ramp of slope s a pixel's events are θ/s + refractory time apart: the change ``lost``
    within that time makes none."""
    refractory_s = lost / slope_per_s
    pixels = array(5, refractory_s=refractory_s)
    period_s = 0.25 / slope_per_s + refractory_s
    end_s = 10.3 * period_s
    change, made = run(pixels, np.linspace(0, end_s, 8), lambda t_s: slope_per_s * t_s)
    for pixel in range(5):
        first_s = (0.25 - change[pixel]) / slope_per_s
        count = int(np.floor((end_s - first_s) / period_s)) + 1
        expected_s = first_s + period_s * np.arange(count)
        np.testing.assert_allclose(of(made, pixel), expected_s, rtol=1e-9, atol=1e-9 * end_s)


def test_leak_makes_on_events_at_its_rate_in_unchanging_light() -> None:
    """The remembered level falls by ``leak_hz`` nominal thresholds a second, so a pixel's rate is that
    times nominal over own threshold."""
    pixels = mismatched(3, 400, leak_hz=2.0)
    change, made = run(pixels, np.linspace(0, 10, 7), lambda t_s: 0.0)
    assert made.on.all()
    for pixel in range(400):
        rate_hz = 2.0 * 0.2 / pixels.on[pixel]
        first_s = (1 - change[pixel] / pixels.on[pixel]) / rate_hz
        np.testing.assert_allclose(of(made, pixel), np.arange(first_s, 10, 1 / rate_hz), atol=1e-9)


def simulated(
    pixels: Array, pixel: int, instants_s: FloatArray, levels: FloatArray, change: float
) -> list[tuple[float, bool]]:
    """Events of a pixel, one after another in plain arithmetic, by what the documentation says."""
    made: list[tuple[float, bool]] = []
    remembered = levels[0] - change
    free_s = 0.0

    def level(t_s: float) -> float:
        return float(np.interp(t_s, instants_s, levels)) + pixels.leak_per_s * t_s

    for start_s, end_s in pairwise(instants_s):
        now_s = float(start_s)
        while now_s < end_s:
            if free_s > now_s:
                now_s = free_s
                if now_s >= end_s:
                    break
                remembered = level(now_s)
            slope = (level(float(end_s)) - level(float(start_s))) / (end_s - start_s)
            if slope == 0:
                break
            goal = pixels.on[pixel] if slope > 0 else -pixels.off[pixel]
            crossing_s = max(now_s, now_s + (remembered + goal - level(now_s)) / slope)
            if crossing_s > end_s:
                break
            made.append((crossing_s, slope > 0))
            remembered += goal
            now_s = crossing_s
            if pixels.refractory_s:
                free_s = crossing_s + pixels.refractory_s
    return made


@settings(max_examples=60)
@given(
    levels=st.lists(st.floats(-2, 2), min_size=3, max_size=12),
    leak_per_s=st.floats(0, 0.3),
    refractory_s=st.one_of(st.just(0.0), st.floats(1e-3, 0.5)),
    seed=st.integers(0, 2**20),
)
def test_pixels_follow_any_light_as_a_simulation_event_by_event(
    levels: list[float], leak_per_s: float, refractory_s: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    pixels = replace(
        array(4, leak_per_s=leak_per_s, refractory_s=refractory_s),
        on=random.uniform(0.05, 0.5, 4),
        off=random.uniform(0.05, 0.5, 4),
    )
    instants_s = np.concatenate([[0.0], np.cumsum(random.uniform(0.05, 0.4, len(levels) - 1))])
    change, made = run(
        pixels, instants_s, lambda t_s: float(np.interp(t_s, instants_s, levels)), seed=seed
    )
    for pixel in range(4):
        expected = simulated(pixels, pixel, instants_s, np.array(levels), change[pixel])
        own = made.pixel == pixel
        # An event that comes with the last render, to rounding, may be counted or not.
        last_s = max([*made.t_s[own], *(t_s for t_s, _ in expected)], default=0.0)
        assert abs(own.sum() - len(expected)) <= (last_s > instants_s[-1] - 1e-6)
        for (t_s, on), seen_s, seen_on in zip(expected, made.t_s[own], made.on[own], strict=False):
            assert seen_s == pytest.approx(t_s, abs=1e-6)
            assert seen_on == on


@given(
    slope_per_s=st.floats(-12, 20),
    renders=st.integers(2, 40),
    leak_per_s=st.floats(0, 0.1),
    refractory_s=st.floats(0, 0.01),
)
def test_events_of_a_ramp_do_not_depend_on_the_number_of_renders(
    slope_per_s: float, renders: int, leak_per_s: float, refractory_s: float
) -> None:
    pixels = array(50, leak_per_s=leak_per_s, refractory_s=refractory_s)
    noise = Noise.drawn(np.random.default_rng(5), 3.0, 50, 1.0)
    (_, once), (_, often) = (
        run(pixels, np.linspace(0, 1, count), lambda t_s: slope_per_s * t_s, noise=noise)
        for count in (2, renders + 1)
    )
    # The light stays above the floor. An event at the very end may, to rounding, be in one or the other.
    for pixel in range(50):
        first, second = of(once, pixel), of(often, pixel)
        shorter = min(len(first), len(second))
        assert abs(len(first) - len(second)) <= (max([*first, *second], default=0.0) > 1 - 1e-9)
        np.testing.assert_allclose(first[:shorter], second[:shorter], rtol=0, atol=1e-9)


def test_the_start_is_even_within_the_band_of_each_pixel() -> None:
    """So that as many events come in the first instant as later: under a ramp, one per θ of it."""
    pixels = array(20000, on=0.2, off=0.1)
    state = begin(pixels, np.full(20000, BASE), np.random.default_rng(2))
    assert (state.change <= pixels.on).all()
    assert (state.change >= -pixels.off).all()
    rising = state.change > 0
    assert rising.mean() == pytest.approx(0.5, abs=0.015)
    assert state.change[rising].mean() == pytest.approx(0.1, abs=0.002)
    assert state.change[~rising].mean() == pytest.approx(-0.05, abs=0.001)


def test_mismatch_has_its_spread_and_is_the_same_for_the_same_seed() -> None:
    def drawn(seed: int) -> Array:
        return mismatched(seed, 40000, threshold_on=0.3)

    first, again, other = drawn(1), drawn(1), drawn(2)
    np.testing.assert_array_equal(first.on, again.on)
    assert not np.array_equal(first.on, other.on)
    for thresholds, mean in ((first.on, 0.3), (first.off, 0.2)):
        # Four standard errors of the mean and of the standard deviation.
        assert thresholds.mean() == pytest.approx(mean, abs=4 * 0.03 / 200)
        assert thresholds.std() == pytest.approx(0.03, abs=4 * 0.03 / 200 / np.sqrt(2))
    assert np.corrcoef(first.on, first.off)[0, 1] == pytest.approx(0, abs=0.02)


def test_thresholds_show_in_the_gaps_between_events() -> None:
    pixels = mismatched(7, 300)
    for slope, thresholds in ((8.0, pixels.on), (-8.0, pixels.off)):
        _, made = run(pixels, [0.0, 0.5, 1.0], partial(mul, slope))
        for pixel in range(300):
            np.testing.assert_allclose(np.diff(of(made, pixel)), thresholds[pixel] / 8.0, atol=1e-12)
