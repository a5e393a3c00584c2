"""Shot noise of an event camera's pixels: a Poisson process whose rate falls with the light.

Events of both polarities together come at the rate R ((c − 1) Y + 1) in a pixel of brightness Y, half of
them ON, with c = 0.25 (v2e: Hu, Liu, Delbruck 2021). They are drawn by thinning (Lewis, Shedler 1979):
candidates come at the constant rate R, and one happens with the probability that the brightness at its
instant gives. So they depend on the light alone, and not on the instants at which it is computed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray

BRIGHT_SHARE = 0.25
"""Rate at brightness 1, relative to that in the dark (v2e)."""


@dataclass(frozen=True)
class Noise:
    """Candidates of events by shot noise, ascending in time.

    Attributes:
        t_s: (C,) times.
        pixel: (C,) pixels, row by row.
        on: (C,) whether the event is ON.
        mark: (C,) numbers from 0 to 1: the event happens if its rate's share of R is greater.
    """

    t_s: FloatArray
    pixel: IntArray
    on: BoolArray
    mark: FloatArray

    @classmethod
    def drawn(cls, random: np.random.Generator, rate_hz: float, pixels: int, duration_s: float) -> Noise:
        """Candidates of all pixels from 0 to ``duration_s``; ``rate_hz`` is that of one in the dark."""
        count = random.poisson(rate_hz * pixels * duration_s)
        return cls(
            t_s=np.sort(random.uniform(0.0, duration_s, count)),
            pixel=random.integers(pixels, size=count),
            on=random.random(count) < 0.5,
            mark=random.random(count),
        )

    def between(self, after_s: float, until_s: float) -> Noise:
        """Those after one instant, and until or at another."""
        first, end = np.searchsorted(self.t_s, [after_s, until_s], side="right")
        return self._of(slice(first, end))

    def rounds(self) -> Iterator[Noise]:
        """Parts in which a pixel occurs once at most; its first is in the first part, and so on."""
        by_pixel = np.argsort(self.pixel, kind="stable")
        _, starts, counts = np.unique(self.pixel[by_pixel], return_index=True, return_counts=True)
        rank = np.empty(len(by_pixel), dtype=np.int64)
        rank[by_pixel] = np.arange(len(by_pixel)) - np.repeat(starts, counts)
        for number in range(rank.max(initial=-1) + 1):
            yield self._of(rank == number)

    def happens(self, brightness: FloatArray) -> BoolArray:
        """(C,) brightness of each pixel at its instant, 0 … 1 → whether the event happens."""
        return self.mark < (BRIGHT_SHARE - 1) * brightness + 1

    def _of(self, chosen: AnyArray | slice) -> Noise:
        return Noise(self.t_s[chosen], self.pixel[chosen], self.on[chosen], self.mark[chosen])
