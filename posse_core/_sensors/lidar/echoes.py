"""Echoes of a pulse whose rays meet surfaces at several distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._sensors.lidar.options import Echo


@dataclass(frozen=True)
class Echoes:
    """The echo of each of N beams that the receiver measures.

    Attributes:
        signal: (N,) its signal, 0 where nothing returns.
        range_m: (N,) mean distance of its rays, weighted by their signal; NaN where nothing returns.
        spread_m: (N,) standard deviation of those distances.
        ray: (N,) the ray that contributes most.
    """

    signal: FloatArray
    range_m: FloatArray
    spread_m: FloatArray
    ray: IntArray


def echoes(
    range_m: FloatArray, signal: FloatArray, gap_m: float, which: Echo, threshold: FloatArray
) -> Echoes:
    """Choose the echo of each beam.

    Rays whose distances follow each other by less than ``gap_m`` are one echo; by more, they are
    resolved.

    Args:
        range_m: (N, K) distance of each ray's surface, infinite for none.
        signal: (N, K) signal that returns along each ray, 0 for none.
        gap_m: least distance between two echoes.
        which: ``first``: the nearest echo of at least ``threshold``, or the strongest if there is none;
            ``strongest``; ``centroid``: everything is one echo.
        threshold: (N,).
    """
    beams, rays = range_m.shape
    order = np.argsort(range_m, axis=1, kind="stable")
    near_m = np.take_along_axis(range_m, order, axis=1)
    found = np.isfinite(near_m)
    start_m = np.where(found[:, :1], near_m[:, :1], 0.0)  # distances behind it lose no digits
    behind_m = np.where(found, near_m, start_m) - start_m
    weight = np.where(found, np.take_along_axis(signal, order, axis=1), 0.0)

    parted = np.zeros((beams, rays), dtype=np.int64)
    if which != "centroid":
        parted[:, 1:] = np.cumsum(np.diff(behind_m, axis=1) > gap_m, axis=1)
    cell = (np.arange(beams)[:, None] * rays + parted).ravel()

    def summed(values: FloatArray) -> FloatArray:
        """Sums (N, K) over the rays of each echo."""
        return np.asarray(np.bincount(cell, values.ravel(), beams * rays).reshape(beams, rays), float)

    total = summed(weight)
    chosen = total.argmax(axis=1)
    if which == "first":
        enough = (total >= threshold[:, None]) & (total > 0)
        chosen = np.where(enough.any(axis=1), enough.argmax(axis=1), chosen)
    row = np.arange(beams)
    power = total[row, chosen]
    per = np.where(power > 0, power, 1.0)
    mean_m = summed(weight * behind_m)[row, chosen] / per
    within = parted == chosen[:, None]
    off_m = np.where(within, behind_m - mean_m[:, None], 0.0)
    return Echoes(
        signal=power,
        range_m=np.where(power > 0, start_m[:, 0] + mean_m, np.nan),
        spread_m=np.sqrt(np.sum(weight * off_m**2, axis=1) / per),
        ray=order[row, np.where(within, weight, -1.0).argmax(axis=1)],
    )
