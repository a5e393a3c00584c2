"""A glTF file of an animated robot arm: imported, run, and compared with its scene graph."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

import posse_core
from posse_core import Dataset
from tests.support.animated_gltf import AnimatedScene, quaternion, turning

SCALE = 0.02
"""Metres per unit of the file's scene."""
AXES = "x -z y"
R_BODY_FROM_SCENE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
END_S = 8.0
COUNT = 9


def robot_arm() -> AnimatedScene:
    """A base, three links and a gripper that slides, in millimetres with Z up, within a root that turns
    them to the file's Y up and scales them, and one link modelled at half its size."""
    box = trimesh.creation.box
    arm = AnimatedScene()
    root = arm.add(
        "Armature.001", rotation=quaternion((1, 0, 0), -90), scale=(0.05,) * 3, translation=(3, -2, 7)
    )
    base = arm.add("base", root, box((900, 900, 400)))
    turret = arm.add("turret", base, box((500, 400, 300)), translation=(0, 0, 350))
    upper_rest = quaternion((0, 1, 0), 20)
    upper = arm.add("upper", turret, box((150, 200, 900)), rotation=upper_rest, translation=(0, 0, 600))
    rest = quaternion((1, 2, 3), 35)
    lower = arm.add(
        "lower", upper, box((300, 240, 1600)), rotation=rest, scale=(0.5,) * 3, translation=(60, 0, 650)
    )
    gripper = arm.add("gripper", lower, box((500, 160, 120)), translation=(0, 0, 950))
    arm.add("finger", gripper, box((90, 120, 300)), translation=(200, 0, 200))
    # A turret that goes on the same way for a turn and a half, with quaternions of either sign.
    turns = turning((0, 0, 1), [0, 120, 240, 360, 540]) * np.array([1, -1, -1, 1, 1])[:, None]
    arm.animate(turret, "rotation", [0, 2, 4, 6, END_S], turns)
    keys = turning((0.3, 1, 0), [0, 50, -30], upper_rest)
    ways = turning((0.3, 1, 0), [180, 200, 160], upper_rest)
    arm.animate(
        upper, "rotation", [1, 3, 7], np.stack([0.1 * ways, keys, 0.2 * ways], axis=1), "CUBICSPLINE"
    )
    arm.animate(lower, "rotation", [0, 2.5, 5.5], turning((1, 0, 0), [10, 80, -40], rest), "STEP")
    slides = np.array([950.0, 1150.0, 1000.0])[:, None] * (0, 0, 1)
    rates = np.array([0.0, 90.0, -50.0])[:, None] * (0, 0, 1)
    arm.animate(
        gripper, "translation", [2, 5, 7.5], np.stack([rates, slides, 2 * rates], axis=1), "CUBICSPLINE"
    )
    arm.animate(gripper, "scale", [0, 8], [(1, 1, 1)] * 2)
    return arm


@pytest.fixture(scope="module")
def made(posse_in, tmp_path_factory):
    """The scene graph, the package's description and the dataset."""
    folder = tmp_path_factory.mktemp("arm")
    arm = robot_arm()
    arm.write(folder / "arm.glb")
    done = posse_in(folder, "import", "arm.glb", "--out", "craft", "--scale", SCALE, "--axes", AXES)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    size = ["-o", "camera.width_px=320", "-o", "camera.height_px=240", "-o", "sky.earth=false"]
    options = [*size, "--renderer", "flat", "-o", f"times.count={COUNT}", "--out", "dataset"]
    done = posse_in(folder, "run", "craft/scenario.yaml", *options)
    assert done.returncode == 0, done.stderr
    description = yaml.safe_load((folder / "craft" / "spacecraft.yaml").read_text())
    return arm, description, Dataset(folder / "dataset")


def in_body(arm: AnimatedScene, description, name: str, t_s: float | None):
    """The vertices of a node's mesh in body axes, m."""
    node = next(k for k, each in enumerate(arm.nodes) if each["name"] == name)
    scene_m = SCALE * arm.vertices(node, t_s) @ R_BODY_FROM_SCENE.T
    return scene_m - description["centre_of_mass_m"]


def in_camera(line, x_body_m):
    w, *v = line.q_cam_from_body
    return x_body_m @ Rotation.from_quat([*v, w]).as_matrix().T + line.t_body_cam_m


def test_the_proposed_scenario_plays_every_joint(made):
    _, description, dataset = made
    assert list(description["joints"]) == ["turret", "upper", "lower", "gripper"]
    assert [joint["kind"] for joint in description["joints"].values()] == 3 * ["revolute"] + [
        "prismatic"
    ]
    assert description["joints"]["gripper"]["parts"] == ["gripper", "finger"]
    np.testing.assert_allclose(description["joints"]["turret"]["limits_deg"], (0, 540), atol=1e-4)
    np.testing.assert_allclose([line.t_s for line in dataset], np.linspace(0, END_S, COUNT), atol=1e-9)


