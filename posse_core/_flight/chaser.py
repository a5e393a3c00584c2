"""The true motion of the chaser, and the errors with which it points and fires."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Start, Target
from posse_core._frames import R_with_z, matrix_from_rotation_vector, unit
from posse_core._interfaces.navigator import ThrusterErrors
from posse_core._interfaces.propagator import FlightPropagator, PropagationProblem
from posse_core._randomness import random_generator
from posse_core._scenario.flight import StartErrorsConfig


class Chaser:
    """The chaser's true motion, flown from impulse to impulse."""

    def __init__(self, propagator: FlightPropagator, problem: PropagationProblem, start: Start) -> None:
        self._propagator, self._problem, self._start = propagator, problem, start

    def at(self, t_s: float) -> FloatArray:
        """(6,) position (m) and velocity (m/s) in RTN axes, not before the last impulse."""
        after_s = np.array([t_s - self._start.target.t_s])
        flight = self._propagator.fly(self._problem, self._start, after_s)
        return np.asarray(flight.rtn[0], dtype=np.float64)

    def fire(self, burn: Burn) -> None:
        """Add an impulse.

        Raises:
            InputError: the chaser's orbit would not be one above the Earth any more.
        """
        after_s = np.array([burn.t_s - self._start.target.t_s])
        flight = self._propagator.fly(self._problem, self._start, after_s)
        target = Target(
            flight.r_target_eci_m[0],
            flight.v_target_eci_m_s[0],
            self._problem.constants,
            t_s=burn.t_s,
            where=f"the target at {burn.t_s:g} s",
            turns_plane=self._start.target.turns_plane,
        )
        rtn = flight.rtn[0]
        where = f"the chaser after the impulse at {burn.t_s:g} s"
        self._start = Start.from_rtn(target, rtn[:3], rtn[3:] + burn.dv_rtn_m_s, where=where)


def carried_out(
    dv_m_s: FloatArray, errors: ThrusterErrors, generator: np.random.Generator
) -> FloatArray:
    """The impulse (3,) that thrusters make of a commanded one (3,), in the same axes.

    Its size and its direction have independent Gaussian errors (Gates 1963); one below the least impulse
    is not made.
    """
    size_error, *turn = generator.standard_normal(3)
    size_m_s = float(np.linalg.norm(dv_m_s))
    if size_m_s == 0 or size_m_s < errors.least_m_s:
        return np.zeros(3)
    across = R_with_z(unit(dv_m_s))[:, :2] @ np.array(turn)
    turned = matrix_from_rotation_vector(errors.direction_rad * across) @ dv_m_s
    return np.asarray((1 + errors.size * size_error) * turned)


def disturbed(
    R_eci_from_camera: FloatArray, sigma_rad: float, generator: np.random.Generator
) -> FloatArray:
    """An attitude (3, 3) turned by a small Gaussian error about each camera axis."""
    return np.asarray(
        R_eci_from_camera @ matrix_from_rotation_vector(sigma_rad * generator.standard_normal(3))
    )


def as_known(R_eci_from_camera: FloatArray, sigma_deg: float, seed: int, index: int) -> FloatArray:
    """The camera's attitude (3, 3) at frame ``index`` as the chaser knows it.

    Args:
        sigma_deg: standard deviation of its error about each camera axis.
    """
    generator = random_generator(seed, index, "camera-attitude")
    return disturbed(R_eci_from_camera, float(np.radians(sigma_deg)), generator)


def start_error(sigmas: StartErrorsConfig, seed: int) -> tuple[FloatArray, FloatArray]:
    """The true start minus the one that the chaser expects.

    Returns:
        The error (6,) of position (m) and velocity (m/s), RTN axes, and its standard deviations (6,).
    """
    sigma = np.repeat([sigmas.position_m, sigmas.velocity_m_s], 3)
    return sigma * random_generator(seed, -1, "flight-start").standard_normal(6), sigma
