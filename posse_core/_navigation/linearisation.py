"""How a filter carries a Gaussian belief through a function: by tangents, or by sigma points.

Both give a function of the errors as a linear one plus an excess of noise, f(δ) ≈ value + jacobian · δ
with the covariance ``excess`` of what is left over. For tangents the excess is zero, and the filter is
the extended Kalman filter. With sigma points it is statistical linear regression, and the filter is
algebraically the unscented Kalman filter (Lefebvre, Bruyninckx and De Schutter 2002, IEEE Trans.
Automatic Control 47, 1406); states that enter linearly, such as biases, need no points of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular

from posse_core._arrays import FloatArray
from posse_core._navigation.dynamics import Dynamics, Flow, Instant
from posse_core._navigation.kinematics import SIZE, Kinematics, has_attitude


class Reading(Protocol):
    """A reading that is compared with a motion."""

    def residual(self, x: Kinematics) -> FloatArray:
        """(..., m) what the motion predicts minus what was read."""

    def jacobian(self, x: Kinematics) -> FloatArray:
        """(m, 12) derivative of the residual by the errors of one motion."""


@dataclass(frozen=True)
class Linear:
    """A function of the errors, made linear.

    Attributes:
        value: (m,) its mean.
        jacobian: (m, 12) its slope.
        excess: (m, m) covariance of what the linear function leaves out.
    """

    value: FloatArray
    jacobian: FloatArray
    excess: FloatArray


class Linearisation(Protocol):
    """Makes the flow of time and a reading's residual linear about a belief."""

    def flow(
        self,
        dynamics: Dynamics,
        at: Instant,
        x: Kinematics,
        covariance: FloatArray,
        t_s: float,
        noise_scales: tuple[float, float],
    ) -> Flow:
        """The motion at ``t_s``; its noise includes the excess."""

    def reading(self, reading: Reading, x: Kinematics, covariance: FloatArray) -> Linear:
        """The reading's residual as a function of the errors of ``x``."""


class Tangents:
    """Linear by derivatives at the mean."""

    def flow(
        self,
        dynamics: Dynamics,
        at: Instant,
        x: Kinematics,
        covariance: FloatArray,
        t_s: float,
        noise_scales: tuple[float, float],
    ) -> Flow:
        return dynamics.flow(at, x, t_s, noise_scales)

    def reading(self, reading: Reading, x: Kinematics, covariance: FloatArray) -> Linear:
        value = reading.residual(x)
        return Linear(value, reading.jacobian(x), np.zeros((len(value), len(value))))


class SigmaPoints:
    """Linear by regression over 24 points, of equal weights, at √12 standard deviations from the mean.

    They are those of the unscented transform with κ = 0 (Julier and Uhlmann 2004, Proc. IEEE 92, 401),
    so no weight is negative. The errors of the attitude are rotation vectors.
    """

    def flow(
        self,
        dynamics: Dynamics,
        at: Instant,
        x: Kinematics,
        covariance: FloatArray,
        t_s: float,
        noise_scales: tuple[float, float],
    ) -> Flow:
        middle = dynamics.flow(at, x, t_s, noise_scales)
        if not has_attitude(middle.transition @ covariance @ middle.transition.T):
            return middle

        def errors(before: FloatArray) -> FloatArray:
            return dynamics.moved(at, x.plus(before), t_s).minus(middle.x)

        linear = _regression(errors, covariance)
        return replace(
            middle,
            x=middle.x.plus(linear.value),
            transition=linear.jacobian,
            noise=middle.noise + linear.excess,
        )

    def reading(self, reading: Reading, x: Kinematics, covariance: FloatArray) -> Linear:
        return _regression(lambda errors: reading.residual(x.plus(errors)), covariance)


def _regression(function: Callable[[FloatArray], FloatArray], covariance: FloatArray) -> Linear:
    """Regress a function of errors, (N, 12) → (N, m), over the sigma points of a covariance (12, 12)."""
    root = np.linalg.cholesky(covariance)
    arms = np.sqrt(SIZE) * root.T
    values = function(np.concatenate([arms, -arms]))
    mean = values.mean(axis=0)
    slopes = (values[:SIZE] - values[SIZE:]) / (2 * np.sqrt(SIZE))
    # Where part of a target is behind the camera the residual is NaN, and so is the result.
    jacobian = solve_triangular(root, slopes, lower=True, trans="T", check_finite=False).T
    left = values - mean - np.concatenate([arms, -arms]) @ jacobian.T
    return Linear(mean, jacobian, left.T @ left / len(left))
