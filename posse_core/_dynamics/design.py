"""Relative orbits by name: natural ones as initial conditions, forced ones as paths.

Sizes are metres; rows of ROE are a·(δa, δλ, δex, δey, δix, δiy).
"""

from __future__ import annotations

import math

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._scenario.design import (
    Algorithm31,
    Algorithm31Repaired,
    DesignConfig,
    FlyAround,
    HoldPoint,
    RBarApproach,
    SafeEllipse,
    VBarApproach,
    VBarHop,
    ViewSphere,
)

GOLDEN = (1 + math.sqrt(5)) / 2
COVERAGE_BINS = (12, 24)
"""Bands in N and sectors around N: 288 bins of equal area."""


def natural_roe_m(design: DesignConfig) -> FloatArray | None:
    """(H, 6) initial ROE of the relative orbits, or None where the design is not made of ROE."""
    if isinstance(design, FlyAround):
        phase = math.radians(design.phase_deg)
        e, i = design.range_m / 2, design.range_m * math.sqrt(3) / 2
        return np.array([_vectors(e, phase, i, phase + math.pi / 2)])
    if isinstance(design, SafeEllipse):
        phase = math.radians(design.phase_deg)
        row = _vectors(design.radial_m, phase, design.normal_m, phase)
        row[1] = design.along_m
        return np.array([row])
    if isinstance(design, Algorithm31):
        start = np.array([0.0, 0.0, *design.delta_e_m, *design.delta_i_m])
        return algorithm_3_1(start, design.relative_orbits)
    if isinstance(design, Algorithm31Repaired):
        turn = 2 * math.pi * np.arange(design.relative_orbits) / design.relative_orbits
        size = design.size_m
        # δe turns once, δi three times while it grows to 4 sizes and shrinks to nothing.
        return np.array([_vectors(size, s, size * 2 * (1 - math.cos(s)), 3 * s) for s in turn])
    return None


def hop_rtn(design: VBarHop, period_s: float) -> FloatArray:
    """(6,) RTN state at the hop's start: Hill's equations drift −3 T v in T per orbit of period T."""
    speed = -(design.end_m - design.start_m) / (3 * period_s)
    return np.array([0.0, design.start_m, 0.0, 0.0, speed, 0.0])


def forced_rtn(design: DesignConfig, t_s: FloatArray) -> tuple[FloatArray, IntArray] | None:
    """(F, 6) RTN states at the times and (F,) sequence numbers, or None for a natural design."""
    if isinstance(design, ViewSphere):
        return view_sphere(design, len(t_s)), np.arange(len(t_s))
    if isinstance(design, HoldPoint):
        out = np.zeros((len(t_s), 6))
        out[:, :3] = design.r_rtn_m
    elif isinstance(design, VBarApproach | RBarApproach):
        axis, sign = (1, 1.0) if isinstance(design, VBarApproach) else (0, -1.0)
        speed = sign * (design.end_m - design.start_m) / design.duration_s
        moving = (t_s >= 0) & (t_s < design.duration_s)
        out = np.zeros((len(t_s), 6))
        out[:, axis] = sign * design.start_m + speed * np.clip(t_s, 0, design.duration_s)
        out[:, 3 + axis] = np.where(moving, speed, 0.0)
    else:
        return None
    return out, np.zeros(len(t_s), dtype=np.int64)


def algorithm_3_1(roe_m: FloatArray, count: int) -> FloatArray:
    """Lines 2–13 of the thesis' Algorithm 3.1: (6,) initial a·δα → (H, 6), one row an orbit.

    δix and δiy carry over from one relative orbit to the next, which the thesis leaves open: so the
    orbits of the second half keep the δix of the last one of the first half.
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


def view_sphere(design: ViewSphere, count: int) -> FloatArray:
    """(count, 6) RTN states, at rest: a Fibonacci lattice of directions, distances by the additive
    recurrence of 1/√2, which is out of step with the lattice's golden angle (González 2010,
    Mathematical Geosciences 42, 49)."""
    k = np.arange(count)
    z = 1 - (2 * k + 1) / count
    angle = 2 * math.pi * k / GOLDEN
    rho = np.sqrt(1 - z**2)
    share = (0.5 + k / math.sqrt(2)) % 1
    near, far = design.range_m
    if design.range_law == "logarithmic":
        distance = near * (far / near) ** share
    else:
        distance = near + (far - near) * share
    out = np.zeros((count, 6))
    out[:, :3] = distance[:, None] * np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=-1)
    return out


def coverage(r_rtn_m: FloatArray) -> float:
    """Share of 288 equal-area bins of viewing directions that positions (..., 3) fall in."""
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
