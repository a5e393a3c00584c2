"""The change detectors of an event camera's pixels, between one image of the light and the next.

A pixel remembers the level of its photoreceptor and makes an event when the level has risen by its ON
threshold or fallen by its OFF threshold (Lichtsteiner, Posch, Delbruck 2008). Then the detector is held
in reset for the refractory time; the level at its end is the new remembered one, so a change within that
time is lost, as in the circuit. The switch of the reset leaks: the remembered level falls slowly, which
makes ON events by itself (Nozaki, Delbruck 2017). Shot noise makes events of both polarities by a
Poisson process (:mod:`posse_core._sensors.events.noise`).

Between two images the level is linear in time, and so are the crossings' times (ESIM: Rebecq, Gehrig,
Scaramuzza 2018), of which a pixel may have many.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._sensors.events.noise import Noise
from posse_core._sensors.events.receptor import Receptor

LEAST_THRESHOLD = 0.01
"""Smallest threshold of a pixel, as in v2e; a pixel that has it is hot."""
_STILL_PER_S = 1e-200
"""Speed of a level that does not move: so low that it crosses no threshold, and no division is by 0."""


@dataclass(frozen=True)
class Array:
    """What is the same in every recording of a run, for N pixels row by row.

    Attributes:
        receptor: response of the photoreceptors.
        on, off: (N,) thresholds of the change of the logarithm of the light; both positive.
        leak_per_s: fall of the remembered level by the leak, 1/s.
        refractory_s: time after an event in which a pixel is held in reset.
    """

    receptor: Receptor
    on: FloatArray
    off: FloatArray
    leak_per_s: float
    refractory_s: float

    @classmethod
    def drawn(
        cls,
        random: np.random.Generator,
        pixels: int,
        *,
        receptor: Receptor,
        threshold_on: float,
        threshold_off: float,
        threshold_sigma: float,
        leak_hz: float,
        refractory_s: float,
    ) -> Array:
        """An array whose thresholds are spread by a normal distribution (v2e).

        The leak is the same in every pixel, ``leak_hz`` nominal ON thresholds a second, so the rate of
        leak events varies with the threshold of the pixel.
        """
        on = random.normal(threshold_on, threshold_sigma, pixels)
        off = random.normal(threshold_off, threshold_sigma, pixels)
        return cls(
            receptor=receptor,
            on=np.maximum(on, LEAST_THRESHOLD),
            off=np.maximum(off, LEAST_THRESHOLD),
            leak_per_s=leak_hz * threshold_on,
            refractory_s=refractory_s,
        )


@dataclass(frozen=True)
class State:
    """The pixels at an instant.

    Attributes:
        t_s: the instant.
        light_e_s: (N,) the light, electrons per second.
        log: (N,) its logarithm, by the receptor.
        level: (N,) output of the photoreceptor.
        change: (N,) level less the remembered one, −off … on; 0 while a pixel is held.
        held_until_s: (N,) instant until which the pixel is held in reset; in the past if it is not.
    """

    t_s: float
    light_e_s: FloatArray
    log: FloatArray
    level: FloatArray
    change: FloatArray
    held_until_s: FloatArray


@dataclass(frozen=True)
class Crossings:
    """Events, in no order. A pixel's number counts row by row.

    Attributes:
        t_s: (E,) times.
        pixel: (E,) pixels.
        on: (E,) whether the light rose.
    """

    t_s: FloatArray
    pixel: IntArray
    on: BoolArray


def begin(array: Array, light_e_s: FloatArray, random: np.random.Generator) -> State:
    """The pixels at t = 0 under a light (N,) that they have settled to.

    What each has remembered is drawn evenly from its thresholds' band, as if it had watched for long; so
    a recording does not start with a silence.
    """
    light_e_s = np.asarray(light_e_s, dtype=np.float64)
    log = array.receptor.log(light_e_s)
    change = random.uniform(-1.0, 1.0, len(log))
    return State(
        t_s=0.0,
        light_e_s=light_e_s,
        log=log,
        level=log,
        change=np.where(change > 0, change * array.on, change * array.off),
        held_until_s=np.zeros(len(log)),
    )


def advance(
    array: Array, state: State, light_e_s: FloatArray, t_s: float, noise: Noise
) -> tuple[State, Crossings]:
    """The pixels at a later instant ``t_s``, where the light is ``light_e_s`` (N,), and the events until
    then.

    ``noise`` is that of the whole recording.
    """
    receptor, duration_s = array.receptor, t_s - state.t_s
    light_e_s = np.asarray(light_e_s, dtype=np.float64)
    log = receptor.log(light_e_s)
    level = receptor.follow(state.level, state.log, log, (state.light_e_s + light_e_s) / 2, duration_s)
    rise = level - state.level + array.leak_per_s * duration_s
    change = state.change + rise
    held_until_s = state.held_until_s.copy()
    candidates = noise.between(state.t_s, t_s)
    busy = (change >= array.on) | (change <= -array.off) | (held_until_s > state.t_s)
    busy[candidates.pixel] = True
    pixel = np.flatnonzero(busy)
    detectors = _Detectors(
        slope_per_s=rise[pixel] / duration_s,
        on=array.on[pixel],
        off=array.off[pixel],
        refractory_s=array.refractory_s,
        change=state.change[pixel],
        since_s=np.maximum(held_until_s[pixel], state.t_s),
    )
    for each in candidates.rounds():
        at = np.searchsorted(pixel, each.pixel)
        detectors.run(at, each.t_s)
        then = (each.t_s - state.t_s) / duration_s
        light_then_e_s = (1 - then) * state.light_e_s[each.pixel] + then * light_e_s[each.pixel]
        happens = each.happens(receptor.brightness(light_then_e_s))
        detectors.fire(at[happens], each.t_s[happens], each.on[happens])
    detectors.run(np.arange(len(pixel)), np.full(len(pixel), t_s))
    change[pixel] = detectors.change
    held_until_s[pixel] = detectors.since_s
    return State(t_s, light_e_s, log, level, change, held_until_s), detectors.crossings(pixel)


class _Detectors:
    """Change detectors under levels that are linear in time, each at an instant of its own."""

    def __init__(
        self,
        slope_per_s: FloatArray,
        on: FloatArray,
        off: FloatArray,
        refractory_s: float,
        change: FloatArray,
        since_s: FloatArray,
    ) -> None:
        """All (n,). ``slope_per_s``: of the level less the remembered one. ``since_s``: the instants,
        which for a detector that is held is the end of its reset, where its change is 0."""
        self._rising = slope_per_s > 0
        self._slope_per_s = slope_per_s
        self._threshold = np.where(self._rising, on, off)
        speed_per_s = np.maximum(np.abs(slope_per_s), _STILL_PER_S)
        self._crossing_s = self._threshold / speed_per_s
        self._speed_per_s = speed_per_s
        self._refractory_s = refractory_s
        self.change = change
        self.since_s = since_s
        self._made: list[Crossings] = []

    def run(self, at: IntArray, end_s: FloatArray) -> None:
        """Let the detectors ``at``, each once, run until ``end_s``; one that is held longer stays so."""
        since_s, change, rising = self.since_s[at], self.change[at], self._rising[at]
        short = self._threshold[at] - np.where(rising, change, -change)
        first_s = since_s + np.maximum(short, 0.0) / self._speed_per_s[at]
        period_s = self._crossing_s[at] + self._refractory_s
        count = np.where(first_s <= end_s, np.floor((end_s - first_s) / period_s) + 1, 0)
        count = count.astype(np.int64)
        fired = count > 0
        since_s = np.where(fired, first_s + (count - 1) * period_s + self._refractory_s, since_s)
        free_s = np.maximum(end_s - since_s, 0.0)
        self.change[at] = np.where(fired, 0.0, change) + self._slope_per_s[at] * free_s
        self.since_s[at] = np.maximum(since_s, end_s)
        ordinal = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        times_s = np.repeat(first_s, count) + ordinal * np.repeat(period_s, count)
        self._made.append(Crossings(times_s, np.repeat(at, count), np.repeat(rising, count)))

    def fire(self, at: IntArray, t_s: FloatArray, on: BoolArray) -> None:
        """Events by noise in detectors that have run until ``t_s``; those that are held make none."""
        free = self.since_s[at] <= t_s
        at, t_s = at[free], t_s[free]
        self.change[at] = 0.0
        self.since_s[at] = t_s + self._refractory_s
        self._made.append(Crossings(t_s, at, on[free]))

    def crossings(self, pixel: IntArray) -> Crossings:
        """All events so far; ``pixel`` (n,) are the detectors' pixels."""
        return Crossings(
            np.concatenate([made.t_s for made in self._made]),
            pixel[np.concatenate([made.pixel for made in self._made])],
            np.concatenate([made.on for made in self._made]),
        )
