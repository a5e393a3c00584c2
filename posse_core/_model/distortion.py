"""The lens distortion model of Brown and Conrady, in OpenCV's notation."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from functools import cached_property

import numpy as np

from posse_core._arrays import FloatArray

_STEPS = 50
"""Maximum number of Newton steps; a typical lens needs four or five."""
_LARGEST_TANGENT = 10.0
"""Limit of the directions, as the tangent of their angle from the axis: 84 degrees."""
_NO_COEFFICIENT = 1e-12
"""Polynomial coefficients below this are treated as 0."""
_LAST_STEP_ERROR = 1e-9
"""If the error before a step is below this, the step is the last, because a step squares the error."""
_INVERSION_ERROR_SHARE = 1e-12
"""Relative tolerance of the inversion."""
_BLOCK = 1 << 14
"""Number of points processed at once; their arrays fit into the processor's cache."""


@dataclass(frozen=True)
class BrownConrady:
    """Lens distortion: it maps a pinhole's image point (x, y) = (X/Z, Y/Z) to that of the lens, (x',
    y').

    With r² = x² + y² (Brown 1971; OpenCV's ``calib3d``, five coefficients)::

        x' = x (1 + k₁ r² + k₂ r⁴ + k₃ r⁶) + 2 p₁ x y + p₂ (r² + 2 x²)
        y' = y (1 + k₁ r² + k₂ r⁴ + k₃ r⁶) + p₁ (r² + 2 y²) + 2 p₂ x y

    The polynomial is a fit within the image. Farther out it may fold over and map two directions to one
    point. Its Jacobian is symmetric, so the mapping is one-to-one in any convex region where the
    Jacobian is positive definite. :attr:`reach` is the radius of the largest such disc about the axis;
    outside it all functions return NaN, as for points behind the camera.

    Attributes:
        k1, k2, p1, p2, k3: the coefficients, in OpenCV's order.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    def coefficients(self) -> FloatArray:
        """(5,) k₁, k₂, p₁, p₂, k₃."""
        return np.array(astuple(self), dtype=np.float64)

    @cached_property
    def reach(self) -> float:
        """Radius r about the axis within which the mapping is one-to-one; at most 10.

        With L = 1 + k₁ r² + k₂ r⁴ + k₃ r⁶, the eigenvalues of the Jacobian are at least those of its
        radial part, d(r L)/dr and L, minus 6 |p| r.
        """
        tilt = -6.0 * float(np.hypot(self.p1, self.p2))
        roots = []
        for a, b, c in ((1.0, 1.0, 1.0), (3.0, 5.0, 7.0)):
            polynomial = [c * self.k3, 0.0, b * self.k2, 0.0, a * self.k1, tilt, 1.0]
            found = np.roots([0.0 if abs(term) < _NO_COEFFICIENT else term for term in polynomial])
            real = found.real[np.abs(found.imag) < 1e-9 * (1 + np.abs(found))]
            roots += real[real > 0].tolist()
        return float(min([_LARGEST_TANGENT, *roots]))

    @property
    def image_radius(self) -> float:
        """Largest distance from the principal point that directions within :attr:`reach` are mapped to,
        in focal lengths."""
        turn = np.linspace(0.0, 2.0 * np.pi, 65)
        x, y = self._limited(2 * self.reach * np.cos(turn), 2 * self.reach * np.sin(turn))
        return float(np.max(np.hypot(*self.distort(x, y))))

    def distort(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The pinhole's image point → the lens's, any shape; NaN beyond :attr:`reach`."""
        r2 = x * x + y * y
        r2 = np.where(r2 <= self.reach**2, r2, np.nan)
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        cross = 2.0 * x * y
        return (
            x * radial + self.p1 * cross + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + self.p2 * cross,
        )

    def jacobian(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """∂x'/∂x, ∂x'/∂y = ∂y'/∂x and ∂y'/∂y at the pinhole's image point, any shape."""
        r2 = x * x + y * y
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + r2 * 3.0 * self.k3))
        xx = radial + slope * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
        xy = slope * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y
        yy = radial + slope * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
        return xx, xy, yy

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
        """(n,) radii about the axis, and (n,) the radii that they are mapped to without p₁ and p₂; both
        are increasing."""
        radius = np.linspace(0.0, self.reach * (1.0 - 1e-12), 513)
        r2 = radius**2
        return radius, radius * (1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3)))

    def _limited(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points, moved radially to the rim of the disc of :attr:`reach` if they lie outside it."""
        scale = np.minimum(1.0, self.reach * (1.0 - 1e-12) / np.maximum(np.hypot(x, y), 1e-300))
        return x * scale, y * scale
