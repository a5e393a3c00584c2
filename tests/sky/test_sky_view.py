"""Skies between two instants, and the directions of their maps."""

import numpy as np
import pytest

import posse_core as posse
from posse_core._model.sky_view import SkyView
from posse_core.testing import closed_forms

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


@pytest.mark.parametrize("height", [1, 5, 64])
def test_directions_of_a_map_spread_over_the_sphere(height):
    """They are those of the closed forms, forward in the middle and up in the first row."""
    found = posse.EnvironmentMap.directions_cam(height)
    np.testing.assert_allclose(found, closed_forms.directions(height), atol=1e-12)
    assert (found[0, :, 1] <= 1e-12).all()
    ahead = np.unravel_index(np.argmax(found[..., 2]), found.shape[:2])
    assert np.abs(np.array(ahead) + 0.5 - [height / 2, height]).max() <= 0.5
