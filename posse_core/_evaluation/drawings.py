"""How well a picture is explained by what light would show at the labels' pose.

A body is drawn in two lights: the Sun's, by the mean reflectance of each part times the cosine of the
Sun's angle, 0 in shadow; and a light from all around, by the cosine of the angle at which it is seen,
for what Earth, sky and light boxes show. Slopes of the brightness are correlated with those of the
picture, over the body and a few pixels around it, in the mix of the two that correlates most. Slopes
are where outlines, parts, folds and shadows are, so that how bright a material is matters little. Of a
slope only its line counts and not its sign, since what is behind a body may be darker or brighter than
it. A picture of something else correlates by about 0: its slopes run across those of the drawing as
often as along them.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray, Float32Array, FloatArray
from posse_core._evaluation.case import Case
from posse_core._evaluation.sunlight import sunlit

LEAST_PX = 60
"""Least number of pixels of a body that is drawn."""
_LIT = 0.05
"""Light over the brightest, from which a pixel counts as lit."""
_AROUND = 8
"""How far around a body slopes are compared, pixels."""
REACH_PX = 7
"""The largest shift that is looked for."""
SHIFT_PX, IS_SHIFTED_PX = 2, 1.25
"""The shift that a proven picture would not hide; and the least place of the best correlation, along
either axis and between pixels, that is a shift: it may be half a pixel off."""
_SMOOTH_PX = 1.0
_FLAT = 1e-9
_ALIKE = 0.999
"""Correlation of the two lights' drawings, from which they are one."""
_ONES = (-1, 0, 1)
_SHIFTS = tuple((SHIFT_PX * u, SHIFT_PX * v) for v in _ONES for u in _ONES if u or v)
"""By what (u, v) a picture is shifted that a drawing must tell, pixels."""


class Slopes:
    """Slopes of the brightness of a picture, without their sign.

    Attributes:
        field: (2, H, W) cosine and sine of twice the slope's angle, times the root of its steepness.
    """

    def __init__(self, light: Float32Array) -> None:
        """Of a picture's light (H, W), of any scale."""
        brightness = np.sqrt(np.maximum(light, 0)).astype(np.float32)
        soft = cv2.GaussianBlur(brightness, (0, 0), _SMOOTH_PX)
        along_u, along_v = cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)
        scale = np.maximum(np.hypot(along_u, along_v), _FLAT) ** -1.5
        along = (along_u**2 - along_v**2) * scale, 2 * along_u * along_v * scale
        self.field: Float32Array = np.stack(along).astype(np.float32)

    def mirrored(self, x: bool, y: bool) -> Slopes:
        """The slopes of the picture's mirror image."""
        other = Slopes.__new__(Slopes)
        sign = np.array([1, -1 if x != y else 1], dtype=np.float32)[:, None, None]
        other.field = sign * self.field[:, :: -1 if y else 1, :: -1 if x else 1]
        return other


@dataclass(frozen=True)
class DrawingFit:
    """How well a drawing fits a picture.

    Attributes:
        correlation: of the slopes, 0 to 1.
        shift_px: (2,) shift (u, v) of the picture by which it would be greatest, between pixels.
        best: the correlation with this shift.
        sharpness: by how much it exceeds that with another shift which would be taken for the right one,
            if the picture were shifted by :data:`SHIFT_PX` along either axis or both; the least of them,
            and 0 if the shift would not be told.
    """

    correlation: float
    shift_px: tuple[float, float]
    best: float
    sharpness: float

    @property
    def is_shifted(self) -> bool:
        """Whether the shift is one."""
        return _is_shift(*self.shift_px)


def _is_shift(u_px: float, v_px: float) -> bool:
    return max(abs(u_px), abs(v_px)) >= IS_SHIFTED_PX


def _summit(values: FloatArray) -> float:
    """Where a parabola through three values is highest, from the middle one; 0 of fewer."""
    if len(values) < 3:
        return 0.0
    before, middle, after = (float(value) for value in values)
    bend = before - 2 * middle + after
    return (before - after) / (2 * bend) if bend < 0 else 0.0


