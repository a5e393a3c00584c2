"""Remarks on frames that are of little use to many: in eclipse, dark, saturated, without the craft."""

from __future__ import annotations

from enum import Enum

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._model.label_line import LabelLine

ECLIPSE_DISC_SHARE = 0.5
"""Visible share of the Sun's disc below which a frame is in eclipse."""
DARK_PIXEL_SHARE, DARK_LEVEL_SHARE = 0.9, 0.05
"""A spacecraft is dark if this share of its pixels is below this share of the full scale."""
SATURATED_PIXEL_SHARE, SATURATED_LEVEL_SHARE = 0.1, 0.98
"""A spacecraft is saturated if this share of its pixels reaches this share of the full scale in some
channel. It is below 1 because read noise lowers a full pixel as often as it raises it."""


class Remark(Enum):
    """What is remarkable about a frame, in words that complete "9 frames are ...".

    A frame has the first that is true of it, in this order.
    """

    OFF_IMAGE = "off-image"
    IN_ECLIPSE = "in eclipse"
    DARK = "dark"
    SATURATED = "saturated"


def remark_on(labels: LabelLine, image: AnyArray) -> Remark | None:
    """The remark on a frame with an image (H, W) or (H, W, 3), uint8 or uint16; None for nothing.

    Without the labels of the mask, only an eclipse is known.
    """
    if labels.has("mask_area_px") and labels.mask_area_px == 0:
        return Remark.OFF_IMAGE
    if in_eclipse(labels):
        return Remark.IN_ECLIPSE
    if not labels.has("mask_rle"):
        return None
    craft = image[labels.mask_rle.mask()]
    if is_dark(craft):
        return Remark.DARK
    return Remark.SATURATED if saturated_share(craft) >= SATURATED_PIXEL_SHARE else None


def in_eclipse(labels: LabelLine) -> bool:
    """Whether less than half of the Sun's disc is visible from the target or from the camera."""
    return min(labels.sun_fraction_target, labels.sun_fraction_camera) < ECLIPSE_DISC_SHARE


def is_dark(craft: AnyArray) -> bool:
    """Whether the pixels of a spacecraft, (N,) or (N, 3) digital numbers, N > 0, are dark."""
    dark_dn = DARK_LEVEL_SHARE * np.iinfo(craft.dtype).max
    return bool(np.quantile(craft, DARK_PIXEL_SHARE) < dark_dn)


def dark_share(craft: AnyArray) -> float:
    """Share of a spacecraft's pixels, (N,) or (N, 3), N > 0, that are dark in all channels."""
    dark = craft < DARK_LEVEL_SHARE * np.iinfo(craft.dtype).max
    return float(dark.reshape(len(craft), -1).all(axis=1).mean())


def saturated_share(craft: AnyArray) -> float:
    """Share of a spacecraft's pixels, (N,) or (N, 3), N > 0, that are saturated in some channel."""
    full = craft >= SATURATED_LEVEL_SHARE * np.iinfo(craft.dtype).max
    return float(full.reshape(len(craft), -1).any(axis=1).mean())
