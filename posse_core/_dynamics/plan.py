"""Impulsive manoeuvres that reach wanted ROE, and what they cost.

Near-circular orbits (e < 0.01): three tangential impulses and one normal one, in closed form (Gaias
and D'Amico 2015, J. Guidance 38, 1036), the instants chosen by enumeration; the least possible cost
by the reachable sets of Chernick and D'Amico (2018), J. Guidance 41, 1969. Others: a linear programme
over the instants of the window, with the exact map for any eccentricity.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.elements import later
from posse_core._dynamics.linear import any_eccentricity_map
from posse_core._errors import InputError

NEAR_CIRCULAR_E = 0.01
_INSTANTS = 181
_MOST_INSTANTS = 120
_NEGLIGIBLE_M_S = 1e-9
_SAME_INSTANT_S = 1e-6


@dataclass(frozen=True)
class Burn:
    """One impulse: seconds after the epoch, change of velocity (3,) in the target's RTN axes."""

    t_s: float
    dv_rtn_m_s: FloatArray


@dataclass(frozen=True)
class Transfer:
    """Impulses in order of time.

    Attributes:
        burns: the impulses.
        least_dv_m_s: lower bound of the cost of any plan in the window, to first order.
    """

    burns: tuple[Burn, ...]
    least_dv_m_s: float

    @property
    def dv_m_s(self) -> float:
        """Sum of the magnitudes of the impulses."""
        return float(sum(np.linalg.norm(burn.dv_rtn_m_s) for burn in self.burns))


def transfer(
    chief_qns: FloatArray,
    from_roe: FloatArray,
    to_roe: FloatArray,
    window_s: tuple[float, float],
    mu_m3_s2: float,
) -> Transfer:
    """Impulses that take the chaser from ROE at t = 0 to ROE at the window's end.

    Args:
        chief_qns: (6,) at t = 0.
        from_roe, to_roe: (6,) dimensionless quasi-nonsingular.
        window_s: first and last instant of an impulse; ``to_roe`` holds at the last.

    Raises:
        InputError: The window is too short for the impulses that are needed, or too long to be searched.
    """
    n = math.sqrt(mu_m3_s2 / chief_qns[0] ** 3)
    arrival = np.array(from_roe)
    arrival[1] -= 1.5 * n * window_s[1] * from_roe[0]
    wanted = np.asarray(to_roe) - arrival
    if math.hypot(*chief_qns[2:4]) < NEAR_CIRCULAR_E:
        return _near_circular(chief_qns, wanted, window_s, n)
    return _programme(chief_qns, wanted, window_s, mu_m3_s2)


def _near_circular(
    chief_qns: FloatArray, wanted: FloatArray, window_s: tuple[float, float], n: float
) -> Transfer:
    na = n * float(chief_qns[0])
    burns = [*_tangential(chief_qns[1], wanted, window_s, n, na)]
    size_i = math.hypot(*wanted[4:])
    if na * size_i > _NEGLIGIBLE_M_S:
        instants = _instants(math.atan2(wanted[5], wanted[4]), chief_qns[1], window_s, n, math.pi)
        if not instants:
            raise InputError(
                "relative.plan.transfer: the window has no instant for the normal impulse; make it"
                " longer than half an orbit"
            )
        t_s, half_turns = instants[0]
        burns.append(Burn(t_s, np.array([0.0, 0.0, na * size_i * (-1) ** half_turns])))
    drift = 3 * n * (window_s[1] - window_s[0])
    least = na * max(
        math.hypot(*wanted[2:4]) / 2, abs(wanted[0]) / 2, abs(wanted[1]) / math.hypot(2, drift)
    )
    return Transfer(_ordered(burns), math.hypot(least, na * size_i))


