"""The fit of an outline and a picture, on ellipses whose edges have a closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._evaluation.outlines import Edges, outline_of
from posse_core._evaluation.photometry import format_faults
from posse_core._scenario.sensor import SensorConfig

HEIGHT, WIDTH = 120, 160
V, U = np.mgrid[:HEIGHT, :WIDTH].astype(float)


def ellipse(u, v, a, b, angle):
    """(H, W) signed distance in semi-axes: negative inside."""
    x, y = U - u, V - v
    along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
    return np.hypot(along / a, across / b) - 1


def picture(shape, inside=0.5, outside=0.0, soft_px=1.0):
    """Light with an edge that is soft by about so many pixels."""
    slope = shape / np.maximum(np.hypot(*np.gradient(shape)), 1e-3)
    share = 1 / (1 + np.exp(np.clip(slope / soft_px * 2, -50, 50)))
    return (outside + (inside - outside) * share).astype(np.float32)


def fit(light, mask):
    outline = outline_of(mask)
    return Edges(light, outline, noise=0.0).fit(np.ones(len(outline), bool))


PLACES = st.tuples(
    st.floats(65, 95), st.floats(50, 70), st.floats(30, 40), st.floats(16, 22), st.floats(0, 3)
)


@given(PLACES, st.floats(0, 1), st.floats(0.5, 2))
def test_an_ellipse_fits_its_own_picture_however_bright_and_soft(place, outside, soft_px):
    shape = ellipse(*place)
    light = picture(shape, 0.5, outside if abs(outside - 0.5) > 0.05 else 0.0, soft_px)
    got = fit(light, shape < 0)
    assert got.share > 0.7
    assert max(map(abs, got.shift_px)) <= 1


@given(PLACES, st.integers(-6, 6), st.integers(-6, 6))
def test_the_shift_of_a_picture_is_found(place, u_px, v_px):
    shape = ellipse(*place)
    got = fit(np.roll(picture(shape), (v_px, u_px), axis=(0, 1)), shape < 0)
    assert np.abs(np.array(got.shift_px) - [u_px, v_px]).max() <= 1
    assert got.best > 0.7


@given(PLACES, st.integers(0, 10**6))
def test_noise_fits_no_outline(place, seed):
    """The fit of anything else is 0 within its scatter, which :attr:`Fit.power` is the inverse of."""
    light = np.random.default_rng(seed).random((HEIGHT, WIDTH)).astype(np.float32)
    got = fit(light, ellipse(*place) < 0)
    assert abs(got.share) < 4 / got.power


def test_an_even_picture_proves_nothing():
    assert fit(np.full((HEIGHT, WIDTH), 0.3, np.float32), ellipse(80, 60, 30, 20, 0) < 0) is None


def test_the_image_border_is_no_outline():
    outline = outline_of(ellipse(0, 60, 40, 30, 0) < 0)
    assert len(outline) > 20
    assert outline.uv_px.min() > 2


@pytest.mark.parametrize(("x", "y"), [(True, False), (False, True), (True, True)])
def test_the_mirrored_outline_is_that_of_the_mirrored_mask(x, y):
    mask = ellipse(60, 50, 35, 18, 0.7) < 0
    flipped = mask[:: -1 if y else 1, :: -1 if x else 1]
    ours, theirs = outline_of(mask).mirrored((HEIGHT, WIDTH), x, y), outline_of(flipped)
    order = [np.lexsort(outline.uv_px.round(6).T) for outline in (ours, theirs)]
    assert np.allclose(ours.uv_px[order[0]], theirs.uv_px[order[1]], atol=1e-4)
    assert np.allclose(ours.outward[order[0]], theirs.outward[order[1]], atol=1e-4)


def test_sixteen_bits_that_are_only_eight_are_found():
    sensor = SensorConfig(bit_depth=16, color="mono")
    true = np.random.default_rng(0).integers(0, 2**16, (40, 50), np.uint16)
    assert list(format_faults(true, sensor)) == []
    for cut in (true >> 8 << 8, (true >> 8) * 257):
        assert list(format_faults(cut, sensor)) == [
            "the picture has 16 bits, but only 8 of them are used"
        ]
    assert "no value above 255" in next(format_faults(true >> 8, sensor))
