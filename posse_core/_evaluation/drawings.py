"""How well a picture is explained by what the Sun would show at the labels' pose.

The drawing has no light but the Sun's: the mean reflectance of each part times the cosine of the Sun's
angle, 0 in shadow. Slopes of its brightness are correlated with those of the picture, over the bodies
and a few pixels around them. Slopes are where outlines, parts, folds and shadows are, so that how bright
a material is matters little. A picture of something else correlates by about 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray
from posse_core._evaluation.case import Case
from posse_core._evaluation.photometry import SATURATED
from posse_core._evaluation.sunlight import sunlit

LEAST_LIT, LEAST_LIT_PX = 0.25, 60
"""Least share, and least number, of the bodies' pixels that the Sun lights. Of fewer the drawing tells
little: what is seen of the others is lit by the Earth and by what stands beside them."""
MOST_SATURATED = 0.3
"""Share of the bodies' pixels that are as white as can be, from which their slopes are lost."""
_LIT = 0.05
"""Light over the brightest, from which a pixel counts as lit."""
_MOST_SIDE_PX = 400
"""Larger bodies are compared in steps of several pixels."""
_AROUND = 8
"""How far around the bodies slopes are compared, in steps."""
_REACH = 7
"""The largest shift that is looked for, in steps."""
_WHITE_PERCENTILE = 99.5
_SMOOTH = 1.0
_FLAT = 1e-6


@dataclass(frozen=True)
class DrawingFit:
    """How well a drawing fits a picture.

    Attributes:
        correlation: of the slopes, −1 to 1.
        shift_px: (2,) shift (u, v) of the picture by which it would be greatest.
        best: the correlation with this shift.
        steps: the shift in steps of the drawing, along the axis on which it is more.
    """

    correlation: float
    shift_px: tuple[int, int]
    best: float
    steps: int


class Drawing:
    """What the Sun would show at a pose."""

    def __init__(self, shown: Float32Array, covered: BoolArray, step_px: int) -> None:
        """Prepare the slopes that pictures are compared with.

        Args:
            shown: (h, w) light, of any scale.
            covered: (h, w) where a body is.
            step_px: side of the squares of the image (H, W) that shown and covered have a value for.
        """
        rows, columns = np.flatnonzero(covered.any(axis=1)), np.flatnonzero(covered.any(axis=0))
        margin = _AROUND + _REACH
        self._top, self._left = int(rows[0]) - margin, int(columns[0]) - margin
        self._size = int(np.ptp(rows)) + 2 * margin + 1, int(np.ptp(columns)) + 2 * margin + 1
        self._step_px = step_px
        self._covered = self._crop(covered.astype(np.float32), "constant") > 0
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _AROUND + 1, 2 * _AROUND + 1))
        near = cv2.dilate(self._covered.astype(np.float32), disc)
        image = cv2.erode(
            self._crop(np.ones(covered.shape, np.float32), "constant"),
            np.ones((3, 3)),
            borderType=cv2.BORDER_CONSTANT,
            borderValue=0,
        )
        middle = slice(_REACH, -_REACH)
        self._weight = np.ascontiguousarray((near * image)[middle, middle])
        slopes = _slopes(self._crop(shown, "edge"), self._covered)[middle, middle]
        inside = self._weight > 0
        centred = (slopes - slopes[inside].mean()) * self._weight
        length = float(np.sqrt((centred**2).sum()))
        self._pattern = np.ascontiguousarray(centred / length) if length > _FLAT else None

    def fit(self, light: Float32Array) -> DrawingFit | None:
        """How well it fits a picture's light (H, W); None where the picture is too bright to tell."""
        if self._pattern is None:
            return None
        step = self._step_px
        height, width = light.shape[0] // step, light.shape[1] // step
        small = cv2.resize(
            light[: height * step, : width * step], (width, height), interpolation=cv2.INTER_AREA
        )
        seen = self._crop(small.astype(np.float32), "edge")
        if (seen[self._covered] >= SATURATED).mean() > MOST_SATURATED:
            return None
        slopes = _slopes(seen, self._covered)
        product, total, squares = (
            cv2.matchTemplate(a, b, cv2.TM_CCORR)
            for a, b in ((slopes, self._pattern), (slopes, self._weight), (slopes**2, self._weight))
        )
        spread = squares - total**2 / float(self._weight.sum())
        found: FloatArray = product / np.sqrt(np.maximum(spread, _FLAT))
        v, u = np.unravel_index(int(found.argmax()), found.shape)
        shift = int(u) - _REACH, int(v) - _REACH
        return DrawingFit(
            correlation=float(found[_REACH, _REACH]),
            shift_px=(shift[0] * step, shift[1] * step),
            best=float(found[v, u]),
            steps=max(abs(each) for each in shift),
        )

    def _crop(self, array: Float32Array, beyond: Literal["edge", "constant"]) -> Float32Array:
        """What is around the bodies of an array (h, w), also beyond the image."""
        (height, width), (top, left) = self._size, (self._top, self._left)
        bottom, right = top + height, left + width
        inside = array[max(top, 0) : bottom, max(left, 0) : right]
        pad = (
            (max(-top, 0), max(bottom - array.shape[0], 0)),
            (max(-left, 0), max(right - array.shape[1], 0)),
        )
        return np.ascontiguousarray(np.pad(inside, pad, mode=beyond))


def drawing_of(case: Case, reflectance: FloatArray) -> Drawing | None:
    """What the Sun shows by a frame's labels; None where that is too little to compare.

    Args:
        case: the frame.
        reflectance: (P,) of each part of the scene, of any scale.
    """
    whole = case.hits.face >= 0
    rows, columns = np.flatnonzero(whole.any(axis=1)), np.flatnonzero(whole.any(axis=0))
    if not len(rows):
        return None
    step = 1 + int(max(np.ptp(rows), np.ptp(columns))) // _MOST_SIDE_PX
    height, width = whole.shape[0] // step, whole.shape[1] // step
    first = step // 2
    covered = whole[first::step, first::step][:height, :width]
    small_row, small_column = np.nonzero(covered)
    if not len(small_row):
        return None
    row, column = first + step * small_row, first + step * small_column
    sun_cam = case.target.R_cam_from_body @ np.array(case.labels.sun_direction_body)
    normal = case.normals_of_faces(case.hits.face[row, column], row)
    rays = case.camera.rays(np.stack([column, row], axis=-1))
    light = np.maximum(-np.sum(normal * sun_cam, axis=1) * np.sign(np.sum(normal * rays, axis=1)), 0)
    if case.camera.line_time_s == 0:
        light *= np.mean(sunlit(case, row, column), axis=0)
    light *= reflectance[case.part_seen[row, column]]
    lit = light > _LIT * np.percentile(light, _WHITE_PERCENTILE)
    if lit.sum() < LEAST_LIT_PX or lit.mean() < LEAST_LIT:
        return None
    shown = np.zeros((height, width), dtype=np.float32)
    shown[small_row, small_column] = light
    return Drawing(shown, covered, step)


def _slopes(light: Float32Array, covered: BoolArray) -> Float32Array:
    """(h, w) how steeply the brightness changes, over that of the brightest of the bodies."""
    white = max(float(np.percentile(light[covered], _WHITE_PERCENTILE)), 1e-9)
    brightness = np.sqrt(np.clip(light / white, 0, 1)).astype(np.float32)
    soft = cv2.GaussianBlur(brightness, (0, 0), _SMOOTH)
    along_u, along_v = cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)
    return np.asarray(np.sqrt(np.hypot(along_u, along_v)), dtype=np.float32)
