"""``posse import``, and the keypoints and symmetries that it proposes."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
import trimesh
import yaml

from posse_core._cli.main import main
from posse_core._plugins.loading import load_plugins
from posse_core._spacecraft.proposals import propose_keypoints, rotations, shape_symmetries
from tests.support.animated_gltf import AnimatedScene, quaternion, turning


def build(source, **options):
    registry = load_plugins().registry
    return registry.create("scene", source, registry.options("scene", source, options)).build()


def craft_of(mesh, path):
    mesh.export(path)
    return build("mesh", mesh=str(path), scale_m_per_unit=1.0, centre_of_mass_m=(0.0, 0.0, 0.0))


@pytest.fixture
def imported(tmp_path, capsys):
    """Returns a function that runs ``posse import`` and returns its exit code, standard output and
    standard error."""

    def call(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["import", *map(str, arguments)])
        out, err = capsys.readouterr()
        return ended.value.code, out, err

    return call


# Proposals


def test_the_corners_of_a_box_are_proposed(tmp_path):
    craft = craft_of(trimesh.creation.box((2.0, 3.0, 4.0)).subdivide().subdivide(), tmp_path / "b.stl")
    points = propose_keypoints(craft, 8)
    corners = {(x, y, z) for x in (-1.0, 1.0) for y in (-1.5, 1.5) for z in (-2.0, 2.0)}
    assert {tuple(np.round(point, 6)) for point in points.values()} == corners
    # Body −Z is up: away from the Earth when nadir-pointing.
    assert all((name[0] == "T") == (point[2] < 0.0) for name, point in points.items())


def test_hidden_vertices_are_not_proposed(tmp_path):
    """A ball inside a box is not visible from anywhere."""
    scene = trimesh.util.concatenate(
        [trimesh.creation.box((2.0, 2.0, 2.0)), trimesh.creation.icosphere(2, 0.9)]
    )
    craft = craft_of(scene, tmp_path / "b.stl")
    points = propose_keypoints(craft, 200)
    assert len(points) == 8
    np.testing.assert_allclose(np.abs(list(points.values())), 1.0, atol=1e-6)


def test_proposals_are_well_spread_over_a_ball(tmp_path):
    """Twelve points on a sphere can be at most 63.4° apart (the icosahedron)."""
    craft = craft_of(trimesh.creation.icosphere(4), tmp_path / "b.stl")
    points = np.array(list(propose_keypoints(craft, 12).values()))
    cosine = np.clip(points @ points.T - 2.0 * np.eye(12), -1.0, 1.0)
    assert np.degrees(np.arccos(cosine.max())) > 45.0


def test_proposals_do_not_depend_on_the_order_of_triangles(tmp_path):
    mesh = trimesh.creation.annulus(0.3, 1.0, 0.7, sections=37)
    shuffled = mesh.copy()
    shuffled.faces = mesh.faces[np.random.default_rng(1).permutation(len(mesh.faces))]
    first = propose_keypoints(craft_of(mesh, tmp_path / "a.stl"), 10)
    second = propose_keypoints(craft_of(shuffled, tmp_path / "b.stl"), 10)
    assert list(first) == list(second)
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])


def test_names_of_parts_give_the_categories_panel_and_antenna(tmp_path):
    scene = trimesh.Scene()
    for name, x in (("bus", 0.0), ("solar_wing", 5.0), ("dish", -5.0)):
        transform = np.eye(4)
        transform[0, 3] = x
        scene.add_geometry(
            trimesh.creation.box((1, 1, 1)), node_name=name, geom_name=name, transform=transform
        )
    scene.export(tmp_path / "a.glb")
    craft = build("mesh", mesh=str(tmp_path / "a.glb"), scale_m_per_unit=1.0)
    points = propose_keypoints(craft, 24)
    for name, point in points.items():
        assert {"S": point[0] > 4.0, "A": point[0] < -4.0}.get(name[0], abs(point[0]) < 1.0)
    assert {name[0] for name in points} == set("TBAS")


@pytest.mark.parametrize(
    ("mesh", "repeats"),
    [
        (trimesh.creation.box((1.0, 2.0, 3.0)), {"x": 2, "y": 2, "z": 2}),
        (trimesh.creation.box((1.0, 1.0, 3.0)), {"x": 2, "y": 2, "z": 4}),
        (trimesh.creation.cylinder(1.0, 3.0, sections=6), {"x": 2, "y": 2, "z": 6}),
        (
            trimesh.Trimesh(
                [(0, 0, 0), (1, 0, 0), (0, 2, 0), (0, 0, 3)],
                [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)],
            ),
            {},
        ),
    ],
)
def test_symmetries_of_the_shape_are_found(tmp_path, mesh, repeats):
    assert dict(shape_symmetries(craft_of(mesh, tmp_path / "a.stl"))) == repeats


def test_rotations_generate_their_group():
    assert len(rotations([("z", 2)])) == 1
    assert len(rotations([("z", 4)])) == 3
    assert len(rotations([("z", 4), ("x", 2)])) == 7  # the dihedral group of a square prism
    assert len(rotations([("z", 4), ("x", 4)])) == 23  # the group of the cube
    with pytest.raises(ValueError, match="sphere"):
        rotations([("z", 5), ("x", 4)])


# The command


def test_the_package_of_a_mesh_can_be_built(imported, tmp_path):
    mesh = trimesh.creation.box((200.0, 100.0, 300.0))
    mesh.apply_translation((50.0, 0.0, 0.0))
    mesh.export(tmp_path / "my craft.ply")
    folder = tmp_path / "package"
    arguments = ["--scale", 0.01, "--axes", "x -z y", "--keypoint-count", 8, "--symmetry", "z:2"]
    code, out, err = imported(tmp_path / "my craft.ply", "--out", folder, *arguments)
    assert code == 0, err
    assert "12 triangles" in out
    assert "yes" in out  # watertight
    craft = build("package", package=str(folder))
    assert craft.name == "my_craft"
    np.testing.assert_allclose(np.diff(craft.bounds_body_m, axis=0)[0], (2.0, 3.0, 1.0), rtol=1e-6)
    np.testing.assert_allclose(craft.bounds_body_m.mean(axis=0), 0.0, atol=1e-6)
    assert len(craft.keypoints_body_m) == 8
    np.testing.assert_allclose(craft.symmetries[0], np.diag([-1.0, -1.0, 1.0]), atol=1e-12)
    for point in craft.keypoints_body_m.values():
        np.testing.assert_allclose(np.abs(point), (1.0, 1.5, 0.5), atol=1e-5)


def test_a_length_can_replace_the_scale(imported, tmp_path):
    trimesh.creation.box((2.0, 1.0, 5.0)).export(tmp_path / "a.stl")
    code, out, _ = imported(tmp_path / "a.stl", "--out", tmp_path / "p", "--length", 10, "--json")
    assert code == 0
    made = json.loads(out)
    assert made["scale_m_per_unit"] == pytest.approx(2.0)
    np.testing.assert_allclose(made["size_m"], (4.0, 2.0, 10.0))
    assert made["parts"][0]["watertight"] is True
    assert made["shape_repeats"] == ["x:2", "y:2", "z:2"]


def test_at_a_terminal_it_asks_for_the_length(imported, tmp_path, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr("sys.stdin", Terminal("10\n\n"))
    trimesh.creation.box((2.0, 1.0, 5.0)).export(tmp_path / "a.stl")
    code, out, err = imported(tmp_path / "a.stl", "--out", tmp_path / "p")
    assert code == 0, err
    assert "longest side is 5 units" in out
    assert build("package", package=str(tmp_path / "p")).radius_m == pytest.approx(0.5 * 120.0**0.5)


def test_keypoints_can_be_given_as_corners_of_parts(imported, tmp_path):
    trimesh.creation.box((2.0, 4.0, 6.0)).export(tmp_path / "a.stl")
    (tmp_path / "k.yaml").write_text(
        "keypoints:\n  T1: {part: part_0, corner: [1, -1, -1]}\n  B1: [0, 0, 3]\nskeleton: [[T1, B1]]\n"
    )
    code, _, err = imported(
        tmp_path / "a.stl", "--out", tmp_path / "p", "--scale", 1, "--keypoints", tmp_path / "k.yaml"
    )
    assert code == 0, err
    craft = build("package", package=str(tmp_path / "p"))
    np.testing.assert_allclose(craft.keypoints_body_m["T1"], (1.0, -2.0, -3.0), atol=1e-6)
    assert craft.skeleton == (("T1", "B1"),)


def test_names_that_yaml_would_take_for_something_else_are_kept(imported, tmp_path):
    trimesh.creation.box((2.0, 4.0, 6.0)).export(tmp_path / "a.stl")
    points = {
        "no": [1.0, 2.0, 3.0],
        "a: b": [-1.0, 2.0, 3.0],
        "1e5": [1.0, -2.0, 3.0],
        "T1": [1.0, 2.0, -3.0],
    }
    (tmp_path / "k.json").write_text(json.dumps({"keypoints": points}))
    given = ("--out", tmp_path / "p", "--scale", 1, "--keypoints", tmp_path / "k.json")
    code, _, err = imported(tmp_path / "a.stl", *given)
    assert code == 0, err
    craft = build("package", package=str(tmp_path / "p"))
    assert {name: point.tolist() for name, point in craft.keypoints_body_m.items()} == points


def test_files_that_the_mesh_refers_to_are_copied(imported, tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl foil\nKd 0.8 0.6 0.2\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl foil\nf 1 2 3\n")
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.creation.box().scene()).items():
        (tmp_path / name).write_bytes(data)
    for mesh in ("a.obj", "model.gltf"):
        folder = tmp_path / f"p-{mesh}"
        code, _, err = imported(tmp_path / mesh, "--out", folder, "--scale", 1)
        assert code == 0, err
        assert build("package", package=str(folder)).parts


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ([], "--length"),
        (["--scale", 1, "--length", 2], "one of them"),
        (["--scale", -1], "above zero"),
        (["--length", 1e9], "spacecraft is"),
        (["--scale", 1, "--axes", "x z y"], "mirror"),
        (["--scale", 1, "--symmetry", "w:2"], "--symmetry"),
        (["--scale", 1, "--symmetry", "z:7", "--symmetry", "x:7"], "sphere"),
        (["--scale", 1, "--keypoints", "none.yaml"], "none.yaml"),
    ],
)
def test_a_failed_import_leaves_no_files(imported, tmp_path, monkeypatch, arguments, word):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "a.stl")
    code, _, err = imported(tmp_path / "a.stl", "--out", tmp_path / "p", *arguments)
    assert code == 2
    assert err.count("\n") == 1
    assert word in err
    assert [path.name for path in tmp_path.iterdir()] == ["a.stl"]


def test_an_existing_folder_is_not_changed(imported, tmp_path):
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "a.stl")
    (tmp_path / "p").mkdir()
    code, _, err = imported(tmp_path / "a.stl", "--out", tmp_path / "p", "--scale", 1)
    assert code == 2
    assert "already" in err
    assert not any((tmp_path / "p").iterdir())


def test_the_packages_scenario_runs(posse, tmp_path):
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "a.stl")
    done = posse("import", "a.stl", "--out", "p", "--scale", 1)
    assert done.returncode == 0, done.stderr
    size = ["-o", "camera.width_px=160", "-o", "camera.height_px=120", "-o", "sky.earth=false"]
    done = posse("run", "p/scenario.yaml", "--renderer", "flat", "--frames", 1, "--out", "d", *size)
    assert done.returncode == 0, done.stderr
    (line,) = (tmp_path / "d" / "labels").glob("*.jsonl").__next__().read_text().splitlines()
    assert json.loads(line)["spacecraft"] == "a"
    assert json.loads(line)["mask_area_px"] > 0


def test_joints_of_a_file_are_listed_and_written(imported, tmp_path):
    scene = AnimatedScene()
    root = scene.add("root", scale=(0.01,) * 3, rotation=quaternion((1, 0, 0), -90))
    base = scene.add("base", root, trimesh.creation.box((200.0,) * 3))
    arm = scene.add("arm", base, trimesh.creation.box((30.0, 30.0, 300.0)), translation=(0, 0, 250))
    claw = scene.add("claw", arm, trimesh.creation.box((20.0, 60.0, 20.0)), translation=(0, 0, 170))
    scene.animate(arm, "rotation", [0, 5], turning((1, 0, 0), [-10, 70]))
    scene.animate(claw, "translation", [0, 5], [(0, 0, 170), (0, 0, 250)])
    mesh = scene.write(tmp_path / "a.glb")
    arguments = ["--scale", 1, "--axes", "x -z y", "--keypoint-count", 12]
    code, out, err = imported(mesh, "--out", tmp_path / "p", *arguments)
    assert code == 0, err
    rows = [line.split("  ") for line in out.splitlines() if line.startswith(("arm ", "claw "))]
    listed = [[cell.strip() for cell in row if cell.strip()] for row in rows[-2:]]
    assert listed == [
        ["arm", "revolute", "-", "arm", "-10 … 70 deg", "move"],
        ["claw", "prismatic", "arm", "claw", "0 … 0.8 m", "move"],
    ]
    # The package is the spacecraft of the mesh, but for the rounding of its description.
    made = build("package", package=str(tmp_path / "p"))
    options = {"scale_m_per_unit": 1.0, "body_axes": "x -z y"}
    own = build("mesh", mesh=str(mesh), **options)
    assert [part.joint for part in made.parts] == [part.joint for part in own.parts]
    assert set(made.keypoint_joints.values()) == {"arm", "claw"}
    for ours, theirs in zip(made.joints, own.joints, strict=True):
        assert (ours.name, ours.kind, ours.parent) == (theirs.name, theirs.kind, theirs.parent)
        np.testing.assert_allclose(ours.origin_body_m, theirs.origin_body_m, atol=1e-9)
        np.testing.assert_allclose(ours.axis_body, theirs.axis_body, atol=1e-9)
        assert ours.limits[0] <= theirs.limits[0] < theirs.limits[1] <= ours.limits[1]
        np.testing.assert_allclose(ours.limits, theirs.limits, atol=2e-6)
        assert list(ours.animations) == ["move"]


def test_joints_of_a_file_can_be_left_out(imported, tmp_path):
    scene = AnimatedScene()
    arm = scene.add("arm", None, trimesh.creation.box((1.0, 2.0, 3.0)))
    scene.animate(arm, "rotation", [0, 5], turning((1, 0, 0), [-10, 70]))
    code, out, err = imported(
        scene.write(tmp_path / "a.glb"), "--out", tmp_path / "p", "--scale", 1, "--json"
    )
    assert code == 0, err
    assert json.loads(out)["joints"]["arm"]["animations"] == ["move"]
    description = tmp_path / "p" / "spacecraft.yaml"
    record = yaml.safe_load(description.read_text())
    keypoints = {name: point["at"] for name, point in record["keypoints"].items()}
    description.write_text(yaml.safe_dump({**record, "joints": {}, "keypoints": keypoints}))
    craft = build("package", package=str(tmp_path / "p"))
    assert craft.joints == ()
    assert craft.keypoint_joints == {}
    assert {part.joint for part in craft.parts} == {None}


def test_a_run_tells_once_what_it_leaves_of_the_animations(posse, tmp_path):
    scene = AnimatedScene()
    arm = scene.add("arm", None, trimesh.creation.box((1.0, 2.0, 3.0)))
    scene.animate(arm, "scale", [0, 5], [(1, 1, 1), (2, 2, 2)])
    scene.write(tmp_path / "a.glb")
    done = posse("import", "a.glb", "--out", "p", "--scale", 1)
    assert done.returncode == 0, done.stderr
    nodes = "the animations of some nodes are not those of joints, so they stay at rest: arm (scale)"
    said = f"a.glb: {nodes}\n"
    assert done.stderr == f"posse: warning: {said}"
    size = ["-o", "camera.width_px=80", "-o", "camera.height_px=60", "-o", "sky.earth=false"]
    done = posse("run", "p/scenario.yaml", "--renderer", "flat", "--frames", 1, "--out", "d", *size)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("warning") == 1, done.stderr
    assert f"/p/{said}" in done.stderr