class Drawing:
    """What light would show of a body at a pose.

    Attributes:
        px: number of the body's pixels.
        lit_px: how many of them the Sun lights.
        brightness: how bright the Sun makes the middle one of them, over a white plate that faces it.
    """

    def __init__(self, by_sun: Float32Array, all_around: Float32Array, covered: BoolArray) -> None:
        """Prepare the slopes that pictures are compared with.

        Args:
            by_sun, all_around: (H, W) the scene in the light of the Sun and in light from all around.
            covered: (H, W) where the body is; somewhere.
        """
        rows, columns = np.flatnonzero(covered.any(axis=1)), np.flatnonzero(covered.any(axis=0))
        bottom, right = covered.shape
        margin = _AROUND + 2  # two more for the slopes of the drawing
        self._rows = slice(max(int(rows[0]) - margin, 0), min(int(rows[-1]) + margin + 1, bottom))
        self._columns = slice(
            max(int(columns[0]) - margin, 0), min(int(columns[-1]) + margin + 1, right)
        )
        here = self._rows, self._columns
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _AROUND + 1, 2 * _AROUND + 1))
        inside = np.zeros(covered.shape, dtype=np.float32)
        inside[1:-1, 1:-1] = 1  # at the border slopes are cut
        self._near = np.ascontiguousarray(
            cv2.dilate(covered[here].astype(np.float32), disc) * inside[here]
        )
        drawn = [Slopes(np.ascontiguousarray(light[here])).field for light in (by_sun, all_around)]
        lengths = [float(np.sqrt((field**2 * self._near).sum())) for field in drawn]
        self._patterns = [
            field * self._near / length
            for field, length in zip(drawn, lengths, strict=True)
            if length > _FLAT
        ]
        self._alike = float((self._patterns[0] * self._patterns[-1]).sum()) if self._patterns else 0.0
        own = by_sun[covered]
        self.px = len(own)
        lit = own[own > max(_LIT * float(own.max()), _FLAT)]
        self.lit_px = len(lit)
        self.brightness = float(np.median(lit)) if len(lit) else 0.0

    def correlation(self, slopes: Slopes) -> float:
        """Of the slopes of a picture with the drawing's, where it is."""
        field = slopes.field[:, self._rows, self._columns]
        seen = float(((field**2).sum(axis=0) * self._near).sum())
        products = np.array([float((field * pattern).sum()) for pattern in self._patterns])
        return float(self._mixed(products[:, None, None], np.array([[seen]]))[0, 0])

    def fit(self, slopes: Slopes) -> DrawingFit:
        """How well it fits a picture, shifted as is best."""
        field = np.ascontiguousarray(self._around(slopes.field))
        steepness = np.asarray((field**2).sum(axis=0))
        seen = cv2.matchTemplate(steepness, self._near, cv2.TM_CCORR)
        products = [
            cv2.matchTemplate(field[0], pattern[0], cv2.TM_CCORR)
            + cv2.matchTemplate(field[1], pattern[1], cv2.TM_CCORR)
            for pattern in self._patterns
        ]
        found = self._mixed(np.array(products, dtype=np.float64), seen)
        v, u = np.unravel_index(int(found.argmax()), found.shape)
        u_px = int(u) - REACH_PX + _summit(found[v, max(u - 1, 0) : u + 2])
        v_px = int(v) - REACH_PX + _summit(found[max(v - 1, 0) : v + 2, u])
        best = float(found[v, u])
        drops = [
            best - float(found[REACH_PX - by_v, REACH_PX - by_u])
            if _is_shift(u_px + by_u, v_px + by_v)
            else 0.0
            for by_u, by_v in _SHIFTS
        ]
        return DrawingFit(float(found[REACH_PX, REACH_PX]), (u_px, v_px), best, min(drops))

    def _around(self, field: Float32Array) -> Float32Array:
        """The field (2, H, W) as far as shifts reach, 0 beyond the image."""
        height, width = field.shape[1:]
        ends = (self._rows, height), (self._columns, width)
        cut = [slice(max(s.start - REACH_PX, 0), min(s.stop + REACH_PX, size)) for s, size in ends]
        pad = [(max(REACH_PX - s.start, 0), max(s.stop + REACH_PX - size, 0)) for s, size in ends]
        return np.pad(field[:, cut[0], cut[1]], [(0, 0), *pad])

    def _mixed(self, products: FloatArray, seen: AnyArray) -> FloatArray:
        """(h, w) correlation with the mix of the drawings, none of them negative, that correlates most.

        Args:
            products: (P, h, w) of each drawing's slopes with the picture's.
            seen: (h, w) squares of the picture's.
        """
        if not len(products):
            return np.zeros(seen.shape)
        most = np.maximum(products.max(axis=0), 0)
        if len(products) == 2 and self._alike < _ALIKE:
            one, other = products
            shares = one - self._alike * other, other - self._alike * one
            both = (shares[0] * one + shares[1] * other) / (1 - self._alike**2)
            is_mix = (shares[0] > 0) & (shares[1] > 0)
            most = np.where(is_mix, np.sqrt(np.maximum(both, 0)), most)
        return np.asarray(most / np.sqrt(np.maximum(seen, _FLAT)))


@dataclass(frozen=True)
class Scene:
    """What light shows of a frame by its labels.

    Attributes:
        drawings: of each body that is large enough, by its name; the target's is empty.
        sunlit: (H, W) cosine of the Sun's angle, 0 in shadow and where no body is.
    """

    drawings: dict[str, Drawing]
    sunlit: Float32Array


def scene_of(case: Case, reflectance: FloatArray) -> Scene:
    """What light shows by a frame's labels.

    Args:
        case: the frame.
        reflectance: (P,) of each part of the scene.
    """
    cosines = [np.zeros(case.hits.face.shape, dtype=np.float32) for _ in range(2)]
    row, column = np.nonzero(case.hits.face >= 0)
    sun_cam = case.target.R_cam_from_body @ np.array(case.labels.sun_direction_body)
    normal = case.normals_of_faces(case.hits.face[row, column], row)
    rays = case.camera.rays(np.stack([column, row], axis=-1))
    towards = np.sum(normal * rays, axis=1)
    by_sun = np.maximum(-np.sum(normal * sun_cam, axis=1) * np.sign(towards), 0)
    if case.camera.line_time_s == 0 and len(row):
        by_sun *= np.mean(sunlit(case, row, column), axis=0)
    cosines[0][row, column] = by_sun
    cosines[1][row, column] = np.abs(towards) / np.linalg.norm(rays, axis=1)
    shares = np.append(reflectance, 0).astype(np.float32)[case.part_seen]
    lights = [shares * cosine for cosine in cosines]
    drawings = {}
    for body in case.bodies:
        covered: BoolArray = case.body_seen == body.number
        if covered.sum() >= LEAST_PX:
            drawings[body.name] = Drawing(lights[0], lights[1], covered)
    return Scene(drawings, cosines[0])
