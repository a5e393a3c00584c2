"""How far each model of relative motion is off, on the thesis' two orbits, against integration.

The target's states are osculating at the epoch. Aqua's chaser has a·δe = a·δi = (0, 100) m and stays
100 to 224 m away, Cluster's a·δe = (30, 80) m and a·δi = (60, 80) m and 121 to 296 m. Every model starts
from the same two states.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics import elements, j2, linear, roe
from posse_core._dynamics.nonlinear import ForceModel, integrate
from posse_core._dynamics.start import Start, Target
from posse_core._propagators.thesis import roe_to_rtn

_PER_ORBIT = 100


@dataclass(frozen=True)
class Case:
    """One start and one truth.

    Attributes:
        keplerian: (6,) a (m), e, i, Ω, ω, M (rad) of the target.
        roe_m: (6,) a times quasi-nonsingular ROE of the chaser.
        gravity: of the truth; orbits: flown.
    """

    name: str
    keplerian: FloatArray
    roe_m: FloatArray
    gravity: str
    orbits: int


@dataclass(frozen=True)
class Errors:
    """(F,) times in orbits, and by model the (F,) distance from the truth, m."""

    orbits: FloatArray
    by_model: dict[str, FloatArray]


def cases(constants: Constants) -> list[Case]:
    """Aqua and Cluster (tables 3.3 and 3.4 of the thesis), two-body and J2."""
    mu = constants.mu_earth_m3_s2

    def orbit(n_rad_s: float, e: float, *degrees: float) -> FloatArray:
        return np.array([(mu / n_rad_s**2) ** (1 / 3), e, *np.radians(degrees)])

    aqua = orbit(14.571168 * 2 * math.pi / 86400, 8.98e-5, 98.23, 334.40, 52.44, 318.10)
    perigee = orbit(3.21e-5, 0.52, 133.35, 345.92, 195.45, 0.0)
    apogee = orbit(3.21e-5, 0.52, 133.35, 345.92, 195.45, 180.0)
    beside_aqua = np.array([0.0, 0.0, 0.0, 100.0, 0.0, 100.0])
    beside_cluster = np.array([0.0, 0.0, 30.0, 80.0, 60.0, 80.0])
    return [
        case
        for gravity in ("two-body", "j2")
        for case in (
            Case("Aqua", aqua, beside_aqua, gravity, 10),
            Case("Cluster from perigee", perigee, beside_cluster, gravity, 1),
            Case("Cluster from apogee", apogee, beside_cluster, gravity, 1),
        )
    ]


def errors(case: Case, constants: Constants) -> Errors:
    """Each model's distance from the integrated motion of one case."""
    mu = constants.mu_earth_m3_s2
    orbits = np.linspace(0.0, case.orbits, case.orbits * _PER_ORBIT + 1)
    period_s = 2 * math.pi * math.sqrt(case.keplerian[0] ** 3 / mu)
    t_s = orbits * period_s
    r, v = elements.state_from_keplerian(case.keplerian, mu)
    start = Start.from_roe(Target(r, v, constants), case.roe_m)
    truth = _integrated(start, t_s, case.gravity)
    return Errors(
        orbits,
        {
            name: np.linalg.norm(states[:, :3] - truth, axis=-1)
            for name, states in _models(start, t_s).items()
        },
    )


def _models(start: Start, t_s: FloatArray) -> dict[str, FloatArray]:
    """By name, the (F, 6) RTN states of each model."""
    chief, mu = start.target.qns, start.target.mu_m3_s2
    n = math.sqrt(mu / chief[0] ** 3)
    return {
        "hcw": linear.hcw_stm(chief, mu, t_s) @ start.rtn,
        "thesis, T(nt)": roe_to_rtn(n, t_s) @ (start.roe * chief[0]),
        "roe-near-circular, T(u)": linear.near_circular_map(chief, mu, t_s) @ start.roe,
        "yamanaka-ankersen": linear.yamanaka_ankersen_stm(chief, mu, t_s) @ start.rtn,
        "linear ROE map, any e": linear.any_eccentricity_map(chief, mu, t_s) @ start.roe,
        "roe (exact)": roe.rtn_from_roe(chief, start.roe, mu, t_s),
        "j2-roe, mean elements only": _j2_roe(start, t_s, "brouwer-lyddane", osculating=False),
        "j2-roe": _j2_roe(start, t_s, "brouwer-lyddane"),
        "j2-roe, canonical": _j2_roe(start, t_s, "canonical"),
    }


def _j2_roe(start: Start, t_s: FloatArray, theory: j2.Theory, *, osculating: bool = True) -> FloatArray:
    chief, mu, constants = start.target.qns, start.target.mu_m3_s2, start.target.constants
    chief_0 = j2.mean_from_osculating(chief, constants, theory)
    deputy_0 = j2.mean_from_osculating(roe.qns_from_roe(chief, start.roe), constants, theory)
    mean_roe = j2.j2_stm(chief_0, constants, t_s) @ roe.roe_from_qns(chief_0, deputy_0)
    mean = j2.j2_secular(chief_0, constants, t_s)
    if not osculating:
        return roe.rtn_from_roe(mean, mean_roe, mu, 0.0)
    both = (
        j2.osculating_from_mean(qns, constants, theory)
        for qns in (mean, roe.qns_from_roe(mean, mean_roe))
    )
    chief_t, deputy_t = both
    return roe.rtn_from_roe(chief_t, roe.roe_from_qns(chief_t, deputy_t), mu, 0.0)


def _integrated(start: Start, t_s: FloatArray, gravity: str) -> FloatArray:
    r, v, dr, _ = integrate(
        (start.target.r_eci_m, start.target.v_eci_m_s, start.dr_eci_m, start.dv_eci_m_s),
        t_s,
        ForceModel("j2" if gravity == "j2" else "two-body"),
        start.target.constants,
    )
    return np.asarray(np.einsum("fji,fj->fi", frames.R_eci_from_rtn(r, v), dr))
