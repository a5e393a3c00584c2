"""Materials that vary from frame to frame: states, labels, albedo and lidar agree."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from posse_core import Finish, InputError, linear_from_srgb
from posse_core._plugins.loading import Plugins
from posse_core._scenario.load import load_scenario
from posse_core._simulator.simulator import Simulator

FLAT = Path(__file__).parents[1] / "packages" / "flat"
RANGES = {"brightness": [0.3, 3.0], "tint": [0.8, 1.25], "roughness": [0.5, 2.0]}


@pytest.fixture(scope="module")
def registry():
    """With a renderer that is quick."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FLAT)
        yield Plugins([EntryPoint("render_flat", "posse_flat", "posse")]).registry


def simulator(registry, variation, **more):
    changes = {
        "target": {"name": "cubesat"},
        "relative": {"state_rtn": {"r_m": [0.5, 0.8, 1.2], "v_m_s": [0, 0, 0]}},
        "times": {"t_s": [900, 901, 902]},
        "camera": {"width_px": 96, "height_px": 72, "hfov_deg": 30},
        "renderer": {"name": "flat"},
        "annotators": ["albedo", "depth", "parts", "pose"],
        "sky": {"earth": False},
        "seed": 4,
        **more,
    }
    if variation is not None:
        changes["variation"] = variation
    return Simulator(load_scenario("aqua", registry, changes), registry)


@pytest.fixture(scope="module")
def varying(registry):
    with simulator(registry, {"per": "frame", "materials": {"*": RANGES}}) as opened:
        yield opened


def test_the_albedo_is_multiplied_by_the_factors_of_the_label(registry, varying):
    frames = [varying.frame(varying.state(index)) for index in (0, 1)]
    with simulator(registry, None) as plain:
        own = [plain.frame(plain.state(index)) for index in (0, 1)]
        pieces = plain.scene.pieces
    assert "finishes" not in own[0].labels.as_json()
    for frame, other in zip(frames, own, strict=True):
        ids = frame.arrays["part_id"]
        hit = ids >= 0
        assert hit.sum() > 500
        names = [pieces[i].part.material for i in ids[hit]]
        factors = np.array([frame.labels.finishes[name].base_color for name in names])
        expected = other.arrays["base_color_rgb"][hit] * factors
        np.testing.assert_allclose(frame.arrays["base_color_rgb"][hit], expected, rtol=1e-5)
        assert frame.arrays["base_color_rgb"][hit].max() <= 1 + 1e-6
    assert frames[0].labels.finishes != frames[1].labels.finishes


def test_factors_follow_from_index_seed_and_name_and_keep_to_their_limits(varying):
    states = [varying.state(index, t_s=900.0).craft.finishes for index in range(60)]
    assert varying.state(7, t_s=950.0).craft.finishes == states[7]
    for name, material in varying.spacecraft.materials.items():
        rough = np.array([finishes[name].roughness for finishes in states])
        color = np.array([finishes[name].base_color for finishes in states])
        assert 0.5 <= rough.min() < 0.6
        assert color.min() >= 0.3 * 0.8
        assert color.max() <= 3.0 * 1.25
        assert np.std(color) > 0.1
        brightest = np.array(material.base_color)
        if material.base_color_texture is not None:
            brightest = brightest * linear_from_srgb(material.base_color_texture / 255.0).max((0, 1))
        assert (color * brightest).max() <= 1 + 1e-9


def test_a_lidar_sees_the_materials_of_the_frame(registry):
    lidar = {
        "type": "lidar",
        "pattern": {"shape": "raster", "width_deg": 20, "height_deg": 15, "columns": 16, "rows": 12},
    }
    medians = []
    for factor in (0.1, 0.01):
        ranges = {"brightness": [factor, factor]}
        variation = {"per": "frame", "materials": {"*": ranges}}
        with simulator(registry, variation, sensors={"scanner": lidar}) as opened:
            frame = opened.frame(opened.state(0))
        (reading,) = frame.readings["scanner"]
        medians.append(np.nanmedian(reading.arrays["intensity_e"]))
    assert 0.05 < medians[1] / medians[0] < 0.5  # facets in front of a base keep their share


def test_what_varies_per_run_alone_is_told(registry):
    with pytest.raises(InputError, match="metallic varies per run, not per frame"):
        simulator(registry, {"per": "frame", "materials": {"*": {"metallic": [0.5, 2]}}})


def test_each_frame_has_one_of_the_patterns_and_its_label_says_which(registry):
    variation = {"per": "frame", "materials": {"*": {"pattern": 0.3, "brightness": [0.5, 1.0]}}}
    with simulator(registry, variation) as opened, simulator(registry, None) as plain:
        frames = [opened.frame(opened.state(index)) for index in (0, 1)]
        own = [plain.frame(plain.state(index)) for index in (0, 1)]
        pieces = opened.scene.pieces
        used = {opened.state(i, t_s=900.0).craft.finishes["circuit_board"].pattern for i in range(200)}
    assert used == set(range(len(pieces[0].material.patterns)))
    for frame, other in zip(frames, own, strict=True):
        ids = frame.arrays["part_id"]
        np.testing.assert_array_equal(ids, other.arrays["part_id"])
        np.testing.assert_array_equal(frame.arrays["depth_m"], other.arrays["depth_m"])
        finishes = {n: Finish(**f) for n, f in frame.labels.as_json()["finishes"].items()}
        hit = ids >= 0
        assert frame.arrays["base_color_rgb"][hit].max() <= 1 + 1e-6
        for part in np.unique(ids[hit]):
            where = ids == part
            now = finishes[pieces[part].part.material].on(pieces[part].material)
            texels = linear_from_srgb(now.base_color_texture / 255.0) * now.base_color
            seen = frame.arrays["base_color_rgb"][where]
            assert seen.min() >= texels.min() - 1e-6
            assert seen.max() <= texels.max() + 1e-6
    assert frames[0].labels.finishes != frames[1].labels.finishes


def test_patterns_spread_the_reflectance_of_what_has_no_texture_as_they_say(registry):
    with simulator(registry, {"per": "frame", "materials": {"*": {"pattern": 0.4}}}) as opened:
        material = opened.spacecraft.materials["circuit_board"]
    light = np.log([linear_from_srgb(each / 255.0).mean(axis=-1) for each in material.patterns])
    assert light.std(axis=(1, 2)) == pytest.approx(0.4, rel=0.15)
    assert len(material.patterns) > 10