def _tangential(
    u_0: float, wanted: FloatArray, window_s: tuple[float, float], n: float, na: float
) -> tuple[Burn, ...]:
    """Three impulses along T, half orbits apart, that change δa, δλ and δe by the wanted amounts."""
    if na * float(np.max(np.abs(wanted[:4]))) < _NEGLIGIBLE_M_S:
        return ()
    axis = math.atan2(wanted[3], wanted[2])
    choices = _instants(axis, u_0, window_s, n, math.pi)
    best: tuple[float, tuple[Burn, ...]] = (math.inf, ())
    for three in itertools.combinations(choices, 3):
        matrix = np.array([[2.0, -3 * n * (window_s[1] - t), 2.0 * (-1) ** k] for t, k in three]).T / na
        try:
            dv = np.linalg.solve(matrix, [wanted[0], wanted[1], math.hypot(*wanted[2:4])])
        except np.linalg.LinAlgError:  # all three on one side: δe and δa cannot be changed independently
            continue
        cost = float(np.sum(np.abs(dv)))
        if cost < best[0] * (1 - 1e-12):
            burns = (Burn(t, np.array([0.0, v, 0.0])) for (t, _), v in zip(three, dv, strict=True))
            best = (cost, tuple(burns))
    if not best[1]:
        raise InputError(
            "relative.plan.transfer: the window holds fewer than three instants half an orbit apart;"
            " make it 1.5 orbits or longer"
        )
    return best[1]


def _instants(
    u: float, u_0: float, window_s: tuple[float, float], n: float, step: float
) -> list[tuple[float, int]]:
    """Instants in the window at mean argument of latitude u + k·step, each with the parity of k.

    Raises:
        InputError: There are more than can be combined in reasonable time.
    """
    first = math.ceil((n * window_s[0] + u_0 - u) / step - 1e-9)
    last = math.floor((n * window_s[1] + u_0 - u) / step + 1e-9)
    if last - first >= _MOST_INSTANTS:
        raise InputError(
            f"relative.plan.transfer: the window is too long, since the best three of at most"
            f" {_MOST_INSTANTS} instants half an orbit apart are sought; make it {_MOST_INSTANTS // 2}"
            " orbits or shorter"
        )
    return [((u + k * step - u_0) / n, k % 2) for k in range(first, last + 1)]


def _programme(
    chief_qns: FloatArray, wanted: FloatArray, window_s: tuple[float, float], mu_m3_s2: float
) -> Transfer:
    """Least sum of |components| over impulses at instants spread over the window."""
    # Half a second to import, and most scenarios have no plan.
    from scipy.optimize import linprog

    t_s = np.linspace(*window_s, _INSTANTS)
    chief = later(chief_qns, mu_m3_s2, t_s)
    to_roe = np.linalg.inv(any_eccentricity_map(chief, mu_m3_s2, 0.0))[:, :, 3:]
    n = math.sqrt(mu_m3_s2 / chief_qns[0] ** 3)
    to_roe[:, 1] -= 1.5 * n * (window_s[1] - t_s)[:, None] * to_roe[:, 0]
    matrix = np.moveaxis(to_roe, 1, 0).reshape(6, -1) * float(chief_qns[0])
    scale = float(np.max(np.abs(matrix)))
    solution = linprog(
        np.ones(2 * matrix.shape[1]),
        A_eq=np.hstack([matrix, -matrix]) / scale,
        b_eq=wanted * float(chief_qns[0]) / scale,
        method="highs",
    )
    if not solution.success:
        raise InputError(
            "relative.plan.transfer: no impulses in this window reach the wanted elements; make it"
            " longer than an orbit"
        )
    half = matrix.shape[1]
    dv = (solution.x[:half] - solution.x[half:]).reshape(-1, 3)
    burns = [
        Burn(float(t), v) for t, v in zip(t_s, dv, strict=True) if np.sum(np.abs(v)) > _NEGLIGIBLE_M_S
    ]
    # The optimum of |components| is at most √3 above that of the impulses' sizes.
    return Transfer(_ordered(burns), float(solution.fun) / math.sqrt(3))


def _ordered(burns: list[Burn]) -> tuple[Burn, ...]:
    """By time; impulses of one instant are one."""
    by_time: dict[float, FloatArray] = {}
    for burn in burns:
        t_s = next((t for t in by_time if abs(t - burn.t_s) < _SAME_INSTANT_S), burn.t_s)
        by_time[t_s] = by_time.get(t_s, np.zeros(3)) + burn.dv_rtn_m_s
    return tuple(Burn(t, by_time[t]) for t in sorted(by_time))
