"""Propagator ``thesis``: Sections 3.2.1 and 3.2.4 of the POSSE thesis, literally.

It reproduces the published datasets, including their errors: it uses a TLE's mean elements as osculating
ones in GCRF axes, integrates the true anomaly with a fixed step (eq. 3.2) from a series (eq. 3.3), and
uses the ROE map of eq. 2.10 with nt in place of the mean argument of latitude. Where the thesis leaves a
choice open, this implementation decides as follows:

- Eq. 3.2 is integrated by the classical Runge–Kutta method, one step from each time to the next.
- δix and δiy carry over from one relative orbit to the next
  (:func:`posse_core._dynamics.design.algorithm_3_1`).
- Frames run k = 0 … N for each of the H relative orbits: (N+1)·H frames, orbit by orbit.
- Sizes are given in metres (``relative.roe_m``, a times the thesis' δα).
"""

from __future__ import annotations

import math

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.design import algorithm_3_1
from posse_core._dynamics.elements import keplerian_from_state
from posse_core._dynamics.tle import Tle
from posse_core._errors import InputError
from posse_core._frames import R_eci_from_perifocal
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion
from posse_core._propagators.options import ThesisOptions


class ThesisPropagator(Propagator[ThesisOptions]):
    """Propagates H relative orbits of N instants each (Algorithm 3.1)."""

    def propagate(self, problem: PropagationProblem) -> Motion:
        first_m = _initial_roe_m(problem)
        t_s = np.asarray(problem.t_s, dtype=np.float64)
        mu = problem.constants.mu_earth_m3_s2
        a, e, i, raan, argp, mean_anomaly = _elements(problem)
        true_anomaly = integrate_true_anomaly(
            series_true_anomaly(mean_anomaly, e), e, math.sqrt(mu / a**3), t_s
        )
        r_target, v_target = perifocal_state(a, e, true_anomaly, mu)
        R = R_eci_from_perifocal(raan, i, argp)
        orbits_m = algorithm_3_1(first_m, self.options.relative_orbits)
        states = np.einsum("kij,hj->hki", roe_to_rtn(math.sqrt(mu / a**3), t_s), orbits_m)
        count, times = len(orbits_m), len(t_s)
        flat = states.reshape(-1, 6)
        return Motion(
            t_s=np.tile(t_s, count),
            r_target_eci_m=np.tile(r_target @ R.T, (count, 1)),
            v_target_eci_m_s=np.tile(v_target @ R.T, (count, 1)),
            r_chaser_rtn_m=flat[:, :3],
            v_chaser_rtn_m_s=flat[:, 3:],
            sequence=np.repeat(np.arange(count), times),
        )


def series_true_anomaly(mean_anomaly_rad: float, e: float) -> float:
    """Eq. 3.3: true anomaly from the mean anomaly to order e³; the error is 70° at e = 0.9."""
    M = mean_anomaly_rad
    return (
        M
        + (2 * e - 0.25 * e**3) * math.sin(M)
        + 1.25 * e**2 * math.sin(2 * M)
        + 13 / 12 * e**3 * math.sin(3 * M)
    )


def integrate_true_anomaly(
    start_rad: float, e: float, mean_motion_rad_s: float, t_s: FloatArray
) -> FloatArray:
    """Integrate eq. 3.2 from ``start_rad`` at t = 0, one Runge–Kutta step per time; (K,) → (K,)."""

    def rate(anomaly: float) -> float:
        return float(mean_motion_rad_s * (1 + e * math.cos(anomaly)) ** 2 / (1 - e**2) ** 1.5)

    out = np.empty(len(t_s))
    anomaly, t = start_rad, 0.0
    for k, t_next in enumerate(t_s):
        h = float(t_next) - t
        k1 = rate(anomaly)
        k2 = rate(anomaly + h / 2 * k1)
        k3 = rate(anomaly + h / 2 * k2)
        k4 = rate(anomaly + h * k3)
        anomaly += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        t = float(t_next)
        out[k] = anomaly
    return out


def perifocal_state(
    a_m: float, e: float, true_anomaly_rad: FloatArray, mu_m3_s2: float
) -> tuple[FloatArray, FloatArray]:
    """Section 3.2.1: perifocal position (m) and velocity (m/s), (K,) → (K, 3) each."""
    p = a_m * (1 - e**2)
    cos, sin, zero = np.cos(true_anomaly_rad), np.sin(true_anomaly_rad), 0 * true_anomaly_rad
    r = p / (1 + e * cos)
    r_m = np.stack([r * cos, r * sin, zero], axis=-1)
    v_m_s = math.sqrt(mu_m3_s2 / p) * np.stack([-sin, e + cos, zero], axis=-1)
    return r_m, v_m_s


def roe_to_rtn(mean_motion_rad_s: float, t_s: FloatArray) -> FloatArray:
    """Eq. 2.10: (K, 6, 6), a·δα (m) → RTN position (m) and velocity (m/s)."""
    n = mean_motion_rad_s
    c, s = np.cos(n * t_s), np.sin(n * t_s)
    T = np.zeros((len(t_s), 6, 6))
    T[:, 0, 0], T[:, 0, 2], T[:, 0, 3] = 1, -c, -s
    T[:, 1, 1], T[:, 1, 2], T[:, 1, 3] = 1, 2 * s, -2 * c
    T[:, 2, 4], T[:, 2, 5] = s, -c
    T[:, 3, 2], T[:, 3, 3] = n * s, -n * c
    T[:, 4, 0], T[:, 4, 2], T[:, 4, 3] = -1.5 * n, 2 * n * c, 2 * n * s
    T[:, 5, 4], T[:, 5, 5] = n * c, n * s
    return T


def _elements(problem: PropagationProblem) -> tuple[float, float, float, float, float, float]:
    """a, e, i, Ω, ω, M: the mean elements of a TLE unchanged, or else the osculating elements."""
    mu = problem.constants.mu_earth_m3_s2
    if problem.tle is None:
        state = (problem.target.r_eci_m, problem.target.v_eci_m_s)
        a, e, i, raan, argp, M = keplerian_from_state(*state, mu).tolist()
        return a, e, i, raan, argp, M
    m = Tle(problem.tle).mean
    a = (mu / m.mean_motion_rad_s**2) ** (1 / 3)
    return a, m.e, m.i_rad, m.raan_rad, m.argp_rad, m.mean_anomaly_rad


def _initial_roe_m(problem: PropagationProblem) -> FloatArray:
    """(6,) a·δα of the problem's single natural relative orbit.

    Raises:
        InputError: The problem has impulses, has no such orbit, or its δa or δλ is not 0.
    """
    if problem.burns:
        raise InputError("relative.plan: propagator thesis has no manoeuvres; use propagator roe")
    if problem.forced is not None or len(problem.starts) != 1:
        raise InputError("propagator thesis starts from relative.roe_m; give it, or use propagator roe")
    roe_m = problem.starts[0].roe_m
    if roe_m[0] != 0 or roe_m[1] != 0:
        raise InputError(
            "propagator thesis starts from relative.roe_m, and Algorithm 3.1 has δa = δλ = 0; set its"
            " first two numbers to 0, or use propagator roe"
        )
    return roe_m
