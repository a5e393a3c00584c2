"""The textures of surface finishes, as a renderer decodes them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._model.srgb import linear_from_srgb
from posse_core._spacecraft import textures


def jump(image, axis):
    """Root-mean-square difference between the first and the last line along an axis, and that between
    neighbouring lines."""
    image = np.asarray(image, dtype=np.float64)
    steps = np.diff(image, axis=axis)
    around = np.take(image, 0, axis=axis) - np.take(image, -1, axis=axis)
    return np.sqrt((around**2).mean()), np.sqrt((steps**2).mean())


@pytest.mark.parametrize("axis", [0, 1])
def test_foil_repeats_without_a_seam(axis):
    foil = textures.foil("foil", (0.8, 0.6, 0.3), seed=3)
    for texture in (
        foil.base_color_texture,
        foil.normal_texture,
        foil.metallic_roughness_texture[..., 1],
    ):
        seam, inside = jump(texture, axis)
        assert seam < 2.5 * inside


def test_foil_has_the_slope_of_its_wrinkles():
    slopes = []
    for wrinkle in (0.05, 0.10):
        normals = textures.foil("foil", (1, 1, 1), 0, wrinkle).normal_texture / 127.5 - 1.0
        slopes.append(np.sqrt((normals[..., :2] ** 2).mean()))
    assert slopes[1] / slopes[0] == pytest.approx(2.0, rel=0.1)
    assert 0.05 < slopes[1] < 0.15


@given(st.floats(0.0, 1.0))
def test_reflectance_is_kept_by_srgb_coding(reflectance):
    """Within half a step of 8 bits, decoded as in IEC 61966-2-1."""
    coded = textures.srgb(np.array([reflectance]))
    low, high = (linear_from_srgb(np.clip(coded + d, 0, 255) / 255) for d in (-0.51, 0.51))
    assert low[0] <= reflectance <= high[0]


def test_a_normal_map_tilts_against_the_slope():
    """A surface that rises along u by 45° has the normal (−1, 0, 1)/√2."""
    coded = textures.normal_map(np.full((2, 2, 2), (1.0, 0.0)))
    np.testing.assert_allclose(coded[0, 0] / 127.5 - 1.0, (-(0.5**0.5), 0.0, 0.5**0.5), atol=0.01)


def test_a_panel_has_dark_cells_on_its_front_and_the_given_reflectance_on_its_back():
    panel = textures.solar_panel("panel", (10, 5), (256, 128), seed=0, back=0.5)
    image = linear_from_srgb(panel.base_color_texture / 255)
    back, front = image[:128], image[128:]  # row 0 is the top of the texture, at v = 1
    red, _, blue = np.median(front.reshape(-1, 3), axis=0)
    assert blue > 3.0 * red
    assert np.median(back) == pytest.approx(0.5, abs=0.03)
    rough = panel.metallic_roughness_texture[..., 1] / 255.0
    assert np.median(rough[128:]) < 0.2 < np.median(rough[:128])
