"""Run lengths against pycocotools."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pycocotools import mask as coco_mask

from posse_core._model.run_lengths import RunLengths


@given(arrays(np.bool_, st.tuples(st.integers(1, 40), st.integers(1, 40))))
def test_masks_coded_by_pycocotools(mask):
    rle = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    assert np.array_equal(RunLengths(size=rle["size"], counts=rle["counts"].decode()).mask(), mask)


@pytest.mark.parametrize("shape", [(1, 3000), (3000, 1), (1000, 1000)])
def test_long_runs(shape):
    mask = np.zeros(shape, dtype=bool)
    mask.reshape(-1)[mask.size // 3 : -7] = True
    rle = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    assert np.array_equal(RunLengths(size=rle["size"], counts=rle["counts"].decode()).mask(), mask)


@pytest.mark.parametrize("counts", ["", "o", "04", "5", "\x20", "0N"])
def test_damaged_runs_are_refused(counts):
    with pytest.raises(ValueError, match="run lengths"):
        RunLengths(size=(2, 3), counts=counts).mask()
