"""PNG and .npz files that were compressed by ISA-L, read by OpenCV's libpng, zipfile and NumPy."""

import io
import zipfile

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from posse_core._files.compressed import npz, png

SIDES = st.integers(1, 9)


@given(
    image=st.one_of(st.tuples(SIDES, SIDES), st.tuples(SIDES, SIDES, st.just(3))).flatmap(
        lambda shape: arrays.arrays(st.sampled_from([np.uint8, np.uint16]), shape)
    )
)
def test_opencv_reads_the_image(image) -> None:
    read = cv2.imdecode(np.frombuffer(png(image), np.uint8), cv2.IMREAD_UNCHANGED)
    assert read.dtype == image.dtype
    np.testing.assert_array_equal(read if image.ndim == 2 else read[..., ::-1], image)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_large_image_of_noise_and_a_part_of_one(dtype) -> None:
    noise = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, (700, 900, 3), dtype)
    for image in (noise, noise[5:600:2, ::-3]):
        read = cv2.imdecode(np.frombuffer(png(image), np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(read[..., ::-1], image)


@given(
    members=st.dictionaries(
        st.text("abcxyzäß_0123456789", min_size=1, max_size=8),
        arrays.arrays(
            st.sampled_from([np.float32, np.float64, np.int16, np.bool_]),
            arrays.array_shapes(min_dims=2, max_dims=3),
        ),
        max_size=4,
    )
)
def test_numpy_and_zipfile_read_the_arrays(members) -> None:
    file = npz(members)
    assert file == npz({name: array.copy() for name, array in members.items()})
    with zipfile.ZipFile(io.BytesIO(file)) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == [f"{name}.npy" for name in members]
    read = np.load(io.BytesIO(file), allow_pickle=False)
    assert set(read) == set(members)
    for name, array in members.items():
        assert read[name].dtype == array.dtype
        np.testing.assert_array_equal(read[name], array)
