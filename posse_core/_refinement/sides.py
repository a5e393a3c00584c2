"""Poses at which the spacecraft looks as it does in an image, from whichever side and under whatever
light: what is tried where the starts lead nowhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import takewhile
from typing import NamedTuple

import cv2
import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._evaluation.poses import pose_errors
from posse_core._frames import turn_rad
from posse_core._refinement.background import continued, near_covered
from posse_core._refinement.compare import SHAPE_NOISE, WINDOW_PX, share_explained
from posse_core._refinement.crop import Crop, Picture, scales
from posse_core._refinement.edges import EDGE_BLUR_PX, edges, evened
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Studio
from posse_core._refinement.views import Laid, Views
from posse_core._refinement.windows import Windows

_AROUND = 0.25
"""What surrounds a box is seen so far beside it, as a share of its sides."""
_ASPECT = 0.25
"""By how much the logarithm of each side of a pose's box may differ from the detected one's, once both
are of the same area."""
_COMPARED = 600
"""So many that are explained best by light that is the same everywhere, or whose edges lie best, are
compared in windows."""
_BY_LIGHT, _BY_EDGES, _BY_BOTH = 14, 5, 14
"""How many poses are found by light, by edges for each size, and by light where edges lie for each
size."""
_LARGER = (1.0, 1.25, 1.6)
"""The length of the spacecraft's box over that of the detected one: detectors often find a part that is
lit, or stands out."""
_OFF = 0.08
"""How far the middle of a box may be off, as a share of its sides."""
_BORDER_PX = 2
"""Of drawings of edges, around the spacecraft."""
_APART_RAD = np.radians(20)
"""Poses that are found in one way differ by more."""
_SAME_RAD, _SAME = np.radians(8), 0.08
"""Those that differ by less, in attitude and as a share of the range, are the same."""
_BESIDE = 0.05
"""The background is seen so far beside a detected box, as a share of its sides."""
_FAINT = 1e-3
"""Channels whose sum of squares is below this explain little."""


class Resembling(NamedTuple):
    """Poses that look as an image does.

    Attributes:
        by_light: whose outlines and creases explain most of the image where the spacecraft was detected.
        by_edges: whose edges lie most as those of the image do, and, of many whose edges do, whose
            outlines and creases explain most; none twice.
    """

    by_light: list[Placement]
    by_edges: list[Placement]


class Sides:
    """Looks of the spacecraft from all sides, drawn when they are first needed.

    Attributes:
        hull_m: (H, 3) those of the spacecraft's vertices that are on its convex hull.
    """

    def __init__(self, studio: Studio, radius_m: float) -> None:
        self._views = Views(studio, radius_m)
        self.hull_m = studio.hull_m

    def resembling(
        self,
        picture: Picture,
        box_px: FloatArray,
        t_body_cam_m: FloatArray,
        size_px: float,
        has_time: Callable[[], bool],
    ) -> Resembling:
        """The poses that look most as an image does: by light, and by edges for each size that the
        spacecraft's box may have.

        Args:
            picture: the image.
            box_px: (4,) in which the spacecraft was detected.
            t_body_cam_m: (3,) where the body's origin is by the keypoints.
            size_px: of the box in the crops that are compared.
            has_time: whether more may be tried.
        """
        found = Resembling([], [])
        for larger in _LARGER:
            size = larger * box_px[2:]
            first = box_px[:2] + box_px[2:] / 2 - size / 2
            scale = scales(float(size.max()), (size_px,))[0]
            crop = picture.around(first - _AROUND * size, first + (1 + _AROUND) * size, scale)
            if crop is None:
                continue
            if larger == 1:
                found.by_light.extend(self.by_light(crop, box_px, t_body_cam_m, _BY_LIGHT, has_time))
            moved = self.by_edges(crop, box_px, larger, has_time)
            both = by_light_in_windows(crop, box_px, moved[:_COMPARED], has_time)
            for each in first_apart(moved, crop, _BY_EDGES) + first_apart(both, crop, _BY_BOTH):
                if not any(_is_same(each, other) for other in found.by_edges):
                    found.by_edges.append(each)
        return found

    def by_light(
        self,
        crop: Crop,
        box_px: FloatArray,
        t_body_cam_m: FloatArray,
        count: int,
        has_time: Callable[[], bool],
    ) -> list[Placement]:
        """The poses whose outlines and creases explain most of a crop, each of another attitude than
        those before.

        Args:
            box_px: (4,) in which the spacecraft was detected. Some poses are tried whose own boxes lie
                there.
            t_body_cam_m: (3,) where the body's origin is by the keypoints. Others are tried there, as
                what is detected may be a part.
            count: most poses that are returned.
            has_time: whether more may be tried.
        """
        middle, size = _box_in(crop, box_px)
        own = _without_background(crop, middle, size)
        if own is None:
            return []
        origin = crop.own_px(crop.camera.project(t_body_cam_m[None])[0])
        tried = [
            laid
            for laid in _while(has_time, self._views.of_area(float(np.prod(size)), middle))
            if abs(np.log(size[0] / laid.box_px[2])) < _ASPECT
        ]
        if np.isfinite(origin).all():
            px_rad = crop.camera.fx_px / crop.scale.finer
            tried += _while(has_time, self._views.at(origin, px_rad / float(t_body_cam_m[2])))
        half = np.asarray(cv2.pyrDown(own), np.float32)
        drawn = (each.halved().channels(half.shape) for each in _while(has_time, tried))
        left = _unexplained(half, drawn)
        best = [tried[k] for k in np.argsort(left)[:_COMPARED]]
        return first_apart(by_light_in_windows(crop, box_px, best, has_time), crop, count)

    def by_edges(
        self, crop: Crop, box_px: FloatArray, larger: float, has_time: Callable[[], bool]
    ) -> list[Laid]:
        """All views in all turns, moved to where their edges lie most as those of a crop do, the
        likeliest first.

        Args:
            box_px: (4,) in which the spacecraft was detected.
            larger: the length of the spacecraft's own box over that of the detected one, which may be
                anywhere in it.
            has_time: whether more may be tried.
        """
        middle, size = _box_in(crop, box_px)
        seen = np.asarray(cv2.pyrDown(evened(edges(crop.seen[..., None], EDGE_BLUR_PX))), np.float32)
        reach = (_OFF * larger + (larger - 1) / 2) * size / 2
        area = float(np.prod(larger * size))
        views = _while(has_time, self._views.of_area(area, middle))
        placed = [_placed(each, seen, reach) for each in views]
        return [laid for _, laid in sorted(placed, key=lambda each: -each[0])]


def by_light_in_windows(
    crop: Crop, box_px: FloatArray, laid: Sequence[Laid], has_time: Callable[[], bool]
) -> list[Laid]:
    """Views by how much of what varies in a crop's windows they explain, that which explains most first;
    none where the crop shows nothing beside the detected box (4,)."""
    own = _without_background(crop, *_box_in(crop, box_px))
    if own is None:
        return []
    shares = [_share(own, each.channels(own.shape), crop) for each in _while(has_time, laid)]
    return [laid[k] for k in np.argsort(shares)[::-1]]


def first_apart(laid: Iterable[Laid], crop: Crop, count: int) -> list[Placement]:
    """The first poses of views, each of another attitude than those before."""
    found: list[Placement] = []
    for each in laid:
        place = each.placement(crop)
        turns = [turn_rad(place.R_cam_from_body, other.R_cam_from_body) for other in found]
        if all(turn > _APART_RAD for turn in turns):
            found.append(place)
        if len(found) == count:
            break
    return found


def _while(has_time: Callable[[], bool], laid: Iterable[Laid]) -> Iterator[Laid]:
    return takewhile(lambda _: has_time(), laid)


def _is_same(one: Placement, other: Placement) -> bool:
    e_t, e_q_rad = pose_errors(*one, *other)
    return e_t < _SAME and e_q_rad < _SAME_RAD


def _box_in(crop: Crop, box_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The middle and the size (2,) of a box of the image (4,), in a crop's pixels."""
    middle = crop.own_px((box_px[:2] + box_px[2:] / 2) * crop.scale.drawn - 0.5)
    return middle, box_px[2:] / crop.scale.binned


