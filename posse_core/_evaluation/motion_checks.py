"""What must hold between the flow that a frame labels and the poses of this frame and the next.

The points that pixels show come from the labelled depth, and where they are in the next frame from that
frame's labelled pose. Neither uses the code that made the flow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._evaluation.body_checks import (
    HIDDEN_KEYPOINT_DEPTH_SHARE,
    REPROJECTION_ERROR_PX,
)
from posse_core._evaluation.case import DEPTH_ERROR_M, Case, depth_error_m
from posse_core._evaluation.checks import COMPARED_PIXELS, Check

FLOW_ERROR_SHARE = 1e-5
"""How far a flow may lie from the poses', over its length, since it has single precision."""
HIDDEN_DEPTH_SHARE = 1e-3
"""How far, over the craft's size, the mesh may stand in front of a point that is labelled visible."""
COMPARED_RAYS = 64
"""Of these, pixels whose visibility in the next frame is compared by a ray."""
_SAME_TIME_S = 1e-6


@dataclass(frozen=True)
class _Moved:
    """N pixels of a frame and the points that they show, in this frame and in the next one.

    Attributes:
        row, column: (N,) the pixels.
        now_m, next_m: (N, 3) the points in camera axes, at the times of the rows that see them.
        next_s: (N,) those times in the next frame, after its instant.
        next_px: (N, 2) positions in the next frame; NaN behind the camera and beyond its lens.
    """

    row: IntArray
    column: IntArray
    now_m: FloatArray
    next_m: FloatArray
    next_s: FloatArray
    next_px: FloatArray


