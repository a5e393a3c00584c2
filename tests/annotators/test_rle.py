"""Run-length codes against pycocotools."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools import mask as coco

from posse_core._annotators import rle
from posse_core._model.camera import PixelBox

# pycocotools 2.0.11 on numpy 2.4
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")


@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.tuples(st.integers(1, 300), st.integers(1, 300)),
    density=st.sampled_from([0.0, 0.01, 0.3, 0.99, 1.0]),
)
def test_codes_are_those_of_pycocotools(seed, size, density):
    rng = np.random.default_rng(seed)
    height, width = size
    h, w = rng.integers(1, height + 1), rng.integers(1, width + 1)
    box = PixelBox(int(rng.integers(width - w + 1)), int(rng.integers(height - h + 1)), int(w), int(h))
    mask = np.zeros(size, dtype=bool)
    mask[box.slices] = rng.random((h, w)) < density
    code = rle.encode(mask[box.slices], box, height, width)
    assert code == coco.encode(np.asfortranarray(mask.astype(np.uint8)))["counts"].decode()
    assert (coco.decode({"size": [height, width], "counts": code}) == mask).all()


def test_runs_longer_than_a_million_pixels():
    mask = np.zeros((3000, 4000), dtype=bool)
    mask[:, 1500:2500] = True
    code = rle.encode(mask[:, 1000:3000], PixelBox(1000, 0, 2000, 3000), 3000, 4000)
    assert (coco.decode({"size": [3000, 4000], "counts": code}) == mask).all()


def test_no_craft_in_the_image():
    code = rle.encode(np.zeros((0, 0), dtype=bool), PixelBox(0, 0, 0, 0), 20, 30)
    assert coco.decode({"size": [20, 30], "counts": code}).sum() == 0
