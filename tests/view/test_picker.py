"""The page that picks keypoints, driven in headless Chromium by real events of the pointer and keys."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import yaml
from browser import opened
from click.testing import CliRunner

from posse_core._cli.import_mesh import command
from posse_core._plugins.loading import load_plugins
from posse_core._view.picker.page import picker_page
from tests.support.animated_gltf import AnimatedScene, turning

HALF = np.array([1.0, 0.6, 0.4])


def import_mesh(mesh, folder, *arguments):
    given = [mesh, "--out", folder, "--scale", 1, *arguments]
    done = CliRunner().invoke(command, list(map(str, given)))
    assert done.exit_code == 0, done.output
    return done


def build(source, **options):
    registry = load_plugins().registry
    return registry.create("scene", source, registry.options("scene", source, options)).build()


def package(folder):
    return build("package", package=str(folder))


def paste(folder, text):
    """Put the keys of a keypoint file into the package's description, as a person does."""
    path = folder / "spacecraft.yaml"
    path.write_text(
        yaml.safe_dump({**yaml.safe_load(path.read_text()), **yaml.safe_load(text)}, sort_keys=False)
    )


def at(tab, point):
    """Where a point is in the window; the page's own projection is judged by what clicks there give."""
    x, y, *_ = tab.place("#mesh")
    u, v = tab.tell(f"view.toCanvas({list(map(float, point))})")
    return x + u, y + v


def text_of(tab):
    return tab.tell("document.querySelector('#yaml').value")


@pytest.fixture
def brick(tmp_path):
    trimesh.creation.box(2 * HALF).export(tmp_path / "brick.stl")
    import_mesh(tmp_path / "brick.stl", tmp_path / "p", "--keypoint-count", 2, "--symmetry", "z:2")
    return tmp_path / "p"


def test_a_page_that_nobody_touches_saves_what_the_package_has(brick, tmp_path):
    with opened(brick / "keypoints.html", tmp_path) as tab:
        saved = yaml.safe_load(text_of(tab))
        assert tab.errors == []
    record = yaml.safe_load((brick / "spacecraft.yaml").read_text())
    assert saved == {key: record[key] for key in saved}
    assert set(saved) == {"measured_from_m", "keypoints", "skeleton", "symmetries"}
    assert len(saved["keypoints"]) == 2


def test_a_click_near_a_vertex_picks_it_exactly(brick, tmp_path):
    """From the side at which the page begins, the corner at +X −Y +Z is the nearest."""
    corner = HALF * [1, -1, 1]
    with opened(brick / "keypoints.html", tmp_path) as tab:
        x, y = at(tab, corner)
        tab.click(x + 9, y - 6)
        assert tab.errors == []
        saved = yaml.safe_load(text_of(tab))
    (new,) = set(saved["keypoints"]) - set(
        yaml.safe_load((brick / "spacecraft.yaml").read_text())["keypoints"]
    )
    assert saved["keypoints"][new] == pytest.approx(corner.tolist(), abs=1e-12)
    assert new[0] == "B"  # +Z is the side towards the nadir
    paste(brick, yaml.safe_dump(saved))
    np.testing.assert_allclose(package(brick).keypoints_body_m[new], corner, atol=1e-12)


def test_a_vertex_behind_the_surface_is_not_picked_until_it_is_turned_to_the_front(brick, tmp_path):
    hidden = HALF * [-1, 1, -1]
    with opened(brick / "keypoints.html", tmp_path) as tab:
        before = text_of(tab)
        tab.click(*at(tab, hidden))
        assert text_of(tab) == before
        x, y, width, height = tab.place("#mesh")
        middle = (x + width / 2, y + height / 2)
        tab.drag(middle, (middle[0] + 377, middle[1]))  # half a turn, at 120 px a radian
        tab.drag(middle, (middle[0], middle[1] - 100))
        tab.click(*at(tab, hidden))
        points = yaml.safe_load(text_of(tab))["keypoints"].values()
        assert tab.errors == []
    assert any(np.allclose(point, hidden, atol=1e-12) for point in points)


def test_the_wheel_keeps_what_is_under_the_pointer_and_shift_moves(brick, tmp_path):
    corner = HALF * [1, -1, 1]
    with opened(brick / "keypoints.html", tmp_path) as tab:
        start, far = at(tab, corner), at(tab, [0, 0, 0])
        tab.wheel(*start, -200)
        assert at(tab, corner) == pytest.approx(start, abs=1)
        assert np.hypot(*np.subtract(at(tab, [0, 0, 0]), start)) > 1.2 * np.hypot(
            *np.subtract(far, start)
        )
        tab.drag(start, (start[0] - 30, start[1] + 50), "shift")
        assert at(tab, corner) == pytest.approx((start[0] - 30, start[1] + 50), abs=1)
        tab.press("#whole")
        assert at(tab, corner) == pytest.approx(start, abs=1)
        assert tab.errors == []


