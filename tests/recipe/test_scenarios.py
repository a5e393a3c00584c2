"""The views of a recipe are spread as it says: tests against exact distributions, and its refusals."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml
from command import run_posse
from scipy import stats
from scipy.spatial.transform import Rotation
from small_recipe import KEYS, write_recipe

from posse_core._errors import InputError
from posse_core._frames import matrix_from_quaternion, unit
from posse_core._model.scene import FrameState
from posse_core._plugins.loading import load_plugins
from posse_core._recipe.defaults import default_recipe
from posse_core._recipe.file import read_recipe, recipe_of
from posse_core._recipe.file import write_recipe as write
from posse_core._recipe.model import Recipe
from posse_core._recipe.scenarios import Scenarios
from posse_core._trajectory.build import make_trajectory
from posse_core._trajectory.state import frame_state

REGISTRY = load_plugins().registry
FRAMES = 1500
LEAST_P = 1e-3
"""The draws are the same in every run, so a test that passes once passes always."""


def recipe(**data: Any) -> Recipe:
    changed = {**KEYS["data"], **data}
    changed["scenario"] = {**changed["scenario"], "renderer": "raster"}
    return recipe_of({**KEYS, "craft": {"name": "cubesat"}, "data": changed}, "recipe")


def scenarios(**data: Any) -> Scenarios:
    return Scenarios.of(recipe(**data), Path(), REGISTRY)


@pytest.fixture(scope="module")
def views() -> tuple[Scenarios, list[FrameState]]:
    found = scenarios()
    scenario = found.scenario("plain", FRAMES)
    trajectory = make_trajectory(scenario, REGISTRY)
    assert len(trajectory) == FRAMES
    return found, [frame_state(trajectory, i, scenario.constants) for i in range(FRAMES)]


def is_uniform(share: np.ndarray) -> bool:
    return bool(stats.kstest(share, "uniform").pvalue > LEAST_P)


def test_every_attitude_in_the_image_is_equally_likely(views) -> None:
    """Angle and axis of a uniform rotation: (angle − sin angle) / π is even, and the axis on the sphere,
    whose coordinates are even (Archimedes)."""
    R = np.array([state.craft.R_cam_from_body for state in views[1]])
    vectors = Rotation.from_matrix(R).as_rotvec()
    angle = np.linalg.norm(vectors, axis=1)
    assert is_uniform((angle - np.sin(angle)) / np.pi)
    for axis in unit(vectors).T:
        assert is_uniform((axis + 1) / 2)
    # So is the direction that the camera is seen in from the spacecraft.
    to_camera = -np.einsum("fji,fj->fi", R, np.array([s.craft.t_body_cam_m for s in views[1]]))
    for coordinate in unit(to_camera).T:
        assert is_uniform((coordinate + 1) / 2)


def test_the_logarithm_of_the_apparent_size_is_even(views) -> None:
    found, states = views
    range_m = np.array([np.linalg.norm(state.craft.t_body_cam_m) for state in states])
    size = 2 * found.radius_m * found.camera.fy_px / range_m / found.camera.height_px
    assert is_uniform(np.log(size / 0.3) / np.log(0.9 / 0.3))


def test_the_place_in_the_image_is_within_the_limit_and_on_all_sides(views) -> None:
    found, states = views
    px = found.camera.project(np.array([state.craft.t_body_cam_m for state in states]))
    away = px - [found.camera.cx_px, found.camera.cy_px]
    assert np.linalg.norm(away, axis=1).max() <= 0.3 * found.camera.height_px + 1e-6
    assert is_uniform(np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) + 0.5)


def test_the_sun_shines_from_all_sides_and_on_every_frame(views) -> None:
    states = views[1]
    assert min(state.sun_fraction_target for state in states) >= 0.5
    to_sun = unit(np.array([state.r_sun_eci_m - state.r_target_eci_m for state in states]))
    to_camera = unit(np.array([state.r_camera_eci_m - state.r_target_eci_m for state in states]))
    phase = np.degrees(np.arccos(np.sum(to_sun * to_camera, axis=1)))
    assert 0.02 < np.mean(phase < 30) < 0.12  # (1 − cos 30°) / 2 is 0.067
    assert 0.75 < np.mean(phase < 130) < 0.9  # 0.82


def test_frames_without_a_spacecraft_do_not_show_it() -> None:
    found = scenarios()
    scenario = found.scenario("empty", 300)
    trajectory = make_trajectory(scenario, REGISTRY)
    R_eci_from_cam = matrix_from_quaternion(trajectory.q_eci_from_camera)
    to_target = trajectory.r_target_eci_m - trajectory.r_chaser_eci_m
    z = np.einsum("fji,fj->fi", R_eci_from_cam, unit(to_target))[:, 2]
    corner = np.arctan(np.hypot(32, 24) / found.camera.fx_px)
    radius = np.arcsin(found.radius_m / np.linalg.norm(to_target, axis=1))
    assert np.all(np.arccos(z) > corner + radius)
    assert np.mean(z < 0) > 0.4  # in all other directions


def test_sources_differ_in_their_draws_and_not_with_the_number_of_workers() -> None:
    found = scenarios()
    plain, noisy = found.scenario("plain", 5), found.scenario("noisy", 5)
    assert plain.seed != noisy.seed
    assert noisy.sensor.noise.gaussian_dn == 5.0
    assert found.scenario("plain", 5) == plain
    other = Scenarios.of(found.recipe.model_copy(update={"workers": 7}), Path(), REGISTRY)
    assert other.scenario("plain", 5) == plain


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"apparent_size": [0.5, 9.0]}, "data.apparent_size: 9 puts the camera"),
        ({"sources": {"a": {"share": 1, "set": {"camera.width_px": 32}}, "b": {"share": 1}}}, "another"),
        (
            {"sources": {"a": {"share": 1, "set": {"sky.eath": False}}}},
            "a: .*sky.eath.*mean 'earth'",
        ),
        ({"sources": {"a": {"share": 1, "set": {"renderer": "rastr"}}}}, "mean 'raster'"),
    ],
)
def test_an_impossible_view_is_refused(data: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words) as error:
        scenarios(**data)
    assert "\n" not in str(error.value)


def test_a_mesh_without_enough_keypoints_is_refused(tmp_path: Path) -> None:
    write_recipe(tmp_path)
    (tmp_path / "craft").mkdir()
    (tmp_path / "craft" / "box.obj").write_text((tmp_path / "box.obj").read_text())
    (tmp_path / "craft" / "spacecraft.yaml").write_text(
        "{name: box, mesh: box.obj, scale_m_per_unit: 1, body_axes: x y z, centre_of_mass_m: [0, 0, 0],"
        " keypoints: {T1: [2, 1, 1]}}"
    )
    keys = {**KEYS, "data": {**KEYS["data"]}}
    keys["data"]["scenario"] = {**KEYS["data"]["scenario"], "renderer": "raster"}
    with pytest.raises(InputError, match="box has 1 keypoints"):
        Scenarios.of(recipe_of(keys, "recipe"), tmp_path, REGISTRY)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"hour": 2}, "line [0-9]*: hour: unknown key; did you mean 'hours'"),
        ({"hours": -1}, "hours.*greater than 0"),
        ({"boxes": {"name": "nano"}}, "give hours, or boxes.epochs"),
        ({"time": {"frames": 0.5, "boxes": 0.3, "keypoints": 0.3}}, "nothing for the evaluation"),
        ({"data": {"sources": {}}}, "data.sources.*at least 1"),
        ({"data": {"sources": {"A b": {"share": 1}}}}, "cannot be a folder's name"),
        ({"data": {"sources": {"a": {"share": 1, "craft": False}}}}, "no source shows"),
        ({"data": {"sources": {"a": {"share": 0}}}}, "share.*greater than 0"),
        ({"data": {"apparent_size": [2, 1]}}, "least size and then"),
        ({"data": {"drop": ["drak"]}}, "mean 'dark'"),
        ({"data": {"split": [1, 1, 0]}}, "train and test"),
        ({"data": {"scenario": {"target": "aqua"}}}, "the target is the recipe's craft"),
        ({"data": {"frames": 3}}, "greater than or equal to 10"),
        ({"craft": {"nam": "aqua"}}, "exactly one of name, mesh, package"),
    ],
)
def test_a_wrong_key_is_told_in_one_line_with_its_place(
    changes: dict[str, Any], words: str, tmp_path: Path
) -> None:
    changed = dict(changes)
    if "data" in changes:
        changed["data"] = {**KEYS["data"], **changes["data"]}
    path = write_recipe(tmp_path, **changed)
    with pytest.raises(InputError, match=words) as error:
        read_recipe(path)
    assert str(error.value).startswith(f"{path}, line ") or str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"craft": {"name": "aqqa"}}, "recipe.yaml: .*aqqa"),
        ({"boxes": {"name": "nanno", "epochs": 1}}, "recipe.yaml: .*nanno"),
        (
            {"data": {"scenario": {**KEYS["data"]["scenario"], "sky": 3}}},
            r"recipe.yaml: data\.scenario: sky: .*\(it is 3\)",
        ),
        (
            {"data": {"sources": {"a": {"share": 1, "set": {"sky.eath": False}}}}},
            r"recipe.yaml: data\.sources\.a: .*eath",
        ),
    ],
)
def test_what_is_wrong_beyond_the_keys_is_told_with_the_file(
    changes: dict[str, Any], words: str, tmp_path: Path
) -> None:
    data = {**KEYS["data"], "scenario": {**KEYS["data"]["scenario"], "renderer": "raster"}}
    nets = {"boxes": {"name": "nano", "epochs": 1}, "keypoints": {"name": "heatmap", "epochs": 1}}
    changed = {"craft": {"name": "aqua"}, **nets, **changes}
    changed["data"] = {**data, **changes.get("data", {})}
    path = write_recipe(tmp_path, **changed)
    code, _, error = run_posse("recipe", path)
    assert code == 2
    (line,) = error.splitlines()
    assert re.search(words, line), line


def test_a_recipe_is_read_as_it_was_written(tmp_path: Path) -> None:
    made = default_recipe({"name": "aqua"}, 2.0, 2, REGISTRY)
    write(made, tmp_path / "recipe.yaml")
    assert read_recipe(tmp_path / "recipe.yaml") == made
    assert yaml.safe_load((tmp_path / "recipe.yaml").read_text())["hours"] == 2.0


def test_the_default_recipe_can_be_followed_for_built_in_spacecraft() -> None:
    for name in ("aqua", "cubesat"):
        found = Scenarios.of(default_recipe({"name": name}, 2.0, 1, REGISTRY), Path(), REGISTRY)
        nearest_m, farthest_m = found.ranges_m
        assert farthest_m / nearest_m == pytest.approx(1.2 / 0.1)
        assert nearest_m > found.radius_m


@pytest.mark.parametrize(("suffix", "has_pattern"), [("stl", True), ("glb", False)])
def test_what_has_no_material_gets_patterns_in_the_default_recipe(
    tmp_path: Path, suffix: str, has_pattern: bool
) -> None:
    """An STL file has no materials; the box of the other file has one of its own."""
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    if suffix == "glb":
        color = trimesh.visual.material.PBRMaterial("paint", baseColorFactor=(0.2, 0.3, 0.4, 1.0))
        box.visual = trimesh.visual.TextureVisuals(material=color)
    box.export(tmp_path / f"box.{suffix}")
    mesh = {"mesh": str(tmp_path / f"box.{suffix}"), "scale_m_per_unit": 1.0}
    made = default_recipe(mesh, 2.0, 1, REGISTRY)
    scenario = made.data.scenario
    patterns = [ranges.get("pattern", 0) for ranges in scenario["variation"]["materials"].values()]
    assert (max(patterns) > 0) == has_pattern
