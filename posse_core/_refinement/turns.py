"""Poses that are tried since they look like another or are near it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_about
from posse_core._refinement.crop import Crop
from posse_core._refinement.placement import Placement

_AXES = 6
"""Axes across each principal axis."""


class Around(NamedTuple):
    """Poses that are tried around one.

    Attributes:
        tilts: by how much they are turned about axes across the line of sight, and about how many.
        scale: index of the scale at which they are drawn, -1 the finest, or the finest where there are
            fewer.
        followed: how many of them are followed.
    """

    tilts: tuple[tuple[float, int], ...]
    scale: int
    followed: int


class Tried(NamedTuple):
    """A pose that was drawn.

    Attributes:
        chance: how likely it is, as that of a trail.
        crops: around it, differently coded.
        placement: the pose.
    """

    chance: float
    crops: Sequence[Crop]
    placement: Placement


FAR = Around(((np.radians(12), 6), (np.radians(25), 8)), scale=0, followed=3)
CLOSE = Around(((np.radians(5), 6),), scale=-1, followed=2)
BESIDE = Around(((np.radians(10), 6),), scale=1, followed=3)


def tilted(placement: Placement, around: Around) -> list[Placement]:
    """A pose turned about axes across the line of sight."""
    return [
        placement.moved(angle * np.array([np.cos(side), np.sin(side), 0, 0, 0, 0]))
        for angle, count in around.tilts
        for side in 2 * np.pi * (np.arange(count) + 0.5) / count
    ]


def half_turned(placement: Placement, axes_body: FloatArray) -> list[Placement]:
    """A pose turned by half a turn about each of the spacecraft's axes (N, 3)."""
    return [placement.turned(R_about(axis, np.pi)) for axis in axes_body]


def half_turn_axes(vertices_m: FloatArray) -> FloatArray:
    """(N, 3) unit vectors across each principal axis of vertices (V, 3), evenly spread, and the body
    axes."""
    principal = np.linalg.svd(vertices_m - vertices_m.mean(axis=0), full_matrices=False)[2]
    turns = np.arange(_AXES) * np.pi / _AXES
    circles = [
        np.outer(np.cos(turns), principal[one]) + np.outer(np.sin(turns), principal[other])
        for one, other in ((0, 1), (1, 2), (2, 0))
    ]
    # The principal axes themselves are in two circles each.
    last = np.delete(circles[2], [0, _AXES // 2], axis=0)
    return np.concatenate([np.eye(3), circles[0], circles[1][1:], last])
