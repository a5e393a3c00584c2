"""Light that the lens scatters into a halo: how much, how far, and that none is lost."""

import numpy as np
import pytest

from posse_core._imaging.psf import glared


@pytest.mark.parametrize("half_px", [5.0, 20.0, 60.0])
def test_half_of_the_scattered_light_is_within_the_radius(half_px):
    image = np.zeros((601, 801, 1), np.float32)
    image[300, 400] = 1000.0
    blurred = glared(image, 0.1, half_px)[..., 0].astype(np.float64)
    assert blurred.sum() == pytest.approx(1000.0, rel=1e-3)
    v, u = np.indices(blurred.shape)
    away = np.hypot(v - 300, u - 400)
    halo = blurred.copy()
    halo[300, 400] -= 900.0
    assert halo[away <= half_px].sum() == pytest.approx(50.0, rel=0.06)
    ring = [halo[(away > r) & (away < 1.1 * r)].mean() for r in (half_px, 2 * half_px, 4 * half_px)]
    assert ring[0] > ring[1] > ring[2] > 0


def test_an_even_image_stays_as_it_is():
    image = np.full((90, 121, 3), (3.0, 5.0, 7.0), np.float32)
    np.testing.assert_allclose(glared(image, 0.3, 40.0), image, rtol=1e-5)


def test_without_a_share_nothing_changes():
    image = np.random.default_rng(0).uniform(size=(40, 50, 1)).astype(np.float32)
    np.testing.assert_array_equal(glared(image, 0.0, 10.0), image)