def _moved(case: Case, following: Case) -> _Moved:
    row, column = np.nonzero(case.covered & np.isfinite(case.truth["depth_m"]))
    chosen = slice(None, None, max(1, -(-len(row) // COMPARED_PIXELS)))
    row, column = row[chosen], column[chosen]
    rays = case.camera.rays(np.stack([column, row], axis=-1))
    now_m = rays * case.truth["depth_m"][row, column, None].astype(np.float64)
    now_s = case.target.row_s(row.astype(np.float64))
    next_m, next_s = np.empty_like(now_m), np.empty(len(row))
    known = np.zeros(len(row), dtype=np.bool_)
    for body, own, links in case.by_link(row, column):
        x_link_m = body.placed.in_link(now_m[own], links, now_s[own])
        next_m[own], next_s[own] = following.bodies[body.number].seen_by_rows(x_link_m, links)
        known[own] = True
    next_px = case.camera.project(next_m[known])
    return _Moved(row[known], column[known], now_m[known], next_m[known], next_s[known], next_px)


def _duration_s(case: Case) -> float | None:
    return case.labels.flow_duration_s if case.labels.has("flow_duration_s") else None


def _wrong_duration(case: Case) -> Iterator[str]:
    """Frames between two of a collected dataset may have been dropped, so there the next may be
    another."""
    following, duration_s = case.following, _duration_s(case)
    if following is None or case.labels.has("origin"):
        return
    later_s = following.labels.t_s - case.labels.t_s
    if duration_s is None or abs(duration_s - later_s) > _SAME_TIME_S:
        yield f"flow_duration_s is {duration_s}, and the next frame is {later_s:.6g} s later"


def _frame_ahead(case: Case) -> Case | None:
    """The frame that the flow leads to, if it is in the dataset."""
    following, duration_s = case.following, _duration_s(case)
    if following is None or duration_s is None:
        return None
    later_s = following.labels.t_s - case.labels.t_s
    return following if abs(duration_s - later_s) <= _SAME_TIME_S else None


def _optical_flow(case: Case) -> Iterator[str]:
    flow_px = case.truth["optical_flow_px"].astype(np.float64)
    there = np.isfinite(flow_px).all(axis=-1)
    yield from _wrong_duration(case)
    if _duration_s(case) is None and there.any():
        yield f"optical_flow_px is given in {int(there.sum())} pixels, and flow_duration_s is null"
    beyond = int((there & ~case.covered).sum())
    if beyond:
        yield f"optical_flow_px is given in {beyond} pixels outside the mask"
    following = _frame_ahead(case)
    if following is None:
        return
    moved = _moved(case, following)
    expected = moved.next_px - np.stack([moved.column, moved.row], axis=-1)
    given = flow_px[moved.row, moved.column]
    allowed = REPROJECTION_ERROR_PX + FLOW_ERROR_SHARE * np.linalg.norm(expected, axis=1)
    both = np.isfinite(given).all(axis=1) & np.isfinite(expected).all(axis=1)
    neither = np.isnan(given).all(axis=1) & np.isnan(expected).any(axis=1)
    off_px = np.linalg.norm(given - expected, axis=1)
    wrong = ~neither & ~(both & (off_px <= allowed))
    if wrong.any():
        typical = f", {np.median(off_px[both]):.3g} px in the middle" if both.any() else ""
        yield f"optical_flow_px is not the poses' in {wrong.sum()} of {len(wrong)} pixels{typical}"


def _flow_visible(case: Case) -> Iterator[str]:
    visible, flow_px = case.truth["flow_visible"], case.truth["optical_flow_px"].astype(np.float64)
    size_px = np.array([case.camera.width_px, case.camera.height_px])
    row, column = np.nonzero(visible)
    ahead_px = np.stack([column, row], axis=-1) + flow_px[row, column]
    slack_px = REPROJECTION_ERROR_PX
    inside = ((ahead_px >= -0.5 - slack_px) & (ahead_px < size_px - 0.5 + slack_px)).all(axis=1)
    if not inside.all():
        yield f"flow_visible is true in {int((~inside).sum())} pixels whose flow leaves the image"
    following = _frame_ahead(case)
    if following is None:
        return
    moved = _moved(case, following)
    in_image = ((moved.next_px >= -0.5) & (moved.next_px < size_px - 0.5)).all(axis=1)
    candidates = np.flatnonzero(in_image)
    compared = candidates[:: max(1, -(-len(candidates) // COMPARED_RAYS))]
    hidden_m = following.hidden_by_m(moved.next_m[compared], moved.next_s[compared])
    for i, before_m in zip(compared, hidden_m, strict=True):
        where = f"({moved.column[i]}, {moved.row[i]})"
        is_visible = visible[moved.row[i], moved.column[i]]
        if is_visible and before_m > HIDDEN_DEPTH_SHARE * case.target.size_m:
            yield f"{where} is labelled visible, and the next frame's mesh is {before_m:.3g} m before it"
        if not is_visible and before_m < HIDDEN_KEYPOINT_DEPTH_SHARE * case.target.size_m:
            yield f"{where} is labelled hidden, and in the next frame nothing is before it"


def _scene_flow(case: Case) -> Iterator[str]:
    flow_m = case.truth["scene_flow_m"].astype(np.float64)
    there = np.isfinite(flow_m).all(axis=-1)
    yield from _wrong_duration(case)
    expected_there = case.covered if _duration_s(case) is not None else np.zeros_like(case.covered)
    missing = int((there != expected_there).sum())
    if missing:
        yield f"scene_flow_m is not given where it must be in {missing} pixels"
    following = _frame_ahead(case)
    if following is None:
        return
    moved = _moved(case, following)
    off_m = np.linalg.norm(flow_m[moved.row, moved.column] - (moved.next_m - moved.now_m), axis=1)
    allowed_m = depth_error_m(np.linalg.norm(moved.next_m, axis=1))
    wrong = ~(off_m <= allowed_m)
    if wrong.any():
        yield f"scene_flow_m is not the poses' in {wrong.sum()} of {len(wrong)} pixels"


_POSES = ("mask_rle", "q_cam_from_body", "t_body_cam_m")
MOTION_CHECKS = (
    Check(
        "optical-flow",
        f"flow by the poses of both frames, {REPROJECTION_ERROR_PX} px",
        _optical_flow,
        _POSES,
        ("optical_flow_px", "depth_m"),
    ),
    Check(
        "flow-visible",
        "what the flow leads to is hidden by the mesh or not",
        _flow_visible,
        _POSES,
        ("optical_flow_px", "flow_visible", "depth_m"),
    ),
    Check(
        "scene-flow",
        f"motion by the poses of both frames, {DEPTH_ERROR_M * 1e3:.0f} mm",
        _scene_flow,
        _POSES,
        ("scene_flow_m", "depth_m"),
    ),
)
"""Checks of a frame whose schema is right, beside :data:`posse_core._evaluation.checks.CHECKS`."""
