"""Named designs of relative motion: natural ones as initial conditions, forced ones as paths.

Lengths are in metres and angles in radians; rows of ROE are a·(δa, δλ, δex, δey, δix, δiy).
"""

from __future__ import annotations

import math

import numpy as np

from posse_core._arrays import FloatArray

GOLDEN = (1 + math.sqrt(5)) / 2
COVERAGE_BINS = (12, 24)
"""Bands in N and sectors around N: 288 bins of equal area."""


def fly_around(range_m: float, phase_rad: float) -> FloatArray:
    """(6,) ROE of a natural circle about the target; R is lowest at latitude argument ``phase_rad``."""
    e, i = range_m / 2, range_m * math.sqrt(3) / 2
    return np.array(_vectors(e, phase_rad, i, phase_rad + math.pi / 2))


def safe_ellipse(radial_m: float, normal_m: float, along_m: float, phase_rad: float) -> FloatArray:
    """(6,) ROE with parallel relative eccentricity and inclination vectors.

    Args:
        radial_m, normal_m: amplitudes along R and N.
        along_m: mean offset along T.
        phase_rad: phase of both vectors.
    """
    row = _vectors(radial_m, phase_rad, normal_m, phase_rad)
    row[1] = along_m
    return np.array(row)


def v_bar_hop(start_m: float, end_m: float, period_s: float) -> FloatArray:
    """(6,) RTN state at the hop's start: Hill's equations drift −3 T v in T per orbit of period T."""
    speed = -(end_m - start_m) / (3 * period_s)
    return np.array([0.0, start_m, 0.0, 0.0, speed, 0.0])


def hold(r_rtn_m: FloatArray, t_s: FloatArray) -> FloatArray:
    """(3,) → (F, 6) RTN states at rest at (F,) times."""
    out = np.zeros((len(t_s), 6))
    out[:, :3] = r_rtn_m
    return out


def straight_line(
    axis: int, start_m: float, end_m: float, duration_s: float, t_s: FloatArray
) -> FloatArray:
    """(F, 6) RTN states at (F,) times: along one axis at constant speed from t = 0, then at rest."""
    speed = (end_m - start_m) / duration_s
    moving = (t_s >= 0) & (t_s < duration_s)
    out = np.zeros((len(t_s), 6))
    out[:, axis] = start_m + speed * np.clip(t_s, 0, duration_s)
    out[:, 3 + axis] = np.where(moving, speed, 0.0)
    return out


def algorithm_3_1(roe_m: FloatArray, count: int) -> FloatArray:
    """Lines 2–13 of the thesis' Algorithm 3.1: (6,) initial a·δα → (H, 6), one row per relative orbit.

    The thesis does not say which δix the orbits of the second half have. Here δix and δiy carry over
    from one relative orbit to the next, so they keep the δix of the last orbit of the first half.
    """
    _, _, dex, dey, dix, diy = (float(x) for x in roe_m)
    dix_0, diy_0 = dix, diy
    rows = []
    for h in range(1, count + 1):
        if h < 0.25 * count:
            dix = dix_0 + 2 * diy_0 / count * h
        elif h < 0.5 * count:
            dix = dix_0 - 2 * diy_0 / count * h
        elif h < 0.75 * count:
            diy = diy_0 + diy_0 / count * h
        else:
            diy = diy_0 - diy_0 / count * h
        rows.append([0.0, 0.0, dex, dey, dix, diy])
    return np.array(rows)


def algorithm_3_1_repaired(size_m: float, count: int) -> FloatArray:
    """(count, 6) ROE: δe rotates once while δi rotates three times, growing to 4 sizes and back to 0."""
    turn = 2 * math.pi * np.arange(count) / count
    return np.array([_vectors(size_m, s, size_m * 2 * (1 - math.cos(s)), 3 * s) for s in turn])


def view_sphere(
    nearest_m: float, farthest_m: float, count: int, *, logarithmic: bool = False
) -> FloatArray:
    """(count, 6) RTN states at rest, in directions spread evenly over the sphere.

    The directions form a Fibonacci lattice (González 2010, Mathematical Geosciences 42, 49). The
    distances follow the additive recurrence of 1/√2, which is uncorrelated with the lattice's golden
    angle.

    Args:
        nearest_m, farthest_m: limits of the distance.
        count: number of states.
        logarithmic: whether the logarithm of the distance is spread evenly instead of the distance.
    """
    k = np.arange(count)
    z = 1 - (2 * k + 1) / count
    angle = 2 * math.pi * k / GOLDEN
    rho = np.sqrt(1 - z**2)
    share = (0.5 + k / math.sqrt(2)) % 1
    if logarithmic:
        distance = nearest_m * (farthest_m / nearest_m) ** share
    else:
        distance = nearest_m + (farthest_m - nearest_m) * share
    out = np.zeros((count, 6))
    out[:, :3] = distance[:, None] * np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=-1)
    return out


def coverage(r_rtn_m: FloatArray) -> float:
    """Share of 288 equal-area bins of viewing directions that contain at least one position (..., 3)."""
    bands, sectors = COVERAGE_BINS
    x, y, z = np.moveaxis(r_rtn_m / np.linalg.norm(r_rtn_m, axis=-1, keepdims=True), -1, 0)
    band = np.minimum(((z + 1) / 2 * bands).astype(int), bands - 1)
    sector = np.floor(np.arctan2(y, x) / (2 * math.pi) * sectors).astype(int) % sectors
    return len(np.unique(band * sectors + sector)) / (bands * sectors)


def _vectors(e_m: float, e_phase: float, i_m: float, i_phase: float) -> list[float]:
    return [
        0.0,
        0.0,
        e_m * math.cos(e_phase),
        e_m * math.sin(e_phase),
        i_m * math.cos(i_phase),
        i_m * math.sin(i_phase),
    ]
