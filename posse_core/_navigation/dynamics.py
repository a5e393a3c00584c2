"""The motion between readings: of the target's orbit, of the chaser relative to it, of its attitude.

Positions are integrated in inertial axes, chaser minus target, by Runge and Kutta's classical method,
whose steps are a small part of the time √(r³/μ) in which an orbit turns by a radian at its distance r;
so any eccentricity is served. The equations are those of the propagator ``nonlinear``, and casadi
differentiates the steps themselves. The attitude follows Euler's equations without torque, its rotation
by Magnus' expansion to fourth order (Iserles et al. 2000, Acta Numerica 9, 215): exact at a constant
rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics.nonlinear import ForceModel, equations
from posse_core._dynamics.rows import Rows, dense
from posse_core._dynamics.start import Target
from posse_core._navigation.kinematics import MOTION, SIZE, TURNING, Kinematics
from posse_core._navigation.options import DynamicsOptions

ORBIT_STEP = 0.02
"""Longest step of the orbits, in units of √(r³/μ); the classical method then errs by 3e-11 a step."""
TURN_STEP_RAD = 0.2
"""Longest turn in a step of a body whose rate changes."""


@dataclass(frozen=True)
class Instant:
    """An instant and the target's orbit at it.

    Attributes:
        t_s: seconds since the scenario's epoch.
        r_eci_m, v_eci_m_s: (3,) the target's geocentric position and velocity, GCRF axes.
        plane_turn_rad_s: rate at which its plane turns about R.
    """

    t_s: float
    r_eci_m: FloatArray
    v_eci_m_s: FloatArray
    plane_turn_rad_s: float

    @property
    def rtn_from_eci(self) -> FloatArray:
        """(6, 6) the chaser's relative state from GCRF axes to the target's RTN axes."""
        return frames.relative_rtn_from_eci(self.r_eci_m, self.v_eci_m_s, self.plane_turn_rad_s)

    @property
    def R_eci_from_rtn(self) -> FloatArray:
        """(3, 3) rotation from the target's RTN axes to GCRF axes."""
        return frames.R_eci_from_rtn(self.r_eci_m, self.v_eci_m_s)


@dataclass(frozen=True)
class Flow:
    """What a time does to the motion.

    Attributes:
        at: the instant after it.
        x: the motion then.
        transition: (12, 12) derivative of the errors then by those before.
        noise: (12, 12) covariance of what the process noise adds.
    """

    at: Instant
    x: Kinematics
    transition: FloatArray
    noise: FloatArray


