"""Skies between two instants."""

import numpy as np
import pytest

from posse_core._model.sky_view import SkyView

STARS = np.array([[3.0, 4.0], [7.5, 1.0]]), np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
NONE = np.empty((0, 2)), np.empty((0, 3))


def test_a_mixture_has_the_light_of_both_by_their_shares():
    one = SkyView(np.full((2, 3, 3), 4.0, dtype=np.float32), *STARS)
    other = SkyView(np.full((2, 3, 3), 8.0, dtype=np.float32), STARS[0] + 1, STARS[1])
    mixed = one.mixed(other, 0.25)
    assert mixed.radiance_rgb is not None
    assert mixed.radiance_rgb.dtype == np.float32
    np.testing.assert_allclose(mixed.radiance_rgb, 5.0)
    assert mixed.points_irradiance_rgb_w_m2.sum() == pytest.approx(21.0)
    centre = mixed.points_irradiance_rgb_w_m2[:, 0] @ mixed.points_px / 5
    np.testing.assert_allclose(centre, STARS[1][:, 0] @ STARS[0] / 5 + 0.25)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_black_adds_nothing(share):
    black, lit = SkyView(None, *NONE), SkyView(np.ones((2, 2, 3), dtype=np.float32), *NONE)
    assert black.mixed(black, share).radiance_rgb is None
    for mixed, left in ((lit.mixed(black, share), 1 - share), (black.mixed(lit, share), share)):
        assert mixed.radiance_rgb is not None
        np.testing.assert_allclose(mixed.radiance_rgb, left, rtol=1e-6)
        assert len(mixed.points_px) == 0
