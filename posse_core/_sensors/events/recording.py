"""A recording: the events of a pixel array over a window of time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray, FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._sensors.events.noise import Noise
from posse_core._sensors.events.pixels import Array, Crossings, advance, begin

MOST_RENDERS = 5000
"""The most images of the light in a recording. A raster image of 320 × 240 takes 20 to 50 ms on one
core."""


@dataclass(frozen=True)
class Events:
    """Events of a recording, ascending in time; those of one microsecond are in the order of their exact
    times.

    Attributes:
        x, y: (E,) uint16 column and row, px.
        t_us: (E,) int64 whole microseconds since the recording's instant, rounded.
        p: (E,) uint8, 1 where the light rose (ON), 0 where it fell (OFF).
    """

    x: IntArray
    y: IntArray
    t_us: IntArray
    p: IntArray

    @classmethod
    def of(cls, made: Iterable[Crossings], width_px: int) -> Events:
        """The events of the pixels of an image."""
        parts = [Crossings(np.empty(0), np.empty(0, np.int64), np.empty(0, np.bool_)), *made]
        t_s = np.concatenate([part.t_s for part in parts])
        pixel = np.concatenate([part.pixel for part in parts])
        on = np.concatenate([part.on for part in parts])
        order = np.lexsort((pixel, t_s))
        rows, columns = np.divmod(pixel[order], width_px)
        return cls(
            x=columns.astype(np.uint16),
            y=rows.astype(np.uint16),
            t_us=np.rint(t_s[order] * 1e6).astype(np.int64),
            p=on[order].astype(np.uint8),
        )


def record(
    array: Array,
    lights: Iterable[tuple[float, AnyArray]],
    noise: Noise,
    random: np.random.Generator,
    width_px: int,
) -> Events:
    """Events of an array of pixels.

    Args:
        array: the pixels.
        lights: instants in seconds, ascending from 0 and two at least, each with the light (H, W) in
            electrons per second.
        noise: candidates of the whole recording.
        random: draws what the pixels remember at the start.
        width_px: columns of the array.
    """
    series = iter(lights)
    _, first = next(series)
    state = begin(array, first.ravel(), random)
    made = []
    for t_s, light in series:
        state, crossings = advance(array, state, light.ravel(), t_s, noise)
        made.append(crossings)
    return Events.of(made, width_px)


def instants_s(window_s: float, speed_px_s: float, step_px: float, least_rate_hz: float) -> FloatArray:
    """(n + 1,) instants of a recording at which the light is computed, evenly from 0 to ``window_s``.

    Args:
        speed_px_s: the largest speed in the image.
        step_px: the largest motion from one instant to the next.
        least_rate_hz: the least number of instants per second.

    Raises:
        InputError: there would be more than :data:`MOST_RENDERS`.
    """
    steps = max(1.0, np.ceil(window_s * max(speed_px_s / step_px, least_rate_hz) - 1e-9))
    if not steps <= MOST_RENDERS:
        raise InputError(
            f"{window_s:g} s in which the image moves by {speed_px_s:.3g} px/s need {steps:.3g} renders,"
            f" and at most {MOST_RENDERS} are possible; shorten window_s, or raise step_px"
            f" ({step_px:g}) or lower least_rate_hz ({least_rate_hz:g})"
        )
    return np.asarray(np.linspace(0.0, window_s, int(steps) + 1))
