"""Where the positions of a package and of a keypoint file are measured from, and where they end up when
the centre of mass is moved."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
import yaml
from click.testing import CliRunner

from posse_core._cli.import_mesh import command
from posse_core._plugins.loading import load_plugins
from tests.support.animated_gltf import AnimatedScene, turning


def run_import(mesh, folder, *arguments):
    given = [mesh, "--out", folder, "--scale", 1, *arguments]
    done = CliRunner().invoke(command, list(map(str, given)))
    assert done.exit_code == 0, done.output
    return done.output


def build(source, **options):
    registry = load_plugins().registry
    return registry.create("scene", source, registry.options("scene", source, options)).build()


def edit(folder, **keys):
    path = folder / "spacecraft.yaml"
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), **keys}))


def in_the_file(craft, centre_m):
    """Positions from the mesh file's origin."""
    return {name: point + centre_m for name, point in craft.keypoints_body_m.items()}


@pytest.fixture
def wedge(tmp_path):
    """A mesh whose centroid is far from its origin."""
    mesh = trimesh.creation.box((2.0, 1.0, 0.5))
    mesh.apply_translation((3.0, -1.0, 0.5))
    mesh.export(tmp_path / "wedge.stl")
    return tmp_path / "wedge.stl"


@pytest.mark.parametrize("centre_m", [(0.0, 0.0, 0.0), (3.1, -1.2, 0.4)])
def test_keypoints_stay_on_the_mesh_when_the_centre_of_mass_is_moved(wedge, tmp_path, centre_m):
    run_import(wedge, tmp_path / "p", "--keypoint-count", 8)
    before = in_the_file(build("package", package=str(tmp_path / "p")), (3.0, -1.0, 0.5))
    edit(tmp_path / "p", centre_of_mass_m=list(centre_m))
    craft = build("package", package=str(tmp_path / "p"))
    np.testing.assert_allclose(
        craft.parts[0].vertices_body_m.mean(axis=0), np.array([3.0, -1.0, 0.5]) - centre_m, atol=1e-6
    )
    after = in_the_file(craft, centre_m)
    assert len(after) == 8
    for name, point in before.items():
        np.testing.assert_allclose(after[name], point, atol=1e-6)
        vertices = craft.parts[0].vertices_body_m
        assert np.abs(vertices - craft.keypoints_body_m[name]).max(axis=1).min() < 2e-6


def test_joints_stay_where_they_are_when_the_centre_of_mass_is_moved(tmp_path):
    scene = AnimatedScene()
    base = scene.add("base", None, trimesh.creation.box((1.0, 1.0, 1.0)))
    arm = scene.add("arm", base, trimesh.creation.box((0.2, 0.2, 2.0)), translation=(0.5, 0.3, 1.5))
    scene.animate(arm, "rotation", [0, 5], turning((1, 0, 0), [-10, 70]))
    run_import(scene.write(tmp_path / "a.glb"), tmp_path / "p", "--keypoint-count", 6)
    edit(tmp_path / "p", centre_of_mass_m=[0.2, 0.0, 0.1])
    craft = build("package", package=str(tmp_path / "p"))
    # The axis is along x, through (0.5, 0.3, 1.5) of the file.
    np.testing.assert_allclose(craft.joints[0].origin_body_m[1:], [0.3, 1.4], atol=1e-6)
    assert "arm" in craft.keypoint_joints.values()
    for name, joint in craft.keypoint_joints.items():
        (part,) = (part for part in craft.parts if part.joint == joint)
        gaps = np.abs(part.vertices_body_m - craft.keypoints_body_m[name]).max(axis=1)
        assert gaps.min() < 2e-6


def test_a_description_is_a_keypoint_file_for_another_centre_of_mass(wedge, tmp_path):
    run_import(wedge, tmp_path / "p", "--keypoint-count", 8)
    again = ("--centre-of-mass", 0, 0, 0, "--keypoints", tmp_path / "p" / "spacecraft.yaml")
    run_import(wedge, tmp_path / "q", *again)
    before = in_the_file(build("package", package=str(tmp_path / "p")), (3.0, -1.0, 0.5))
    after = build("package", package=str(tmp_path / "q")).keypoints_body_m
    for name, point in before.items():
        np.testing.assert_allclose(after[name], point, atol=1e-6)


def test_without_the_key_positions_are_from_the_centre_of_mass(wedge, tmp_path):
    (tmp_path / "k.yaml").write_text(
        "keypoints: {T1: [1, 0.5, -0.25], B1: {at: [0, 0, 0.25], joint: null}}"
    )
    craft = build("mesh", mesh=str(wedge), scale_m_per_unit=1.0, keypoints=str(tmp_path / "k.yaml"))
    np.testing.assert_allclose(craft.keypoints_body_m["T1"], [1, 0.5, -0.25])
    (tmp_path / "k.yaml").write_text(
        "measured_from_m: [3, -1, 0]\n"
        "keypoints: {T1: [1, 0.5, 0.25], B1: {at: [0, 0, 0.75], joint: null},"
        " A1: {part: part_0, corner: [1, 1, -1]}}"
    )
    craft = build("mesh", mesh=str(wedge), scale_m_per_unit=1.0, keypoints=str(tmp_path / "k.yaml"))
    np.testing.assert_allclose(craft.keypoints_body_m["T1"], [1, 0.5, -0.25], atol=1e-6)
    np.testing.assert_allclose(craft.keypoints_body_m["A1"], [1, 0.5, -0.25], atol=1e-6)
    np.testing.assert_allclose(craft.keypoints_body_m["B1"], [0, 0, 0.25], atol=1e-6)


def test_import_says_that_it_moves_the_origin_and_which_key_keeps_it(wedge, tmp_path):
    (said,) = (line for line in run_import(wedge, tmp_path / "p").splitlines() if "centroid" in line)
    assert "centre_of_mass_m: [0, 0, 0]" in said
    assert "--centre-of-mass 0 0 0" in said
    assert "SPEED" in said
    assert "centroid" not in run_import(wedge, tmp_path / "q", "--centre-of-mass", 0, 0, 0)


@pytest.mark.parametrize(("answer", "centre_m"), [("", (3.0, -1.0, 0.5)), ("file", (0.0, 0.0, 0.0))])
def test_at_a_terminal_it_asks_for_the_origin_with_the_length(
    wedge, tmp_path, monkeypatch, capsys, answer, centre_m
):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr("sys.stdin", Terminal(f"2\n{answer}\n"))
    command.main([str(wedge), "--out", str(tmp_path / "p")], standalone_mode=False)
    assert "centroid" in capsys.readouterr().out
    record = yaml.safe_load((tmp_path / "p" / "spacecraft.yaml").read_text())
    np.testing.assert_allclose(record["centre_of_mass_m"], centre_m, atol=1e-6)
