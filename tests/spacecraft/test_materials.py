"""Materials that a scenario or a package replaces by name."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

import posse_core as posse
from posse_core._geometry.surface import Surface
from posse_core._model.scene import Piece
from posse_core._model.spacecraft import Material
from posse_core._scenario.component import TargetChoice
from posse_core._scenario.materials import MaterialKeys
from posse_core._spacecraft import shapes
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.materials import with_materials

SHADES = np.array([[[40, 120, 250], [255, 0, 90]]], dtype=np.uint8)
MATERIALS = {
    "foil_gold": Material("foil_gold", (0.9, 0.6, 0.2), metallic=1.0, roughness=0.3),
    "foil_black": Material("foil_black", (0.1, 0.1, 0.1), roughness=0.4),
    "cells": Material(
        "cells",
        (0.5, 0.5, 0.5),
        metallic=0.8,
        roughness=0.6,
        base_color_texture=SHADES,
        metallic_roughness_texture=SHADES[..., :2],
    ),
}


@pytest.fixture(scope="module")
def craft():
    made = Assembly("simple")
    for k, name in enumerate(MATERIALS):
        made.add(name, name, shapes.box((1.0, 1.0, 1.0)).at((2.0 * k, 0.0, 0.0)))
    return made.finish(MATERIALS, (0.0, 0.0, 0.0), [])


def replaced(craft, **choices):
    keys = {name: MaterialKeys(**given) for name, given in choices.items()}
    return with_materials(craft, keys, "target.materials")


def points_of(craft, name):
    """What the surface is at random points of a box, as annotators and renderers have it."""
    part = next(part for part in craft.parts if part.name == name)
    surface = Surface([Piece(part, craft.materials[part.material], 0)])
    rng = np.random.default_rng(0)
    face = rng.integers(0, len(part.faces), 100)
    weights = rng.dirichlet((1.0, 1.0, 1.0), 100)
    return surface.at(face, np.einsum("nk,nkc->nc", weights, part.vertices_body_m[part.faces[face]]))


def test_what_is_given_holds_everywhere_and_nothing_else_changes(craft):
    changed = replaced(craft, cells={"base_color": (0.2, 0.3, 0.4), "roughness": 0.25})
    np.testing.assert_allclose(
        points_of(changed, "cells").base_color, [[0.2, 0.3, 0.4]] * 100, atol=1e-7
    )
    before, after = craft.materials["cells"], changed.materials["cells"]
    assert after.roughness == 0.25
    assert (after.metallic_roughness_texture[..., 1] == 255).all()
    # The metallic share keeps its texture.
    assert after.metallic == before.metallic
    np.testing.assert_array_equal(after.metallic_roughness_texture[..., 0], SHADES[..., 0])
    assert all(changed.materials[name] is craft.materials[name] for name in ("foil_gold", "foil_black"))


def test_both_given_leave_no_texture(craft):
    changed = replaced(craft, cells={"metallic": 0.0, "roughness": 1.0}).materials["cells"]
    assert changed.metallic_roughness_texture is None
    assert changed.base_color_texture is SHADES


def test_a_name_of_its_own_comes_before_a_pattern(craft):
    changed = replaced(craft, **{"foil_*": {"specular": 0.0}, "foil_gold": {"roughness": 0.9}}).materials
    assert changed["foil_black"].specular == 0.0
    assert changed["foil_gold"].specular == 1.0
    assert changed["foil_gold"].roughness == 0.9


@pytest.mark.parametrize("write", ["name", "mesh"])
def test_a_choice_of_a_target_is_read_and_written_alike(write):
    raw = {write: "aqua", "materials": {"foil": {"specular": 0.0}}, "panel_angle_deg": 3}
    choice = TargetChoice.model_validate(raw)
    assert choice.materials["foil"].specular == 0.0
    assert "materials" not in choice.options
    again = TargetChoice.model_validate(yaml.safe_load(yaml.safe_dump(choice.model_dump(mode="json"))))
    assert again == choice


def lambertian(name: str) -> dict[str, object]:
    return {
        "target": {
            "name": name,
            "materials": {"*": {"base_color": [0.4] * 3, "metallic": 0, "specular": 0, "roughness": 1}},
        },
        "camera.width_px": 192,
        "camera.height_px": 144,
        "sky": {"earth": False},
    }


def test_a_built_in_craft_becomes_lambertian_in_an_image():
    """By Lambert's law, where one facet fills a pixel and its neighbours and the Sun reaches them."""
    pytest.importorskip("posse_render_raster")
    with posse.open("aqua", renderer="raster", overrides=lambertian("cubesat")) as sim:
        state = sim.state(t_s=0.0, r_rtn_m=[0.2, -0.7, 0.1])
        shot = sim.frame(state)
        view = posse.RayCaster(posse.Scene(sim.spacecraft, sim.camera)).view(state.craft)
    E_rgb, sun = state.craft.sun_irradiance_rgb_w_m2, state.craft.sun_direction_cam
    seen = shot.craft_radiance_rgb[view.box.slices]
    cosine = view.normal_cam @ sun
    law = 0.4 / math.pi * E_rgb * np.clip(cosine, 0, None)[..., None]
    inner = np.ones(view.mask.shape, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(view.lit, step, axis)
            inner &= np.isclose(np.roll(cosine, step, axis), cosine, atol=1e-4)
    inner &= view.lit & (cosine > 0.1)
    assert inner.sum() > 50
    # Light from other parts adds; the shadow of a small part may fall between centres of pixels.
    ratio = seen[inner] / law[inner]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.02)
    assert np.quantile(ratio, 0.05) > 0.97


@pytest.mark.parametrize(
    ("raw", "where"),
    [
        ({"target": {"name": "aqua", "materials": {"foill": {}}}}, "target.materials.foill"),
        (
            {"bodies": {"b": {"spacecraft": {"name": "cubesat", "materials": {"x": {}}}}}},
            "bodies.b.spacecraft: materials.x",
        ),
    ],
)
def test_an_unknown_material_is_refused_with_the_key(raw, where):
    if "bodies" in raw:
        raw["bodies"]["b"]["relative"] = {"roe_m": [0, 0, 20, 0, 0, 20]}
    with pytest.raises(posse.InputError, match=f"^{where}: .* no such material"):
        posse.open("aqua", overrides=raw).close()


def test_a_package_has_materials_of_its_own(tmp_path: Path):
    import trimesh

    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    described = {
        "name": "box",
        "mesh": "box.stl",
        "scale_m_per_unit": 1.0,
        "body_axes": "x y z",
        "centre_of_mass_m": [0, 0, 0],
        "materials": {"*": {"base_color": [0.1, 0.2, 0.3]}},
    }
    path = tmp_path / "spacecraft.yaml"
    path.write_text(yaml.safe_dump(described))
    made = posse.create("scene", "package", package=str(tmp_path)).build()
    assert {material.base_color for material in made.materials.values()} == {(0.1, 0.2, 0.3)}
    described["materials"] = {"paint": {"roughness": 0.1}}
    path.write_text(yaml.safe_dump(described))
    with pytest.raises(posse.InputError, match=r"spacecraft\.yaml: materials\.paint: box has no such"):
        posse.create("scene", "package", package=str(tmp_path)).build()
