"""Remarks on frames: what is true first, from labels where they say it, else from the craft's pixels."""

import numpy as np
import pycocotools.mask
import pytest

from posse_core._dataset.remarks import Remark, dark_share, remark_on, saturated_share
from posse_core._model.label_line import LabelLine, RunLengths

CRAFT = np.zeros((20, 30), dtype=np.uint8)
CRAFT[5:15, 10:20] = 1  # a hundred pixels


def labels(*, target: float = 1.0, camera: float = 1.0, mask: np.ndarray | None = CRAFT) -> LabelLine:
    known = LabelLine(index=0, sun_fraction_target=target, sun_fraction_camera=camera)
    if mask is None:
        return known
    code = pycocotools.mask.encode(np.asfortranarray(mask))
    runs = RunLengths(size=tuple(code["size"]), counts=code["counts"].decode())
    return known.model_copy(update={"mask_rle": runs, "mask_area_px": int(mask.sum())})


def image(bright: int, dn: int, others: int, *, dtype: type = np.uint8, background: int = 0):
    """An image of which so many pixels of the craft have one value, and its others another."""
    shown = np.full(CRAFT.shape, background, dtype=dtype)
    shown[CRAFT == 1] = [dn] * bright + [others] * (100 - bright)
    return shown


GREY = image(100, 120, 0)


@pytest.mark.parametrize(
    ("fractions", "expected"),
    [
        ((1.0, 1.0), None),
        ((0.5, 0.5), None),
        ((0.49, 1.0), Remark.IN_ECLIPSE),
        ((1.0, 0.49), Remark.IN_ECLIPSE),
        ((0.0, 0.0), Remark.IN_ECLIPSE),
    ],
)
def test_a_frame_is_in_eclipse_below_half_of_the_disc(fractions, expected):
    target, camera = fractions
    assert remark_on(labels(target=target, camera=camera), GREY) is expected
    assert remark_on(labels(target=target, camera=camera, mask=None), GREY) is expected


def test_an_empty_mask_is_off_image_even_in_eclipse():
    empty = np.zeros_like(CRAFT)
    assert remark_on(labels(mask=empty), GREY) is Remark.OFF_IMAGE
    assert remark_on(labels(mask=empty, target=0.0), GREY) is Remark.OFF_IMAGE


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_craft_is_dark_if_over_nine_tenths_are_below_a_twentieth_of_the_scale(dtype):
    full = np.iinfo(dtype).max
    low, high = int(0.04 * full), int(0.3 * full)
    bright_sky = {"dtype": dtype, "background": full}
    assert remark_on(labels(), image(2, high, low, **bright_sky)) is Remark.DARK
    assert remark_on(labels(), image(20, high, low, **bright_sky)) is None


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_craft_is_saturated_if_a_tenth_reaches_the_full_scale(dtype):
    full = np.iinfo(dtype).max
    assert remark_on(labels(), image(10, full, full // 2, dtype=dtype)) is Remark.SATURATED
    assert remark_on(labels(), image(9, full, full // 2, dtype=dtype)) is None
    dark_sky = image(10, int(0.97 * full), full // 2, dtype=dtype)
    assert remark_on(labels(), dark_sky) is None


def test_one_saturated_channel_saturates_a_pixel():
    colour = np.stack([GREY, image(10, 255, 120), image(100, 90, 0)], axis=-1)
    assert remark_on(labels(), colour) is Remark.SATURATED
    split = np.stack([image(5, 255, 120), np.flip(image(5, 255, 120)), GREY], axis=-1)
    assert remark_on(labels(), split) is Remark.SATURATED  # five pixels in one channel, five in another


def test_a_bright_background_does_not_saturate_a_craft():
    assert remark_on(labels(), image(100, 120, 0, background=255)) is None


def test_without_a_mask_only_an_eclipse_is_known():
    assert remark_on(labels(mask=None), np.zeros((20, 30), dtype=np.uint8)) is None


def test_shares_count_pixels_and_not_their_channels():
    craft = np.array([[0, 0, 0], [0, 0, 200], [255, 0, 0], [0, 0, 9]], dtype=np.uint8)
    assert dark_share(craft) == 0.5
    assert saturated_share(craft) == 0.25
    assert dark_share(craft[:, 2]) == 0.75
