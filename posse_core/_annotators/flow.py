"""Annotators of motion: where the surface that a frame shows is in the next frame of its sequence."""

from __future__ import annotations

import numpy as np

from posse_core._annotators.points import shown, shown_next
from posse_core._arrays import BoolArray, FloatArray
from posse_core._interfaces.annotator import Annotator
from posse_core._interfaces.look import Look
from posse_core._model.labels import Labels

HIDDEN_SHARE = 1e-4
"""How far behind the surface a point counts as hidden, as a share of the spacecraft's longest side."""
_ROUNDING = 4 * float(np.finfo(np.float32).eps)
"""The same as a share of its distance, since the depth that gives the point is in single precision."""


class OpticalFlowAnnotator(Annotator):
    """``flow_duration_s``, and the arrays ``optical_flow_px`` and ``flow_visible``."""

    def annotate(self, look: Look) -> Labels:
        view, following = look.view(), shown_next(look)
        flow_px = np.full((*view.part_id.shape, 2), np.nan, dtype=np.float32)
        visible = np.zeros(view.part_id.shape, dtype=np.bool_)
        if following is not None:
            at_next, x_next_m, after_s = following
            uv_px, _, _ = shown(look)
            next_px = look.scene.camera.project(x_next_m)
            flow_px[view.hit] = next_px - uv_px
            visible[view.hit] = _visible(at_next, x_next_m, next_px, after_s)
        arrays = {"optical_flow_px": flow_px, "flow_visible": visible}
        return Labels({"flow_duration_s": _duration_s(look, following)}, arrays)


class SceneFlowAnnotator(Annotator):
    """``flow_duration_s``, and the array ``scene_flow_m``."""

    def annotate(self, look: Look) -> Labels:
        view, following = look.view(), shown_next(look)
        flow_m = np.full((*view.part_id.shape, 3), np.nan, dtype=np.float32)
        if following is not None:
            _, x_next_m, _ = following
            _, x_cam_m, _ = shown(look)
            flow_m[view.hit] = x_next_m - x_cam_m
        return Labels({"flow_duration_s": _duration_s(look, following)}, {"scene_flow_m": flow_m})


def _duration_s(look: Look, following: tuple[Look, FloatArray, FloatArray] | None) -> float | None:
    return None if following is None else following[0].state.t_s - look.state.t_s


def _visible(look: Look, x_cam_m: FloatArray, uv_px: FloatArray, after_s: FloatArray) -> BoolArray:
    """(N,) whether an image shows points, by a ray to each.

    Args:
        look: at the image.
        x_cam_m: (N, 3) the points in camera axes when their rows see them.
        uv_px: (N, 2) their positions in the image.
        after_s: (N,) when their rows see them.
    """
    camera = look.scene.camera
    size_px = np.array([camera.width_px, camera.height_px])
    visible = np.asarray(((uv_px >= -0.5) & (uv_px < size_px - 0.5)).all(axis=1))
    inside = np.flatnonzero(visible)
    points_m = x_cam_m[inside]
    hits = look.rays(points_m, after_s=after_s[inside] if camera.line_time_s > 0 else 0.0)
    distance_m = np.linalg.norm(points_m, axis=1)
    size_m = float(np.ptp(look.scene.spacecraft.bounds_body_m, axis=0).max())
    tolerance_m = HIDDEN_SHARE * size_m + _ROUNDING * distance_m
    visible[inside] = hits.distance_m > distance_m - tolerance_m
    return visible