def test_every_link_is_where_the_scene_graph_has_it(made):
    arm, description, dataset = made
    info = dataset.spacecraft
    mesh = dataset.mesh()
    for line in dataset:
        for number, part in enumerate(info.parts):
            x_link_m = mesh.vertices_body_m[np.unique(mesh.faces[mesh.part_id == number])]
            if part in info.part_joints:
                joint = line.joints[info.part_joints[part]]
                w, *v = joint.q_cam_from_link
                found = x_link_m @ Rotation.from_quat([*v, w]).as_matrix().T + joint.t_link_cam_m
            else:
                found = in_camera(line, x_link_m)
            wanted = in_camera(line, in_body(arm, description, part, line.t_s))
            apart = np.linalg.norm(found[:, None] - wanted[None], axis=-1)
            # The file is in single precision, of which metres have 1e-7.
            assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 2e-6


def test_rates_are_the_derivatives(made):
    """Where a rate changes at a frame, it is the later one; steps have none."""
    _, _, dataset = made
    for line in dataset:
        t_s = line.t_s
        deg_s = 60 if t_s < 6 else 90 if t_s < END_S else 0
        assert line.joints["turret"].rate == pytest.approx(np.radians(deg_s), abs=1e-6)
        assert line.joints["lower"].rate == 0
    # The tangents of the gripper's second key, 90 and 180 mm/s, are in a link at half its size.
    assert dataset[5].joints["gripper"].rate == pytest.approx(0.09, rel=1e-6)


def test_parts_cover_the_pixels_that_a_ray_tracer_finds(made):
    arm, description, dataset = made
    camera = dataset.camera
    rows, columns = np.mgrid[0 : camera.height_px, 0 : camera.width_px]
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1).reshape(-1, 3)
    rays = pixels @ np.linalg.inv(camera.matrix).T
    for line in dataset:
        meshes = []
        for part in dataset.spacecraft.parts:
            node = next(k for k, each in enumerate(arm.nodes) if each["name"] == part)
            x_body_m = in_body(arm, description, part, line.t_s)
            faces = arm.meshes[arm.nodes[node]["mesh"]].faces
            meshes.append(trimesh.Trimesh(in_camera(line, x_body_m), faces, process=False))
        whole = trimesh.util.concatenate(meshes)
        triangle = whole.ray.intersects_first(np.zeros_like(rays), rays)
        number = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
        hit = number[triangle[triangle >= 0]]
        assert len(hit) > 100
        for k, part in enumerate(dataset.spacecraft.parts):
            assert abs(line.part_area_px[part] - np.sum(hit == k)) <= 2


def test_keypoints_move_with_their_links(made):
    arm, description, dataset = made
    moved = {name: point for name, point in description["keypoints"].items() if point["joint"]}
    assert {point["joint"] for point in moved.values()} >= {"gripper"}
    K = dataset.camera.matrix
    for line in dataset:
        for name, point in moved.items():
            # The vertex that was nearest at rest, where it is now.
            candidates = [
                (np.linalg.norm(rest - point["at"], axis=1), now)
                for part in dataset.spacecraft.parts
                for rest in [in_body(arm, description, part, None)]
                for now in [in_body(arm, description, part, line.t_s)]
            ]
            distance, now = min(candidates, key=lambda pair: pair[0].min())
            x_cam = in_camera(line, now[np.argmin(distance)])
            u, v = (K @ x_cam)[:2] / x_cam[2]
            assert np.hypot(line.keypoints[name].u_px - u, line.keypoints[name].v_px - v) < 0.01


def test_the_rasteriser_draws_the_arm_where_the_labels_are(made):
    pytest.importorskip("posse_render_raster")
    _, _, dataset = made
    scenario = dataset.folder.parent / "craft" / "scenario.yaml"
    size = {"camera.width_px": 320, "camera.height_px": 240, "sky.earth": False, "times.count": 5}
    with posse_core.open(scenario, renderer="raster", overrides=size) as simulator:
        shapes = []
        for index in range(5):
            frame = simulator.frame(simulator.state(index))
            drawn = np.zeros((240, 320), dtype=bool)
            drawn[frame.light.craft.box.slices] = frame.light.craft.coverage > 0.5
            labelled = frame.labels.mask_rle.mask()
            # A pixel that is half covered may fall to either side.
            assert np.sum(drawn ^ labelled) < 0.1 * labelled.sum()
            shapes.append(labelled)
        assert np.sum(shapes[0] ^ shapes[2]) > 0.3 * labelled.sum()
