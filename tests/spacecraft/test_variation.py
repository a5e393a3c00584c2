"""Random materials: limits, what they depend on, and what they leave alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posse_core._errors import InputError
from posse_core._geometry.surface import Surface
from posse_core._model.scene import Piece
from posse_core._model.spacecraft import Material
from posse_core._model.srgb import srgb_from_linear
from posse_core._scenario.variation import VariationConfig
from posse_core._spacecraft import shapes
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.variation import varied_materials

DARK = np.full((4, 4, 3), round(255 * srgb_from_linear(np.array([0.1]))[0]), dtype=np.uint8)
MATERIALS = {
    "paint": Material("paint", (0.5, 0.4, 0.3), roughness=0.5),
    "cells": Material("cells", base_color_texture=DARK, roughness=0.1),
    "foil_gold": Material("foil_gold", (0.9, 0.6, 0.2), metallic=1.0, roughness=0.3),
}


@pytest.fixture(scope="module")
def craft():
    made = Assembly("simple")
    for k, name in enumerate(MATERIALS):
        made.add(name, name, shapes.box((1.0, 1.0, 1.0)).at((2.0 * k, 0.0, 0.0)))
    return made.finish(MATERIALS, (0.0, 0.0, 0.0), [])


def varied(craft, materials, seed=1, own_seed=None):
    return varied_materials(craft, VariationConfig(seed=own_seed, materials=materials), seed)


def reflectance(craft, name, count=400):
    """(N, 3) at random points of a box, as the albedo annotator has it."""
    part = next(part for part in craft.parts if part.name == name)
    surface = Surface([Piece(part, craft.materials[part.material], 0)])
    rng = np.random.default_rng(0)
    face = rng.integers(0, len(part.faces), count)
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    points = np.einsum("nk,nkc->nc", weights, part.vertices_body_m[part.faces[face]])
    return surface.at(face, points).base_color


def test_factors_are_within_their_limits_and_fill_them(craft):
    ranges = {"brightness": (0.5, 1.6), "tint": (0.9, 1.1), "roughness": (0.5, 1.9)}
    made = [varied(craft, {"paint": ranges}, seed).materials["paint"] for seed in range(200)]
    color = np.array([material.base_color for material in made]) / MATERIALS["paint"].base_color
    rough = np.array([material.roughness for material in made]) / 0.5
    assert color.min() > 0.5 * 0.9
    assert color.max() < 1.6 * 1.1
    level = np.exp(np.log(color).mean(axis=1))
    assert level.min() < 0.55
    assert level.max() > 1.45
    assert 0.5 <= rough.min() < 0.53
    assert 1.8 < rough.max() <= 1.9
    # As many below the geometric mean of the limits as above.
    assert abs(np.mean(rough < np.sqrt(0.5 * 1.9)) - 0.5) < 0.12


def test_a_dark_texture_gets_as_much_brighter_as_its_factor(craft):
    made = varied(craft, {"cells": {"brightness": (4.0, 4.0)}})
    before, after = (reflectance(each, "cells") for each in (craft, made))
    np.testing.assert_allclose(after, 4.0 * before, rtol=0.01)
    assert all(0.0 <= c <= 1.0 for c in made.materials["cells"].base_color)


def test_no_reflectance_is_above_one(craft):
    made = varied(craft, {"*": {"brightness": (50.0, 50.0), "pattern": 0.5}})
    for name in MATERIALS:
        assert reflectance(made, name).max() <= 1.0
        assert all(0.0 <= c <= 1.0 for c in made.materials[name].base_color)


def test_a_pattern_spreads_the_reflectance_as_it_says(craft):
    made = varied(craft, {"paint": {"pattern": 0.2}})
    ratio = np.log(reflectance(made, "paint", 4000) / MATERIALS["paint"].base_color)
    assert ratio.std() == pytest.approx(0.2, rel=0.2)
    np.testing.assert_allclose(ratio.std(axis=1), 0.0, atol=0.02)


def test_a_material_draws_by_its_own_name_and_the_seed(craft):
    ranges = {"brightness": (0.5, 2.0)}
    both = varied(craft, {"*": ranges}).materials
    alone = varied(craft, {"foil_*": ranges}).materials
    assert both["foil_gold"] == alone["foil_gold"]
    assert alone["paint"] is MATERIALS["paint"]
    assert varied(craft, {"*": ranges}, seed=2).materials["paint"] != both["paint"]
    assert varied(craft, {"*": ranges}, seed=2, own_seed=1).materials["paint"] == both["paint"]
    renamed = replace(craft, parts=craft.parts[:1])
    assert varied(renamed, {"*": ranges}).materials["paint"] == both["paint"]


def test_a_name_is_stronger_than_a_pattern(craft):
    made = varied(craft, {"*": {"brightness": (2.0, 2.0)}, "paint": {"brightness": (0.5, 0.5)}})
    np.testing.assert_allclose(made.materials["paint"].base_color, (0.25, 0.2, 0.15))


def test_an_unknown_material_is_told(craft):
    with pytest.raises(InputError, match=r"variation.materials.paind: .*did you mean 'paint'"):
        varied(craft, {"paind": {}})
    with pytest.raises(ValueError, match="least factor"):
        VariationConfig(materials={"paint": {"brightness": (2.0, 1.0)}})
