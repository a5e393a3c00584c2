"""Random numbers of the compiled variants' samples. A variant must be set before this module is
imported.

They are computed from the pixel, the sample and the segment of the path by a hash, so that a kernel
keeps no state of them. Over the samples of a pixel they fill the unit square evenly: their first digits,
base 2, are those of a Hammersley set. Each pixel and segment takes the set in another random order, and
with some digits of y changed at random. The digits after the first ones are random.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

_HALF, _MASK = 16, 0xFFFF
"""A hashed word of 32 digits, base 2, is cut into two halves of so many. Each gives the digits of a
number after the first ones."""
_ORDERS = 0x9E3779B9
"""A number that no sample has."""


@dataclass
class Numbers:
    """The random numbers of one segment of each sample's path.

    Attributes:
        light: in the unit square, for the point of the Sun's disc; of segment 0 for the place in the
            pixel.
        scattered: in the unit square, for the direction in which the path goes on, and that to the sky,
            which are terms of one sum.
        choice: 0 … 1, for whether facets or the base scatter the path.
        roulette: 0 … 1, for whether the path goes on. It is not spread evenly.
    """

    light: mi.Point2f
    scattered: mi.Point2f
    choice: mi.Float
    roulette: mi.Float


@dataclass
class Strata:
    """The samples of some pixels, 2 to the power of ``digits`` in each.

    Attributes:
        pixel: of each sample, a random integer that all samples of its pixel share.
        sample: of each sample, its number in its pixel, from 0.
        digits: number of the first digits, by which samples are spread.
    """

    pixel: mi.UInt32
    sample: mi.UInt32
    digits: int

    def numbers(self, segment: Any) -> Numbers:
        """The random numbers of a segment: 0 is the camera's ray, and k what happens at the k-th surface
        that a path hits."""
        orders = _hashed(self.pixel, segment, _ORDERS)
        words = _hashed(self.pixel, segment, self.sample)
        low, high = words & _MASK, words >> _HALF
        return Numbers(
            light=self._point(orders.x, low.x, high.x),
            scattered=self._point(orders.y, low.y, high.y),
            choice=self._number(self._place(orders.z), low.z),
            roulette=mi.Float(high.z) * 2.0**-_HALF,
        )

    def _point(self, order: Any, rest_x: Any, rest_y: Any) -> Any:
        place = self._place(order)
        mirrored: Any = dr.brev(place) >> (32 - self.digits) if self.digits else place
        changed = mirrored ^ (order >> 20 & self._last)
        return mi.Point2f(self._number(place, rest_x), self._number(changed, rest_y))

    def _number(self, first: Any, rest: Any) -> Any:
        return mi.Float(first << _HALF | rest) * 2.0 ** -(self.digits + _HALF)

    def _place(self, order: Any) -> Any:
        """The sample's place in an order of the samples. No step makes two places one."""
        place: Any = self.sample ^ (order & self._last)
        place = place * (order >> 5 | 1) & self._last
        place ^= place >> 2
        place = place * (order >> 10 | 1) & self._last
        return place ^ place >> 3

    @property
    def _last(self) -> int:
        return (1 << self.digits) - 1


def _hashed(*words: Any) -> Any:
    """Three random integers by three: pcg3d of Jarzynski and Olano, Hash functions for GPU rendering,
    JCGT 9 (3), 2020, whose last digits are mixed with the first once more."""
    v: Any = mi.Vector3u(*words) * 1664525 + 1013904223
    for _ in range(2):
        v.x += v.y * v.z
        v.y += v.z * v.x
        v.z += v.x * v.y
        v ^= v >> _HALF
    return v
