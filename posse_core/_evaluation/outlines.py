"""How well the outline of a mask fits the edges of a picture.

Along the normal of each point of the outline the light is compared on both sides. What a point sees is
divided by the strongest edge within its reach, so that a dark and a bright part of the spacecraft count
the same, and so does what is behind it. The mean of this over the reach is what an outline of something
else would give, whatever is in the picture: clouds, stars, or another frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray, IntArray

REACH_PX = 8.0
"""How far an edge is looked for on either side of the outline."""
SHIFTS_PX = 7
"""The largest shift of the picture that is looked for, along each axis."""
_STEP_PX = 0.5
_SIDE_PX = 1.5
"""Length of the two stretches whose mean light is compared."""
_BORDER_PX = 3
"""The image's border cuts the mask there, which is no edge."""
_THICKNESS_PX = 2.5
"""Where the spacecraft or the gap beside it is thinner, two edges are too near each other to be told."""
_MOST_POINTS = 500
LEAST_POINTS = 12
_NEIGHBOURS = 5.0
"""Points that see about the same, since they are a pixel apart and the light is smeared by the lens."""
_EXPECTED = 0.75
"""What the edge itself gives on the average, over the strongest one within reach."""
_NOISES, _LEAST_STEP = 6.0, 0.0006
"""How strong an edge must be, over the noise and as a share of white, to be one."""

_ALONG = np.arange(-REACH_PX - 3, REACH_PX + 3 + 1e-9, _STEP_PX)
_REACH = slice(round(3 / _STEP_PX), round((2 * REACH_PX + 3) / _STEP_PX) + 1)
_AT_ZERO = round(REACH_PX / _STEP_PX)
_SHIFTS = np.moveaxis(np.mgrid[-SHIFTS_PX : SHIFTS_PX + 1, -SHIFTS_PX : SHIFTS_PX + 1], 0, -1).reshape(
    -1, 2
)
_UNSHIFTED = len(_SHIFTS) // 2


@dataclass(frozen=True)
class Outline:
    """Points (N) of the outline of a mask.

    Attributes:
        uv_px: (N, 2) positions, on the border between inside and outside.
        outward: (N, 2) unit normals.
        deep: (N,) whether the mask is thicker behind the point than an edge is looked for.
    """

    uv_px: FloatArray
    outward: FloatArray
    deep: BoolArray

    def __len__(self) -> int:
        return len(self.uv_px)

    def of(self, chosen: BoolArray) -> Outline:
        """Some of the points."""
        return Outline(self.uv_px[chosen], self.outward[chosen], self.deep[chosen])

    def mirrored(self, shape: tuple[int, int], x: bool, y: bool) -> Outline:
        """The outline in a picture (H, W) that is mirrored."""
        sign = np.array([-1.0 if x else 1.0, -1.0 if y else 1.0])
        size = np.array([shape[1] - 1.0 if x else 0.0, shape[0] - 1.0 if y else 0.0])
        return Outline(size + sign * self.uv_px, sign * self.outward, self.deep)


@dataclass(frozen=True)
class Fit:
    """How well an outline fits a picture: 0 as an outline of something else would on the average, and
    about 1 if it is the picture's.

    Attributes:
        share: of the expected fit.
        power: the expected fit, over the scatter of that of an outline of something else.
        shift_px: (2,) shift (u, v) of the picture by which the outline would fit best.
        gain: by how much it would fit better then, over the scatter of that gain.
        best: the share with this shift.
    """

    share: float
    power: float
    shift_px: tuple[int, int]
    gain: float
    best: float


