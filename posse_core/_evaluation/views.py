"""The outlines of a frame's bodies, and where the Sun lights what is within them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._evaluation.case import Case
from posse_core._evaluation.outlines import Outline, outline_of
from posse_core._evaluation.sunlight import sunlit

LEAST_MASK_PX = 15
"""Length of the longer side of a mask below which its outline proves nothing."""
GRAZING = 0.1
"""Cosine of the angle between normal and Sun below which a surface is not taken as lit."""


@dataclass(frozen=True)
class View:
    """What a frame's picture is compared with: a body.

    Attributes:
        name: of the body.
        is_target: whether it is the target. Another body may look like what it is before, such as a
            mirror before dark panels, so that its edges prove a picture wrong only where they fit
            better elsewhere.
        outline: of its mask.
        lit: (N,) whether the Sun lights the surface at each of its points, as far as the target's own
            shadow is known.
    """

    name: str
    is_target: bool
    outline: Outline
    lit: BoolArray


def views_of(case: Case) -> Iterator[View]:
    """The bodies of a frame whose masks are large enough."""
    labels = case.labels
    depth_m = case.truth.get("depth_m")
    if depth_m is None:
        depth_m = case.hits.depth_m
    sun_cam = case.target.R_cam_from_body @ np.array(labels.sun_direction_body)
    for name, body in labels.instances.items():
        if not body.has("mask_rle"):
            continue
        mask = body.mask_rle.mask()
        if _longest_px(mask) < LEAST_MASK_PX:
            continue
        outline = outline_of(mask)
        lit = _cosine_to_sun(case, mask, depth_m, outline, sun_cam) > GRAZING
        if name is None and case.camera.line_time_s == 0:
            lit &= _out_of_shadow(case, outline)
        yield View(name or labels.spacecraft, name is None, outline, lit)


def _longest_px(mask: BoolArray) -> int:
    sides = [np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1)]
    return max(int(np.ptp(side)) + 1 if len(side) else 0 for side in sides)


def _out_of_shadow(case: Case, outline: Outline) -> BoolArray:
    """(N,) whether no part may be between the Sun and what is just inside each point."""
    column, row = _just_inside(outline, case.target.mask.shape).T
    seen = np.flatnonzero(case.hits.face[row, column] >= 0)
    free = np.zeros(len(outline), dtype=bool)
    if len(seen):
        free[seen] = sunlit(case, row[seen], column[seen])[1]
    return free


def _just_inside(outline: Outline, shape: tuple[int, ...]) -> IntArray:
    """(N, 2) column and row of a pixel within the mask (H, W), not at the image's border."""
    at = np.round(outline.uv_px - 2 * outline.outward).astype(np.int64)
    return np.asarray(np.clip(at, 1, np.array(shape[::-1]) - 2))


def _cosine_to_sun(
    case: Case, mask: BoolArray, depth_m: FloatArray, outline: Outline, sun_cam: FloatArray
) -> FloatArray:
    """(N,) cosine of the Sun's angle to the surface just inside each point, by depths of neighbours."""
    at = _just_inside(outline, mask.shape)

    def points_m(du: int, dv: int) -> FloatArray:
        u, v = at[:, 0] + du, at[:, 1] + dv
        z = np.where(mask[v, u] & np.isfinite(depth_m[v, u]), depth_m[v, u], np.nan)
        return case.camera.rays(np.stack([u, v], axis=-1)) * z[:, None]

    middle = points_m(0, 0)

    def along(du: int, dv: int) -> FloatArray:
        """Difference to the neighbour on the side where the depth changes less."""
        ahead, back = points_m(du, dv) - middle, middle - points_m(-du, -dv)
        is_ahead = _flatness(ahead) <= _flatness(back)
        return np.where(is_ahead[:, None], ahead, back)

    normal = np.cross(along(1, 0), along(0, 1))
    normal *= np.where(normal[:, 2:] > 0, -1.0, 1.0)
    length = np.linalg.norm(normal, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.nan_to_num(normal @ sun_cam / length, nan=0.0))


def _flatness(difference: FloatArray) -> FloatArray:
    return np.asarray(np.nan_to_num(np.abs(difference[:, 2]), nan=np.inf))