def _placed(laid: Laid, seen: Float32Array, reach: FloatArray) -> tuple[float, Laid]:
    """A view moved to where its edges are most alike with those of an image.

    Args:
        laid: the view, in an image of twice as many pixels to each side.
        seen: (h, w, 3) edges of the image.
        reach: (2,) how far it may be moved, in the image's pixels.

    Returns:
        The correlation there, -1 … 1, and the view moved.
    """
    there = laid.halved()
    size = np.ceil(there.box_px[2:]).astype(int) + 2 * _BORDER_PX
    corner = np.rint(there.box_px[:2]).astype(int) - _BORDER_PX
    drawn = there.shifted(-corner).edges((int(size[1]), int(size[0])))
    most = np.ceil(reach).astype(int)
    first, last = corner - most, corner + size + most
    height, width = seen.shape[:2]
    # Beyond the image there are no edges.
    beyond = [max(0, -first[1]), max(0, last[1] - height), max(0, -first[0]), max(0, last[0] - width)]
    part = seen[max(0, first[1]) : max(0, last[1]), max(0, first[0]) : max(0, last[0])]
    if not part.size:
        return -1.0, laid
    above, below, left, right = map(int, beyond)
    padded = cv2.copyMakeBorder(part, above, below, left, right, cv2.BORDER_CONSTANT, value=0)
    alike = cv2.matchTemplate(padded, drawn, cv2.TM_CCOEFF_NORMED)
    row, column = np.unravel_index(int(np.argmax(alike)), alike.shape)
    return float(alike[row, column]), laid.shifted(2.0 * (np.array([column, row]) - most))