class Dynamics:
    """Moves the target's orbit, the relative motion and the attitude through time.

    Args:
        target: the target's orbit.
        inertia_kg_m2: (3, 3) of the target in body axes, up to a factor; None for a constant rate in
            body axes.
        options: forces and process noise.
    """

    def __init__(
        self, target: Target, inertia_kg_m2: FloatArray | None, options: DynamicsOptions
    ) -> None:
        self._mu = target.mu_m3_s2
        self._step, self._step_and_derivative = _orbit_steps(options.dynamics, target.constants)
        self._tumbling_share = options.tumbling_share
        self._turn = _turn_step(inertia_kg_m2) if inertia_kg_m2 is not None else None
        self._densities = (
            options.acceleration_m_s2_rthz**2,
            math.radians(options.angular_acceleration_deg_s2_rthz) ** 2,
        )
        self._target = target
        self._epoch = self._at(target.t_s, target.r_eci_m, target.v_eci_m_s)

    def instant(self, t_s: float) -> Instant:
        """The target's orbit at an instant."""
        nothing = np.zeros((1, 3))
        return self._moved(self._epoch, nothing, nothing, t_s)[0]

    def flow(
        self, at: Instant, x: Kinematics, t_s: float, noise_scales: tuple[float, float] = (1.0, 1.0)
    ) -> Flow:
        """Move one motion from an instant to ``t_s``, with its derivative and the process noise.

        Args:
            at, x, t_s: from where and until when.
            noise_scales: factors on the process noise of relative motion and attitude.
        """
        motion, turning = np.multiply(self._densities, noise_scales)
        if self._turn is None:
            # A random acceleration of this size that lasts for about a radian.
            rate = float(np.linalg.norm(x.omega_body_rad_s))
            turning += noise_scales[1] * 2 * self._tumbling_share**2 * rate**3
        state = np.concatenate([at.r_eci_m, at.v_eci_m_s, x.dr_eci_m, x.dv_eci_m_s])
        transition, noise = np.eye(SIZE), np.zeros((SIZE, SIZE))
        now_s = at.t_s
        while (h := self._next_step(state[:3], t_s - now_s)) != 0:
            state, by_before = self._step_and_derivative(state, h)
            now_s += h
            transition[MOTION, MOTION] = by_before @ transition[MOTION, MOTION]
            noise[MOTION, MOTION] = by_before @ noise[MOTION, MOTION] @ by_before.T + motion * _doubled(
                h
            )
        R, omega = x.R_eci_from_body, x.omega_body_rad_s
        count, h = self._turn_steps(omega, t_s - at.t_s)
        for _ in range(count):
            phi, omega, phi_by_omega, omega_by_omega = self._turned(omega, h)
            turn = frames.matrix_from_rotation_vector(phi)
            R = R @ turn
            by_before = np.zeros((6, 6))
            by_before[:3, :3] = turn.T
            by_before[:3, 3:] = frames.right_jacobian(phi) @ phi_by_omega
            by_before[3:, 3:] = omega_by_omega
            transition[TURNING, TURNING] = by_before @ transition[TURNING, TURNING]
            noise[TURNING, TURNING] = by_before @ noise[
                TURNING, TURNING
            ] @ by_before.T + turning * _doubled(h)
        r, v, dr, dv = np.split(state, 4)
        return Flow(self._at(t_s, r, v), Kinematics(dr, dv, R, omega), transition, noise)

    def moved(self, at: Instant, x: Kinematics, t_s: float) -> Kinematics:
        """Move N motions, whose arrays have a leading axis, from an instant to ``t_s``."""
        _, dr, dv = self._moved(at, x.dr_eci_m, x.dv_eci_m_s, t_s)
        R, omega = x.R_eci_from_body, x.omega_body_rad_s
        count, h = self._turn_steps(omega, t_s - at.t_s)
        for _ in range(count):
            phi, omega, _, _ = self._turned(omega, h)
            R = R @ frames.matrix_from_rotation_vector(phi)
        return Kinematics(dr, dv, R, omega)

    def _moved(
        self, at: Instant, dr: FloatArray, dv: FloatArray, t_s: float
    ) -> tuple[Instant, FloatArray, FloatArray]:
        chief = np.tile(np.concatenate([at.r_eci_m, at.v_eci_m_s]), (len(dr), 1))
        state = np.concatenate([chief, dr, dv], axis=1)
        now_s = at.t_s
        while (h := self._next_step(state[0, :3], t_s - now_s)) != 0:
            state = self._step(state, h)
            now_s += h
        r, v, dr, dv = np.split(state, 4, axis=1)
        return self._at(t_s, r[0], v[0]), dr, dv

    def _at(self, t_s: float, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> Instant:
        return Instant(t_s, r_eci_m, v_eci_m_s, float(self._target.plane_turn_rad_s(r_eci_m, v_eci_m_s)))

    def _next_step(self, r_m: FloatArray, left_s: float) -> float:
        """The next step of the orbit, of which ``left_s`` is left, either way; 0 at the end."""
        longest = ORBIT_STEP * math.sqrt(float(r_m @ r_m) ** 1.5 / self._mu)
        if abs(left_s) < 1e-9:
            return 0.0
        # Equal steps over what is left, so that no short one comes last.
        return left_s / math.ceil(abs(left_s) / longest)

    def _turn_steps(self, omega: FloatArray, span_s: float) -> tuple[int, float]:
        """Number and length of the attitude's steps."""
        if span_s == 0:
            return 0, 0.0
        if self._turn is None:
            return 1, span_s
        fastest = float(np.max(np.linalg.norm(omega, axis=-1)))
        count = max(1, math.ceil(fastest * abs(span_s) / TURN_STEP_RAD))
        return count, span_s / count

    def _turned(
        self, omega: FloatArray, h: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Rotation vector and rate after a step, and their derivatives by the rate before."""
        if self._turn is None:
            unit = np.eye(3)
            return omega * h, omega, unit * h, unit
        phi, after, phi_by_omega, after_by_omega = self._turn(omega, h)
        return phi, after, phi_by_omega, after_by_omega


def _doubled(h: float) -> FloatArray:
    """(6, 6) covariance of a double integral and its rate over a time, for white noise of density 1."""
    h = abs(h)
    return np.kron(np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]]), np.eye(3))


@lru_cache(maxsize=8)
def _orbit_steps(gravity: Any, constants: Constants) -> tuple[Rows, Rows]:
    """A step (chief r, v; relative dr, dv; h) → the same after it; and with (6, 6) its derivative by the
    relative state."""
    right_side = equations(ForceModel(gravity=gravity), constants)
    state, h = ca.SX.sym("state", 12), ca.SX.sym("h_s")

    def rate(x: Any) -> Any:
        return ca.vertcat(*right_side(*ca.vertsplit(x, 3), 0))

    after = _classical_step(rate, state, h)
    derivative = ca.jacobian(after, state)[6:, 6:]
    arguments = {"state": state, "h_s": h}
    return (
        Rows(lambda: dense("orbit_step", arguments, {"after": after})),
        Rows(lambda: dense("orbit_step_and_derivative", arguments, {"after": after, "by": derivative})),
    )


def _turn_step(inertia_kg_m2: FloatArray) -> Rows:
    """A step (rate, h) → rotation vector, rate after it, and their (3, 3) derivatives by the rate."""
    inertia, inverse = inertia_kg_m2 / np.trace(inertia_kg_m2), np.linalg.inv(inertia_kg_m2)
    inverse *= np.trace(inertia_kg_m2)
    omega, h = ca.SX.sym("omega", 3), ca.SX.sym("h_s")

    def rate(w: Any) -> Any:
        return -ca.mtimes(inverse, ca.cross(w, ca.mtimes(inertia, w)))

    middle, after = _classical_step(rate, omega, h / 2), _classical_step(rate, omega, h)
    # Rotations about body axes multiply on the right, hence the commutator's sign.
    phi = h / 6 * (omega + 4 * middle + after) + h**2 / 12 * ca.cross(omega, after)
    return Rows(
        lambda: dense(
            "turn_step",
            {"omega": omega, "h_s": h},
            {
                "phi": phi,
                "after": after,
                "phi_by_omega": ca.jacobian(phi, omega),
                "after_by_omega": ca.jacobian(after, omega),
            },
        )
    )


def _classical_step(rate: Any, x: Any, h: Any) -> Any:
    """One step of the classical Runge–Kutta method."""
    k1 = rate(x)
    k2 = rate(x + h / 2 * k1)
    k3 = rate(x + h / 2 * k2)
    k4 = rate(x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
