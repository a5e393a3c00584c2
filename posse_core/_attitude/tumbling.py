"""Torque-free motion of a rigid body in closed form, so that every frame is computed on its own.

The angular velocity follows from Jacobi's elliptic functions (Landau & Lifshitz, Mechanics, 3rd ed.,
section 37). The precession about the angular momentum follows from the elliptic integral of the third
kind in Carlson's symmetric form (Carlson 1995, Numerical Algorithms 10, 13). The solution is valid for
all moments of inertia and angular velocities.

Near a spin about the intermediate axis the motion is unstable, and the rounding of the input decides
when the body flips; a spin exactly about it persists.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from posse_core._arrays import FloatArray
from posse_core._frames import matrix_from_rotation_vector

_STEADY_SINE = 1e-14
"""Sine of the angle between angular velocity and momentum up to which the velocity is constant."""
_LARGEST_ELLIPTIC_PARAMETER = 1 - 2.0**-52
"""Limit of the parameter: on the separatrix (1) the period would be infinite."""


def torque_free_attitude(
    inertia_kg_m2: FloatArray, rate_body_rad_s: FloatArray, R_ref_from_body: FloatArray, t_s: FloatArray
) -> FloatArray:
    """Return the attitude of a free rigid body: (3, 3), (3,), (3, 3), (F,) → (F, 3, 3).

    Args:
        inertia_kg_m2: inertia matrix in body axes, symmetric and positive definite.
        rate_body_rad_s: angular velocity at t_s = 0, body axes.
        R_ref_from_body: attitude at t_s = 0 relative to any inertial axes.
        t_s: seconds, positive or negative.
    """
    momentum = inertia_kg_m2 @ rate_body_rad_s
    speed = np.linalg.norm(rate_body_rad_s)
    skew = np.linalg.norm(np.cross(rate_body_rad_s, momentum))
    if skew <= _STEADY_SINE * speed * np.linalg.norm(momentum):
        return np.asarray(R_ref_from_body @ matrix_from_rotation_vector(t_s[:, None] * rate_body_rad_s))
    moments, R_body_from_w = _circled_axis_last(inertia_kg_m2, rate_body_rad_s)
    motion = _Motion.of(moments, R_body_from_w.T @ rate_body_rad_s)
    R_momentum_from_w = motion.attitude(np.append(0.0, t_s))
    R_ref_from_momentum = R_ref_from_body @ R_body_from_w @ R_momentum_from_w[0].T
    return np.asarray(R_ref_from_momentum @ R_momentum_from_w[1:] @ R_body_from_w.T)


def _circled_axis_last(inertia: FloatArray, rate_body: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return principal moments (3,) and axes (columns of (3, 3), body axes).

    The axes are ordered so that the angular momentum circles the last one.
    """
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    low, middle, high = moments
    w = axes.T @ rate_body
    # The sign of L² − 2T·middle, computed without cancellation.
    if high * (high - middle) * w[2] ** 2 < low * (middle - low) * w[0] ** 2:
        return moments[::-1], axes[:, ::-1] * [1.0, -1.0, 1.0]
    return moments, axes


@dataclass(frozen=True)
class _Motion:
    """Angular velocity (a cn, b sn, c dn)(phase + pace·t, parameter) about principal axes 1, 2, 3."""

    moments: FloatArray
    amplitudes: FloatArray
    pace: float
    parameter: float
    phase: float

    @classmethod
    def of(cls, moments: FloatArray, rate: FloatArray) -> _Motion:
        """Make the motion from the moments, circled axis last, and the angular velocity (3,) at t=0."""
        j1, j2, j3 = moments
        w1, w2, w3 = rate
        ratio = j1 * (j3 - j1) / (j2 * (j3 - j2))
        a = np.sqrt(w1**2 + w2**2 / ratio)
        c = np.copysign(np.sqrt(w3**2 + w2**2 * j2 * (j2 - j1) / (j3 * (j3 - j1))), w3)
        b = np.sign(c * (j3 - j2)) * a * np.sqrt(ratio)
        parameter = (j2 - j1) * j1 * a**2 / ((j3 - j2) * j3 * c**2)
        parameter = min(parameter, _LARGEST_ELLIPTIC_PARAMETER)
        phase = special.ellipkinc(np.arctan2(w2 / b, w1 / a), parameter)
        pace = np.sqrt((j3 - j2) * (j3 - j1) / (j1 * j2)) * abs(c)
        return cls(moments, np.array([a, b, c]), float(pace), float(parameter), float(phase))

    def attitude(self, t_s: FloatArray) -> FloatArray:
        """(F,) → (F, 3, 3): rotation from the principal axes to axes with z along the angular momentum.

        It is composed of Euler angles 3-1-3, of which the first is 0 at phase 0.
        """
        j1, j2, j3 = self.moments
        m = self.parameter
        half_period = special.ellipk(m)
        argument = self.phase + self.pace * t_s
        turns = np.round(argument / (2 * half_period))
        amplitude = special.ellipj(argument - turns * 2 * half_period, m)[3]
        # Odd half periods change the signs of sn and cn.
        sign = np.where(turns % 2 == 0, 1.0, -1.0)
        sn, cn = np.sin(amplitude), np.cos(amplitude)
        dn = np.sqrt(cn**2 + (1 - m) * sn**2)
        momentum = self.moments * self.amplitudes * np.stack([sign * cn, sign * sn, dn], axis=-1)
        x, y, z = momentum.T
        node = np.arctan2(x, y)
        tilt = np.arctan2(np.hypot(x, y), z)

        characteristic = j3 * (j1 - j2) / (j1 * (j3 - j2))
        whole = _elliptic_pi(characteristic, np.pi / 2, m)
        third_kind = 2 * turns * whole + _elliptic_pi(characteristic, amplitude, m)
        length = np.linalg.norm(momentum[0])
        precession = length * (t_s / j3 + (1 / j1 - 1 / j3) / self.pace * third_kind)
        return _about(2, precession) @ _about(0, tilt) @ _about(2, node)


def _elliptic_pi(n: float, amplitude: FloatArray | float, m: float) -> FloatArray:
    """Incomplete integral of the third kind ∫ dφ / ((1 − n sin²φ) √(1 − m sin²φ)), |φ| ≤ π/2."""
    s, cc = np.sin(amplitude), np.cos(amplitude) ** 2
    delta = cc + (1 - m) * s**2
    first = s * special.elliprf(cc, delta, 1.0)
    return np.asarray(first + n / 3 * s**3 * special.elliprj(cc, delta, 1.0, 1 - n * s**2))


def _about(axis: int, angle_rad: FloatArray) -> FloatArray:
    return matrix_from_rotation_vector(angle_rad[:, None] * np.eye(3)[axis])
