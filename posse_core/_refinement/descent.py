"""Descent to the pose at which image and drawing agree: Gauss–Newton steps with damping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._refinement.compare import Comparer, Comparison, blocks
from posse_core._refinement.placement import Placement

_TUKEY = 4.0
"""Residuals above so many standard deviations do not count."""
_LEAST_SPREAD = 2 / 255
_LARGEST = 4.0
_SMALLEST = 0.02
"""Steps in pixels that the surface moves: the largest that is made, and the last one."""
_TRIES = 3
_LEAST_DISTANCE = 0.3
"""Poses nearer than this share of the spacecraft's radius are not tried."""
_ALIKE = 6.0
"""By so many variances of a residual the Hessian's inverse counts beside what the blocks say."""
_EXCESS, _POWER = 11.0, 1 / 3
"""By so much the covariance is larger than both, times this power of what is left of the disagreement,
which counts at least so much:"""
_LEAST_OFF = 1e-3
_LEAST_ERROR_PX = 0.01
"""By how much of a crop's pixel the spacecraft's rim may be off, by each of the unknowns, whatever the
residuals say."""
_OPEN = 1e-6
"""A direction is open if what the image says of it is below this share of what it says of the clearest:
pictures are of single precision."""
_BLOCK_PX, _BLOCKS = 8, 8
"""Residuals are correlated within blocks: their least side, and how many stand side by side."""


@dataclass(frozen=True)
class Found:
    """A pose and the comparison at it.

    Attributes:
        radius_px: of the spacecraft in the crop.
        is_settled: whether no step from here, or only a tiny one, makes them agree more.
    """

    placement: Placement
    comparison: Comparison
    radius_px: float
    is_settled: bool = False


def descended(
    comparer: Comparer,
    begun: Found,
    radius_m: float,
    steps: int,
    has_time: Callable[[], bool],
    looseness: float = 1.0,
) -> Found:
    """Descend from a pose.

    Args:
        begun: the pose and the comparison at it.
        radius_m: of the spacecraft.
        steps: the most steps.
        has_time: whether another step may be made.
        looseness: by how much larger residuals may be than usual before they count no more.
    """
    here, radius_px = begun, begun.radius_px
    unit = units(begun.placement, radius_m, radius_px)
    damping = 1e-3
    for _ in range(steps):
        spread = looseness * _spread(here.comparison)
        cost = _cost(here.comparison, spread)
        H, slope = _normal_equations(here.comparison, spread, unit)
        there = None
        for _ in range(_TRIES):
            if not has_time():
                return here
            damped = H + damping * np.diag(np.diag(H)) + 1e-9 * np.trace(H) * np.eye(6)
            step = np.linalg.solve(damped, slope) if H.any() else np.zeros(6)
            step *= min(1.0, _LARGEST / max(float(np.abs(step).max()), 1e-12))
            moved = here.placement.moved(step * unit)
            if moved.t_body_cam_m[2] < _LEAST_DISTANCE * radius_m or not step.any():
                break
            tried = Found(moved, comparer.compare(moved), radius_px)
            if _cost(tried.comparison, spread) < cost:
                there = tried
                break
            damping = max(damping, 1e-3) * 10
        if there is None:
            return replace(here, is_settled=True)
        here, damping = there, max(damping / 10, 1e-4)
        if float(np.abs(step).max()) < _SMALLEST:
            return replace(here, is_settled=True)
    return here


def units(placement: Placement, radius_m: float, radius_px: float) -> FloatArray:
    """(6,) changes of a pose, rad and m, by which the spacecraft's rim moves by about a pixel."""
    across_m = radius_m / radius_px
    along_m = across_m * max(1.0, float(placement.t_body_cam_m[2]) / radius_m)
    return np.array([*[1 / radius_px] * 3, across_m, across_m, along_m])


def covariance(found: Found, radius_m: float) -> FloatArray | None:
    """(6, 6) covariance of the pose, of a small rotation (rad) and of the position (m), camera axes;
    None where the image leaves a direction open, as a few pixels do.

    The inverse of the Hessian, with the residuals as they are: they are correlated within blocks, which
    count as independent of each other (the sandwich of Huber 1967, by clusters). Some directions are
    pulled by few blocks, which happen to agree: so the Hessian's inverse alone is added, as of residuals
    that are alike everywhere. Where the drawing itself is wrong, all blocks are pulled alike; so the
    covariance is several times larger, and grows with what is left of the disagreement, as errors were
    measured to do (docs/refining_measured.md). No pose is exact.
    """
    comparison = found.comparison
    unit = units(found.placement, radius_m, found.radius_px)
    spread = _spread(comparison)
    weight = _weight(comparison, spread)
    H, _ = _normal_equations(comparison, spread, unit)
    shape = comparison.residual.shape
    block = blocks(shape, max(_BLOCK_PX, max(shape) // _BLOCKS))[comparison.compared]
    pulls = comparison.by_pose[comparison.compared].astype(np.float64) * unit
    pulls *= (weight * comparison.residual[comparison.compared])[:, None]
    sums = np.stack([np.bincount(block, pulls[:, k]) for k in range(6)], axis=1)
    sums = sums[sums.any(axis=1)]
    correction = len(sums) / max(len(sums) - 6, 1)
    eigenvalues = np.linalg.eigvalsh(H)
    if eigenvalues[0] <= _OPEN * eigenvalues[-1]:
        return None
    inverse = np.linalg.inv(H)
    by_residuals = correction * (inverse @ (sums.T @ sums) @ inverse)
    variance = float(np.mean(weight * comparison.residual[comparison.compared] ** 2))
    excess = _EXCESS * max(1 - comparison.agreement, _LEAST_OFF) ** _POWER
    by_image = excess * (by_residuals + _ALIKE * variance * inverse)
    C = (by_image + _LEAST_ERROR_PX**2 * np.eye(6)) * np.outer(unit, unit)
    return np.asarray((C + C.T) / 2)


def _spread(comparison: Comparison) -> float:
    off = np.abs(comparison.residual[comparison.compared])
    return 1.4826 * float(np.median(off)) + _LEAST_SPREAD if len(off) else _LEAST_SPREAD


def _weight(comparison: Comparison, spread: float) -> Float32Array:
    """Tukey's weight of each compared pixel."""
    share = comparison.residual[comparison.compared] / np.float32(_TUKEY * spread)
    return np.asarray(np.maximum(1 - share * share, 0) ** 2, np.float32)


def _cost(comparison: Comparison, spread: float) -> float:
    """Tukey's cost, the mean over the compared pixels."""
    off = np.abs(comparison.residual[comparison.compared])
    share = np.minimum(off / np.float32(_TUKEY * spread), 1)
    return float(np.mean(1 - (1 - share * share) ** 3)) if len(off) else np.inf


def _normal_equations(
    comparison: Comparison, spread: float, unit: FloatArray
) -> tuple[FloatArray, FloatArray]:
    J = comparison.by_pose[comparison.compared] * unit.astype(np.float32)
    weighted = J * _weight(comparison, spread)[:, None]
    H = np.asarray(weighted.T @ J, np.float64)
    return H, np.asarray(weighted.T @ comparison.residual[comparison.compared], np.float64)