def test_keypoints_are_renamed_and_removed_with_their_lines(tmp_path):
    trimesh.creation.box(2 * HALF).export(tmp_path / "brick.stl")
    corners = {"T1": [1, -0.6, -0.4], "T2": [-1, -0.6, -0.4], "B1": [1, -0.6, 0.4]}
    (tmp_path / "k.yaml").write_text(
        yaml.safe_dump({"keypoints": corners, "skeleton": [["T1", "T2"], ["T1", "B1"]]}, sort_keys=False)
    )
    folder = tmp_path / "p"
    import_mesh(tmp_path / "brick.stl", folder, "--keypoints", tmp_path / "k.yaml")
    name = "#points tbody tr:nth-child({}) input"
    with opened(folder / "keypoints.html", tmp_path) as tab:
        # To YAML "no" is false; the others are refused.
        for row, text in ((1, "no"), (2, "a b"), (2, "B1")):
            tab.press(name.format(row))
            tab.tell("document.activeElement.select()")
            tab.type(text)
            tab.key("Tab", 9)
        assert tab.tell("[...document.querySelectorAll('#points input')].map((i) => i.value)") == [
            "no",
            "T2",
            "B1",
        ]
        tab.press("#points tbody tr:nth-child(2) button")
        assert tab.errors == []
        saved = text_of(tab)
    paste(folder, saved)
    craft = package(folder)
    assert list(craft.keypoints_body_m) == ["no", "B1"]
    assert craft.skeleton == (("no", "B1"),)


def test_the_saved_file_is_one_that_import_takes(brick, tmp_path):
    with opened(brick / "keypoints.html", tmp_path) as tab:
        tab.click(*at(tab, HALF * [1, -1, 1]))
        tab.press("#save")
        text = text_of(tab)
        for _ in range(50):
            if (tmp_path / "keypoints.yaml").exists():
                break
            tab.tell("new Promise((done) => setTimeout(done, 100))")
        assert tab.errors == []
    assert (tmp_path / "keypoints.yaml").read_text() == text
    # Another origin than that of the page.
    arguments = ("--keypoints", tmp_path / "keypoints.yaml", "--centre-of-mass", 0.1, 0.2, -0.1)
    import_mesh(tmp_path / "brick.stl", tmp_path / "q", *arguments)
    ours, theirs = package(brick), package(tmp_path / "q")
    shift = [0.1, 0.2, -0.1]
    assert len(theirs.keypoints_body_m) == 3
    for name, point in ours.keypoints_body_m.items():
        np.testing.assert_allclose(theirs.keypoints_body_m[name], point - shift, atol=1e-9)
    np.testing.assert_allclose(theirs.symmetries, ours.symmetries, atol=1e-12)


def test_a_vertex_of_a_joints_part_is_carried_by_the_joint(tmp_path):
    scene = AnimatedScene()
    base = scene.add("base", None, trimesh.creation.box((2.0, 2.0, 2.0)))
    arm = scene.add("solar_arm", base, trimesh.creation.box((0.4, 0.4, 3.0)), translation=(3, 0, 0))
    scene.animate(arm, "rotation", [0, 5], turning((1, 0, 0), [-10, 70]))
    mesh, folder = scene.write(tmp_path / "a.glb"), tmp_path / "p"
    import_mesh(mesh, folder, "--keypoint-count", 0, "--centre-of-mass", 0, 0, 0)
    with opened(folder / "keypoints.html", tmp_path) as tab:
        tab.click(*at(tab, [3.2, -0.2, 1.5]))
        tab.click(*at(tab, [-1, -1, 1]))
        paste(folder, text_of(tab))
        assert tab.errors == []
    craft = package(folder)
    assert craft.keypoint_joints == {"S1": "solar_arm"}  # by the part's name, as keypoints are proposed
    np.testing.assert_allclose(craft.keypoints_body_m["S1"], [3.2, -0.2, 1.5], atol=1e-6)
    np.testing.assert_allclose(craft.keypoints_body_m["B1"], [-1, -1, 1], atol=1e-6)


def test_a_mesh_of_a_hundred_thousand_triangles_snaps_to_its_own_vertices(tmp_path):
    ball = trimesh.creation.icosphere(6)
    ball = trimesh.util.concatenate([ball, trimesh.creation.box((3.0, 0.5, 0.5)).subdivide_loop(5)])
    assert len(ball.faces) > 90_000
    ball.export(tmp_path / "ball.ply")
    craft = build("mesh", mesh=str(tmp_path / "ball.ply"), scale_m_per_unit=1.0)
    page = tmp_path / "keypoints.html"
    page.write_bytes(picker_page(craft, (0.0, 0.0, 0.0)))
    assert page.stat().st_size < 5e6
    with opened(page, tmp_path) as tab:
        x, y, width, height = tab.place("#mesh")
        for share in (0.45, 0.55):
            tab.click(x + share * width, y + 0.45 * height)
        points = list(yaml.safe_load(text_of(tab))["keypoints"].values())
        assert tab.errors == []
    assert len(points) == 2
    vertices = craft.parts[0].vertices_body_m
    for point in points:
        assert np.abs(vertices - point).max(axis=1).min() < 1e-6