def _without_background(crop: Crop, middle: FloatArray, size: FloatArray) -> Float32Array | None:
    """What is seen in a crop beyond what surrounds a box, continued into it; None if nothing surrounds
    it."""
    first = middle - (size - 1) / 2
    low = np.floor(first - _BESIDE * size).astype(int)
    high = np.ceil(first + (1 + _BESIDE) * size).astype(int)
    free = np.ones_like(crop.seen)
    free[max(0, low[1]) : max(0, high[1]), max(0, low[0]) : max(0, high[0])] = 0
    if not free.any():
        return None
    return np.asarray(crop.seen - continued(crop.seen * free, free), np.float32)


def _unexplained(own: Float32Array, drawn: Iterable[Float32Array]) -> FloatArray:
    """(N,) the sums of squares that light leaves of an image (h, w), if it is the same everywhere and
    known to Lambert's law but for what it does not reach.

    Args:
        drawn: N × (h, w, 4) channels of the views.
    """
    y = own.ravel().astype(np.float64)
    squares, products = [], []
    for channels in drawn:
        X = channels.reshape(len(y), -1).astype(np.float64)
        squares.append(X.T @ X)
        products.append(X.T @ y)
    if not products:
        return np.zeros(0)
    b = np.array(products)
    strength = np.linalg.solve(np.array(squares) + _FAINT * np.eye(b.shape[1]), b[..., None])[..., 0]
    return np.asarray(y @ y - np.sum(strength * (b + _FAINT * strength), axis=1))


def _share(own: Float32Array, channels: Float32Array, crop: Crop) -> float:
    """How much of what varies in windows is explained, 0 … 1."""
    near = near_covered(channels[..., 0])
    windows = Windows(near.astype(np.float32), WINDOW_PX)
    left = windows.explained(own, channels[..., :3], SHAPE_NOISE).residual
    return share_explained(left, windows.variance(own), near, crop.beside(near))
