"""Keypoints that are sought in an image turned by quarter turns, where a network errs in other ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._interfaces.detector import Detection, KeypointFinder, KeypointPlaces

_QUARTER = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""How :func:`numpy.rot90` moves pixels about the middle of an image: (2, 2), of u and v."""


def seen_turned(finder: KeypointFinder, image: AnyArray, found: Detection) -> Detection | None:
    """Find the keypoints of a detection in the image turned by one, two and three quarter turns too.

    Args:
        finder: of keypoints.
        image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        found: what the finder found in the image as it is.

    Returns:
        The detection with the places of all four looks, a quarter of each look's share being theirs;
        None from a finder that gives no places, or does not know a spacecraft turned by any angle.
    """
    if not finder.knows_any_roll or found.places is None:
        return None
    looks = [found.places]
    for quarters in (1, 2, 3):
        turn = _Turn.of(image, quarters)
        (there,) = finder.find(turn.image, [replace(found, box_px=turn.box_into(found.box_px))])
        if there.places is None:
            return None
        looks.append(replace(there.places, points_px=turn.points_back(there.places.points_px)))
    return replace(found, places=_together(looks))


def _together(looks: Sequence[KeypointPlaces]) -> KeypointPlaces:
    """The places of several looks at the same keypoints, each look counting as much."""
    points_px, sigma_px, share = (
        np.concatenate([getattr(look, name) for look in looks], axis=1)
        for name in ("points_px", "sigma_px", "share")
    )
    return KeypointPlaces(points_px, sigma_px, share / len(looks))


@dataclass(frozen=True)
class _Turn:
    """An image that is turned anticlockwise.

    Attributes:
        image: the turned image.
        R: (2, 2) turns u and v from the middle of the image as it was.
        middle_px, turned_middle_px: (2,) the middles of both images.
    """

    image: AnyArray
    R: FloatArray
    middle_px: FloatArray
    turned_middle_px: FloatArray

    @classmethod
    def of(cls, image: AnyArray, quarters: int) -> _Turn:
        turned = np.rot90(image, quarters)
        R = np.linalg.matrix_power(_QUARTER, quarters)
        middle_px, turned_middle_px = ((np.array(each.shape[1::-1]) - 1) / 2 for each in (image, turned))
        return cls(turned, R, middle_px, turned_middle_px)

    def box_into(self, box_px: FloatArray) -> FloatArray:
        """A box (4,) of the image as it was, in the turned one."""
        size_px = np.abs(self.R @ box_px[2:])
        from_middle_px = box_px[:2] + (box_px[2:] - 1) / 2 - self.middle_px
        corner_px = self.R @ from_middle_px + self.turned_middle_px - (size_px - 1) / 2
        return np.concatenate([corner_px, size_px])

    def points_back(self, points_px: FloatArray) -> FloatArray:
        """Points (..., 2) of the turned image, in the image as it was."""
        return np.asarray((points_px - self.turned_middle_px) @ self.R + self.middle_px)
