"""Lens distortion in OpenCV's notation: Brown and Conrady's model, and that of fisheye lenses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from posse_core._arrays import FloatArray

DistortionModel = Literal["brown-conrady", "fisheye"]
"""The models' names in files."""
LARGEST_TANGENT: Final = 10.0
"""Limit of the directions, as the tangent of their angle from the axis: 84 degrees."""
_STEPS = 50
"""Maximum number of Newton steps; a typical lens needs four or five."""
_LAST_STEP_ERROR = 1e-9
"""If the error before a step is below this, the step is the last, because a step squares the error."""
_INVERSION_ERROR_SHARE = 1e-12
"""Relative tolerance of the inversion."""
_BLOCK = 1 << 14
"""Number of points processed at once; their arrays fit into the processor's cache."""


class Distortion(ABC):
    """Lens distortion: it maps a pinhole's image point (x, y) = (X/Z, Y/Z) to that of the lens, (x',
    y').

    A calibrated function is a fit within the image. Farther out it may fold over and map two directions
    to one point. The Jacobian of every model here is symmetric, so the mapping is one-to-one in any
    convex region where the Jacobian is positive definite. :attr:`reach` is the radius of the largest
    such disc about the axis; outside it all functions return NaN, as for points behind the camera.
    """

    model: DistortionModel

    @property
    @abstractmethod
    def coefficients(self) -> FloatArray:
        """(n,) coefficients in OpenCV's order."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Radius r about the axis within which the mapping is one-to-one; at most 10."""

    @abstractmethod
    def jacobian(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """∂x'/∂x, ∂x'/∂y = ∂y'/∂x and ∂y'/∂y at the pinhole's image point, any shape."""

    @abstractmethod
    def _mapped(self, x: FloatArray, y: FloatArray, r2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The lens's image point of a pinhole's; ``r2`` is x² + y², NaN beyond the reach."""

    def distort(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The pinhole's image point → the lens's, any shape; NaN beyond :attr:`reach`."""
        r2 = x * x + y * y
        return self._mapped(x, y, np.where(r2 <= self.reach**2, r2, np.nan))

    @property
    def image_radius(self) -> float:
        """Largest distance from the principal point that directions within :attr:`reach` are mapped to,
        in focal lengths."""
        turn = np.linspace(0.0, 2.0 * np.pi, 65)
        x, y = self._limited(2 * self.reach * np.cos(turn), 2 * self.reach * np.sin(turn))
        return float(np.max(np.hypot(*self.distort(x, y))))

    def undistort(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The lens's image point → the pinhole's, any shape, by Newton's method in float64.

        The result is NaN where no direction within :attr:`reach` is mapped to the point.
        """
        x, y = np.broadcast_arrays(x, y)
        found = np.empty((2, x.size))
        for start in range(0, x.size, _BLOCK):
            block = slice(start, start + _BLOCK)
            found[:, block] = self._undistorted(x.reshape(-1)[block], y.reshape(-1)[block])
        return found[0].reshape(x.shape), found[1].reshape(x.shape)

    def _undistorted(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """As :meth:`undistort`: (N,) each → (2, N)."""
        radius, image = self._rings
        away = np.hypot(x, y)
        first = np.interp(away, image, radius) / np.maximum(away, 1e-300)
        at_x, at_y = first * x, first * y
        for _ in range(_STEPS):
            got_x, got_y = self.distort(at_x, at_y)
            off_x, off_y = x - got_x, y - got_y
            xx, xy, yy = self.jacobian(at_x, at_y)
            area = np.maximum(xx * yy - xy * xy, 1e-9)
            step_x, step_y = (yy * off_x - xy * off_y) / area, (xx * off_y - xy * off_x) / area
            at_x, at_y = self._limited(at_x + step_x, at_y + step_y)
            if np.abs(off_x).max() < _LAST_STEP_ERROR and np.abs(off_y).max() < _LAST_STEP_ERROR:
                break
        got_x, got_y = self.distort(at_x, at_y)
        found = np.hypot(got_x - x, got_y - y) <= _INVERSION_ERROR_SHARE * (1.0 + np.hypot(x, y))
        return np.where(found, [at_x, at_y], np.nan)

    @cached_property
    def _rings(self) -> tuple[FloatArray, FloatArray]:
        """(n,) radii about the axis, and (n,) the mean radii that the two directions along x are mapped
        to; both are increasing."""
        radius = np.linspace(0.0, self.reach * (1.0 - 1e-12), 513)
        (right, _), (left, _) = (self.distort(x, np.zeros(513)) for x in (radius, -radius))
        return radius, (right - left) / 2

    def _limited(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points, moved radially to the rim of the disc of :attr:`reach` if they lie outside it."""
        scale = np.minimum(1.0, self.reach * (1.0 - 1e-12) / np.maximum(np.hypot(x, y), 1e-300))
        return x * scale, y * scale


@dataclass(frozen=True)
class BrownConrady(Distortion):
    """Brown and Conrady's model, with the denominator that OpenCV calls rational.

    With r² = x² + y² (Brown 1971; OpenCV's ``calib3d``, eight coefficients; Claus and Fitzgibbon 2005
    for the denominator)::

        L  = (1 + k₁ r² + k₂ r⁴ + k₃ r⁶) / (1 + k₄ r² + k₅ r⁴ + k₆ r⁶)
        x' = x L + 2 p₁ x y + p₂ (r² + 2 x²)
        y' = y L + p₁ (r² + 2 y²) + 2 p₂ x y

    Attributes:
        k1, k2, p1, p2, k3, k4, k5, k6: the coefficients, in OpenCV's order.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0

    model = "brown-conrady"

    @property
    def is_rational(self) -> bool:
        """Whether the denominator is other than 1."""
        return any((self.k4, self.k5, self.k6))

    @property
    def coefficients(self) -> FloatArray:
        """(5,) k₁, k₂, p₁, p₂, k₃, or (8,) with k₄, k₅, k₆ if one of these is not 0."""
        return np.array(astuple(self)[: 8 if self.is_rational else 5], dtype=np.float64)

    @cached_property
    def reach(self) -> float:
        """Radius r about the axis within which the mapping is one-to-one; at most 10.

        The eigenvalues of the Jacobian are at least those of its radial part, d(r L)/dr and L, minus
        6 r times the norm of p. Both must be positive, and so must the denominator D of L = N/D;
        multiplied by D and D² they are polynomials.
        """
        N, D = np.zeros(7), np.zeros(7)
        N[::2] = 1.0, self.k1, self.k2, self.k3
        D[::2] = 1.0, self.k4, self.k5, self.k6
        powers = np.arange(7)
        tilt = np.array([0.0, 6.0 * float(np.hypot(self.p1, self.p2))])
        around = _minus(N, np.convolve(tilt, D))
        slope = _minus(np.convolve(powers * N, D), np.convolve(N, powers * D))
        outward = np.convolve(N, D) + slope
        roots = [_first_root(D), _first_root(around)]
        roots.append(_first_root(_minus(outward, np.convolve(tilt, np.convolve(D, D)))))
        return min(LARGEST_TANGENT, *roots)

    def _mapped(self, x: FloatArray, y: FloatArray, r2: FloatArray) -> tuple[FloatArray, FloatArray]:
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        if self.is_rational:
            radial = radial / (1.0 + r2 * (self.k4 + r2 * (self.k5 + r2 * self.k6)))
        cross = 2.0 * x * y
        return (
            x * radial + self.p1 * cross + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + self.p2 * cross,
        )

    def jacobian(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        r2 = x * x + y * y
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + r2 * 3.0 * self.k3))
        if self.is_rational:
            below = 1.0 + r2 * (self.k4 + r2 * (self.k5 + r2 * self.k6))
            radial = radial / below
            steeper = 2.0 * (self.k4 + r2 * (2.0 * self.k5 + r2 * 3.0 * self.k6))
            slope = (slope - radial * steeper) / below
        xx = radial + slope * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
        xy = slope * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y
        yy = radial + slope * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
        return xx, xy, yy


@dataclass(frozen=True)
class Fisheye(Distortion):
    """The model of OpenCV's ``fisheye``, which Kalibr and ROS call equidistant.

    With the angle θ from the axis, tan² θ = x² + y² (Kannala and Brandt 2006, eq. 6)::

        θ' = θ (1 + k₁ θ² + k₂ θ⁴ + k₃ θ⁶ + k₄ θ⁸)
        (x', y') = (x, y) θ' / tan θ

    Directions are those of a pinhole, so the field of view is below 180 degrees: up to :attr:`reach`.

    Attributes:
        k1, k2, k3, k4: the coefficients; all 0 for an equidistant projection.
    """

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    model = "fisheye"

    @property
    def coefficients(self) -> FloatArray:
        """(4,) k₁, k₂, k₃, k₄."""
        return np.array(astuple(self), dtype=np.float64)

    @cached_property
    def reach(self) -> float:
        """Radius r = tan θ within which the mapping is one-to-one, dθ'/dθ > 0; at most 10."""
        slope = np.zeros(9)
        slope[::2] = np.arange(1, 10, 2) * [1.0, self.k1, self.k2, self.k3, self.k4]
        theta = min(_first_root(slope), np.arctan(LARGEST_TANGENT))
        return min(LARGEST_TANGENT, float(np.tan(theta)))

    def _mapped(self, x: FloatArray, y: FloatArray, r2: FloatArray) -> tuple[FloatArray, FloatArray]:
        ratio, _ = self._ratio_and_slope(r2)
        return x * ratio, y * ratio

    def jacobian(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        r2 = x * x + y * y
        ratio, slope = self._ratio_and_slope(r2)
        # The slope of θ'/r along r, divided by r; its error grows as 1/r², but is multiplied by r².
        bend = (slope - ratio) / np.maximum(r2, 1e-300)
        return ratio + bend * x * x, bend * x * y, ratio + bend * y * y

    def _ratio_and_slope(self, r2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """θ'/r and dθ'/dr at r², any shape."""
        r = np.sqrt(r2)
        theta = np.arctan(r)
        t2 = theta * theta
        factor = 1.0 + t2 * (self.k1 + t2 * (self.k2 + t2 * (self.k3 + t2 * self.k4)))
        steep = 1.0 + t2 * (
            3.0 * self.k1 + t2 * (5.0 * self.k2 + t2 * (7.0 * self.k3 + t2 * 9.0 * self.k4))
        )
        share = np.where(r > 0.0, theta / np.maximum(r, 1e-300), 1.0)
        return share * factor, steep / (1.0 + r2)


def distortion_of(model: DistortionModel, coefficients: Sequence[float]) -> Distortion | None:
    """The distortion of a model with its coefficients in OpenCV's order; None if there is none.

    Brown and Conrady's has 4, 5 or 8 coefficients, or none; OpenCV's further ones, for thin prisms and a
    tilted sensor, must be 0. The fisheye's has 4.

    Raises:
        ValueError: the coefficients are not those of the model.
    """
    if model == "fisheye":
        if len(coefficients) != 4:
            raise ValueError(f"a fisheye has 4 coefficients, not {len(coefficients)}")
        return Fisheye(*coefficients)
    if any(coefficients[8:]):
        raise ValueError(
            "has more than the eight coefficients of Brown and Conrady's model with OpenCV's"
            " denominator: thin prisms and a tilted sensor are not modelled"
        )
    if len(coefficients) not in (0, 4, 5, 8, 12, 14):
        raise ValueError(
            f"Brown and Conrady's model has 4, 5 or 8 coefficients, not {len(coefficients)}"
        )
    return BrownConrady(*coefficients[:8]) if any(coefficients) else None


def _first_root(polynomial: FloatArray) -> float:
    """The least positive root of a polynomial, (n,) coefficients from the constant 1 upwards; infinite
    if there is none.

    Roots of the reversed polynomial are its reciprocals; its leading coefficient is 1, so they are well
    conditioned however small the others are.
    """
    found = np.roots(polynomial)
    real = found.real[np.abs(found.imag) < 1e-9 * (1 + np.abs(found))]
    return float(1 / real.max()) if np.any(real > 0) else np.inf


def _minus(a: FloatArray, b: FloatArray) -> FloatArray:
    """The difference of two polynomials, coefficients from the constant upwards."""
    return np.pad(a, (0, max(0, len(b) - len(a)))) - np.pad(b, (0, max(0, len(a) - len(b))))
