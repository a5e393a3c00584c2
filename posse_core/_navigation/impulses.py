"""Impulses that were commanded, and what is not known of how they were carried out."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.plan import Burn
from posse_core._interfaces.navigator import ThrusterErrors


def effective(burns: Iterable[Burn], thrusters: ThrusterErrors) -> list[Burn]:
    """The impulses that the thrusters carry out at all, in order of time."""
    chosen = (b for b in burns if np.linalg.norm(b.dv_rtn_m_s) >= max(thrusters.least_m_s, 1e-300))
    return sorted(chosen, key=lambda burn: burn.t_s)


def covariance(dv_rtn_m_s: FloatArray, thrusters: ThrusterErrors) -> FloatArray:
    """(3, 3) covariance of an impulse (3,) other than 0, by the errors of its size and direction.

    It has the proportional terms of the model of Gates (1963), JPL Technical Report 32-504.
    """
    square = float(dv_rtn_m_s @ dv_rtn_m_s)
    along = np.outer(dv_rtn_m_s, dv_rtn_m_s)
    across = square * np.eye(3) - along
    return np.asarray(thrusters.size**2 * along + thrusters.direction_rad**2 * across)
