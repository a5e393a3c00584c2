"""What the page filters and plots by: one value a frame, from the labels and the trajectory."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._frames import R_eci_from_rtn, matrix_from_quaternion, unit
from posse_core._model.label_line import LabelLine
from posse_core._model.trajectory import Trajectory

SCALARS = (
    "index",
    "sequence",
    "spacecraft",
    "range_m",
    "phase_angle_rad",
    "fraction_lit",
    "fraction_visible",
    "sun_fraction_target",
)
"""Labels taken as they are; an annotator that was not asked for leaves null."""
_SEEN = 2
_DECIMALS = 6
"""Of vectors: a micrometre, a microradian."""


def label_columns(lines: Iterable[LabelLine]) -> dict[str, list[Any]]:
    """Column name → a value for each label line, null where a line has none.

    ``keypoints_visible`` counts the keypoints with visibility 2.
    """
    table: dict[str, list[Any]] = {name: [] for name in (*SCALARS, "keypoints_visible")}
    for labels in lines:
        for name in SCALARS:
            table[name].append(getattr(labels, name) if labels.has(name) else None)
        points = labels.keypoints.values() if labels.has("keypoints") else None
        seen = None if points is None else sum(point.visibility == _SEEN for point in points)
        table["keypoints_visible"].append(seen)
    return table


def motion_columns(trajectory: Trajectory, index: IntArray) -> dict[str, list[list[float]]]:
    """Directions and positions of the frames ``index`` (F,), each (F, 3), as lists.

    ``r_chaser_rtn_m``; ``sun_rtn``, the unit vector from the target to the Sun, target's RTN axes;
    ``view_body``, ``sun_body``: unit vectors from the target to the camera and to the Sun, body axes.

    Raises:
        InputError: the trajectory has no such frame.
    """
    if len(index) and index.max() >= len(trajectory):
        raise InputError(f"trajectory.npz has {len(trajectory)} frames, none for label {index.max()}")
    r_target = trajectory.r_target_eci_m[index]
    R_rtn = R_eci_from_rtn(r_target, trajectory.v_target_eci_m_s[index])
    R_body = matrix_from_quaternion(trajectory.q_eci_from_body[index])
    sun_eci = unit(trajectory.r_sun_eci_m[index] - r_target)
    chaser_rtn = trajectory.r_chaser_rtn_m[index]
    return {
        "r_chaser_rtn_m": _rounded(chaser_rtn),
        "sun_rtn": _rounded(_into(R_rtn, sun_eci)),
        "view_body": _rounded(_into(R_body, np.einsum("fij,fj->fi", R_rtn, unit(chaser_rtn)))),
        "sun_body": _rounded(_into(R_body, sun_eci)),
    }


def _into(R_eci_from_axes: FloatArray, x_eci: FloatArray) -> FloatArray:
    """(F, 3, 3), (F, 3) in ECI → (F, 3) in the axes."""
    return np.asarray(np.einsum("fji,fj->fi", R_eci_from_axes, x_eci))


def _rounded(vectors: FloatArray) -> list[list[float]]:
    rounded: list[list[float]] = np.round(vectors, _DECIMALS).tolist()
    return rounded
