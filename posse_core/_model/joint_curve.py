"""How a joint moves in an animation: a piecewise polynomial in time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from posse_core._arrays import AnyArray, FloatArray


@dataclass(frozen=True)
class JointCurve:
    """A joint's value over time. Before the first key and after the last it rests.

    Where the polynomials are real, they are the value itself. Where they are complex, the value is twice
    their argument: the real and the imaginary part are those of a quaternion about the joint's axis,
    cos(value/2) and sin(value/2), of any length. A spline through quaternions is such a curve.

    Attributes:
        times_s: (K,) times of the keys, increasing.
        values: (K,) the joint's value at each key, rad or m.
        pieces: (D, K − 1) polynomial from each key to the next in the seconds since the key, the highest
            power first; real or complex.
        end_s: when the animation ends, of which this is one joint's; its own keys may end earlier.
    """

    times_s: FloatArray
    values: FloatArray
    pieces: AnyArray
    end_s: float

    @classmethod
    def steps(cls, times_s: FloatArray, values: FloatArray, end_s: float) -> Self:
        """The curve that keeps each key's value until the next key."""
        return cls(times_s, values, values[None, :-1], end_s)

    @classmethod
    def lines(cls, times_s: FloatArray, values: FloatArray, end_s: float) -> Self:
        """The curve that goes at a constant rate from key to key."""
        rates = np.diff(values) / np.diff(times_s)
        return cls(times_s, values, np.stack([rates, values[:-1]]), end_s)

    @classmethod
    def spline(
        cls,
        times_s: FloatArray,
        points: AnyArray,
        rates_in: AnyArray,
        rates_out: AnyArray,
        values: FloatArray,
        end_s: float,
    ) -> Self:
        """The cubic Hermite spline through points (K,), real or complex, with its derivatives (K,), 1/s,
        before and after each key.

        Source: glTF 2.0 specification, appendix C.5.
        """
        step_s = np.diff(times_s)
        start, end = points[:-1], points[1:]
        leaving, arriving = step_s * rates_out[:-1], step_s * rates_in[1:]
        cubic = 2 * start + leaving - 2 * end + arriving
        square = -3 * start - 2 * leaving + 3 * end - arriving
        pieces = np.stack([cubic / step_s**3, square / step_s**2, leaving / step_s, start])
        return cls(times_s, values, pieces, end_s)

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values (N,), rad or m, and rates (N,), rad/s or m/s, at times (N,) of the animation, s."""
        t_s = np.asarray(t_s, dtype=np.float64)
        first, last = self.times_s[0], self.times_s[-1]
        values = np.where(t_s < first, self.values[0], self.values[-1])
        rates = np.zeros_like(values)
        moves = (t_s >= first) & (t_s < last)
        key = np.searchsorted(self.times_s, t_s[moves], side="right") - 1
        since_s = t_s[moves] - self.times_s[key]
        point = np.zeros(len(key), dtype=self.pieces.dtype)
        slope = np.zeros_like(point)
        for coefficient in self.pieces[:, key]:  # Horner's scheme, with the derivative beside
            slope = slope * since_s + point
            point = point * since_s + coefficient
        if np.iscomplexobj(point):
            values[moves] = self.values[key] + 2 * np.angle(point / self.pieces[-1, key])
            rates[moves] = 2 * (slope / point).imag
        else:
            values[moves], rates[moves] = point, slope
        return values, rates

    @property
    def extremes(self) -> tuple[float, float]:
        """The least and the greatest value."""
        times_s = [self.times_s]
        for start_s, stop_s, piece in zip(self.times_s, self.times_s[1:], self.pieces.T, strict=False):
            slope = np.polyder(piece)
            if np.iscomplexobj(piece):
                slope = np.polymul(slope, piece.conj()).imag
            roots = np.roots(slope)
            turning_s = start_s + roots[np.isreal(roots)].real
            times_s.append(turning_s[(turning_s > start_s) & (turning_s < stop_s)])
        values = np.r_[self.values, self.at(np.concatenate(times_s))[0]]
        return float(values.min()), float(values.max())

    def scaled(self, factor: float) -> Self:
        """The curve of a sliding joint with all lengths multiplied by ``factor``."""
        return replace(self, values=factor * self.values, pieces=factor * self.pieces)