def outline_of(mask: BoolArray) -> Outline:
    """The outline of a mask (H, W), without the image's border and where it is thin."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return Outline(np.empty((0, 2)), np.empty((0, 2)), np.empty(0, dtype=bool))
    margin = 8
    top, left = max(rows[0] - margin, 0), max(columns[0] - margin, 0)
    crop = mask[top : rows[-1] + margin + 1, left : columns[-1] + margin + 1]
    padded = np.pad(crop, 1, mode="edge")
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    v, u = np.nonzero(crop & ~inner)
    inside = (
        (u + left >= _BORDER_PX)
        & (v + top >= _BORDER_PX)
        & (u + left < mask.shape[1] - _BORDER_PX)
        & (v + top < mask.shape[0] - _BORDER_PX)
    )
    v, u = v[inside], u[inside]
    soft = cv2.GaussianBlur(crop.astype(np.float32), (0, 0), 1.5, borderType=cv2.BORDER_REPLICATE)
    slopes = [cv2.Sobel(soft, cv2.CV_32F, i, 1 - i, ksize=3)[v, u] / 8.0 for i in (1, 0)]
    outward = -np.stack(slopes, axis=1).astype(np.float64)
    steepness = np.linalg.norm(outward, axis=1)
    clear = steepness > 0.08
    v, u, steepness = v[clear], u[clear], steepness[clear]
    outward = outward[clear] / steepness[:, None]
    # The border is where half of the smeared mask is inside.
    beyond = np.clip((soft[v, u] - 0.5) / steepness, -1, 1)
    uv = np.stack([u, v], axis=1) + beyond[:, None] * outward

    def within(distance_px: float) -> BoolArray:
        at = np.round(uv + distance_px * outward).astype(np.int64)
        limit = np.array(crop.shape[::-1]) - 1
        column, row = np.clip(at, 0, limit).T
        return np.asarray(crop[row, column])

    thick = within(-_SIDE_PX) & within(-_THICKNESS_PX) & ~within(_SIDE_PX) & ~within(_THICKNESS_PX)
    chosen = np.flatnonzero(thick)
    chosen = chosen[:: max(1, -(-len(chosen) // _MOST_POINTS))]
    deep = within(-REACH_PX / 2) & within(-REACH_PX)
    return Outline(uv[chosen] + [left, top], outward[chosen], deep[chosen])


class Edges:
    """The light (H, W) along the normals of the N points of an outline."""

    def __init__(self, light: Float32Array, outline: Outline, noise: float) -> None:
        """noise: of the light, standard deviation."""
        self.outline = outline
        uv = outline.uv_px[:, None] + _ALONG[:, None] * outline.outward[:, None]
        u, v = np.moveaxis(uv, -1, 0).astype(np.float32)
        self._light: Float32Array = np.empty((0, len(_ALONG)), np.float32)
        if len(outline):
            seen = cv2.remap(light, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            self._light = seen.astype(np.float32)
        height, width = light.shape
        self._complete = ((u >= 0) & (v >= 0) & (u <= width - 1) & (v <= height - 1)).all(axis=1)
        self._noise = noise

    @cached_property
    def beside(self) -> FloatArray:
        """(N,) least light outside the outline."""
        outside = (_ALONG >= 2.5) & (_ALONG <= REACH_PX)
        return np.asarray(self._light[:, outside].min(axis=1), dtype=np.float64)

    def fit(self, chosen: BoolArray) -> Fit | None:
        """How well some of the points (N,) fit; None where too few of them see an edge."""
        steps = _steps(self._light[chosen])
        strongest = steps.max(axis=1, initial=0)
        seen = (strongest > max(_NOISES * self._noise, _LEAST_STEP)) & self._complete[chosen]
        if seen.sum() < LEAST_POINTS:
            return None
        steps = steps[seen] / strongest[seen, None]
        outward = self.outline.outward[chosen][seen]
        usual = steps.mean(axis=1)
        scatter = float(np.sqrt(_NEIGHBOURS * steps.var(axis=1).sum()))
        expected = float((_EXPECTED - usual).sum())
        if scatter == 0 or expected <= 0:
            return None
        fits = _shifted(steps, outward) - usual[:, None]
        sums = fits.sum(axis=0)
        best = int(sums.argmax())
        gains = fits[:, best] - fits[:, _UNSHIFTED]
        spread = float(np.sqrt(_NEIGHBOURS * (gains**2).sum()))
        return Fit(
            share=float(sums[_UNSHIFTED]) / expected,
            power=expected / scatter,
            shift_px=(int(_SHIFTS[best, 0]), int(_SHIFTS[best, 1])),
            gain=float(gains.sum()) / spread if spread else 0.0,
            best=float(sums[best]) / expected,
        )


def _steps(light: Float32Array) -> FloatArray:
    """(N, L) light along normals → (N, K) difference of the means on the two sides, within reach."""
    length = round(_SIDE_PX / _STEP_PX)
    total = np.cumsum(np.pad(light.astype(np.float64), ((0, 0), (1, 0))), axis=1)
    at: IntArray = np.arange(len(_ALONG))[_REACH]
    before = total[:, at] - total[:, at - length]
    after = total[:, at + length + 1] - total[:, at + 1]
    return np.asarray(np.abs(before - after) / length)


def _shifted(steps: FloatArray, outward: FloatArray) -> FloatArray:
    """(N, S) what the points see if the picture is shifted; an edge looks the same along itself."""
    along_px = outward @ _SHIFTS.T
    at = np.round(along_px / _STEP_PX).astype(np.int64) + _AT_ZERO
    seen = np.take_along_axis(steps, np.clip(at, 0, steps.shape[1] - 1), axis=1)
    return np.where(np.abs(along_px) <= REACH_PX, seen, steps.mean(axis=1, keepdims=True))
