"""The whole path with a real renderer: what outside tools make of a dataset that `posse run` made."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO
from scipy.spatial.transform import Rotation

FRAMES = 3


@pytest.fixture(scope="module")
def dataset(posse_in, tmp_path_factory) -> Path:
    pytest.importorskip("posse_render_mitsuba", reason="the Mitsuba plugin is not installed")
    folder = tmp_path_factory.mktemp("run")
    size = ("-o", "camera.width_px=320", "-o", "camera.height_px=240")
    options = ("-o", "renderer.spp=8", "-o", "renderer.variant=scalar")
    done = posse_in(
        folder, "run", "aqua", "--renderer", "mitsuba", "--frames", FRAMES, "--out", "d", *size, *options
    )
    assert done.returncode == 0, done.stderr
    return folder / "d"


@pytest.fixture(scope="module")
def coco(dataset) -> COCO:
    return COCO(dataset / "coco.json")


def annotations(coco: COCO):
    for image in coco.loadImgs(coco.getImgIds()):
        (annotation,) = coco.loadAnns(coco.getAnnIds(image["id"]))
        yield image, annotation


def test_its_own_proof_passes(dataset, posse_in):
    done = posse_in(dataset.parent, "validate", dataset)
    assert done.returncode == 0, done.stdout


def test_speed_pose_meets_coco_keypoints(dataset, coco):
    camera = json.loads((dataset / "camera.json").read_text())
    K = np.array(camera["cameraMatrix"])
    (craft_file,) = (dataset / "spacecraft").glob("*.json")
    points = json.loads(craft_file.read_text())["keypoints"]
    poses = {Path(p["filename"]).name: p for p in json.loads((dataset / "speed.json").read_text())}
    names = coco.loadCats(coco.getCatIds())[0]["keypoints"]
    compared = 0
    for image, annotation in annotations(coco):
        pose = poses[Path(image["file_name"]).name]
        w, x, y, z = pose["q_vbs2tango_true"]
        R = Rotation.from_quat([x, y, z, w]).as_matrix()
        for name, (u, v, visibility) in zip(
            names, np.reshape(annotation["keypoints"], (-1, 3)), strict=True
        ):
            if visibility == 0:
                continue
            seen = K @ (R @ np.array(points[name]) + np.array(pose["r_Vo2To_vbs_true"]))
            assert np.hypot(*(seen[:2] / seen[2] - (u, v))) < 0.01
            compared += 1
    assert compared > 10 * FRAMES


@pytest.mark.filterwarnings("ignore::DeprecationWarning:pycocotools")
def test_box_is_around_the_mask(coco):
    for _, annotation in annotations(coco):
        rows, columns = np.nonzero(coco_mask.decode(annotation["segmentation"]))
        x, y, width, height = annotation["bbox"]
        edges = (x, y, x + width - 1, y + height - 1)
        assert edges == pytest.approx((columns.min(), rows.min(), columns.max(), rows.max()), abs=1)


def test_depth_is_where_another_ray_tracer_meets_the_mesh(dataset):
    (mesh_file,) = (dataset / "spacecraft").glob("*.ply")
    mesh = trimesh.load_mesh(mesh_file, process=False)
    tracer = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    K_inverse = np.linalg.inv(json.loads((dataset / "camera.json").read_text())["cameraMatrix"])
    pick = np.random.default_rng(0)
    for line in (dataset / "labels" / "shard-00000.jsonl").read_text().splitlines():
        labels = json.loads(line)
        with np.load(dataset / labels["truth"]) as arrays:
            depth = arrays["depth_m"]
        pixels = pick.choice(np.argwhere(np.isfinite(depth)), 40, replace=False)
        rays_cam = np.column_stack([pixels[:, ::-1], np.ones(len(pixels))]) @ K_inverse.T
        w, x, y, z = labels["q_cam_from_body"]
        R = Rotation.from_quat([x, y, z, w]).as_matrix()
        origin = -R.T @ np.array(labels["t_body_cam_m"])
        hits, rays, _ = tracer.intersects_location(np.tile(origin, (len(pixels), 1)), rays_cam @ R)
        z_m = (hits @ R.T + labels["t_body_cam_m"])[:, 2]
        nearest = np.full(len(pixels), np.inf)
        np.minimum.at(nearest, rays, z_m)
        assert np.abs(nearest - depth[tuple(pixels.T)]).max() < 1e-3


def test_the_craft_is_lit_and_the_sky_is_not_grey(dataset):
    for line in (dataset / "labels" / "shard-00000.jsonl").read_text().splitlines():
        labels = json.loads(line)
        image = cv2.imread(str(dataset / labels["image"]), cv2.IMREAD_UNCHANGED)
        assert image.shape == (240, 320, 3)
        assert image.dtype == np.uint8
        with np.load(dataset / labels["truth"]) as arrays:
            craft = arrays["part_id"] >= 0
        if labels["sun_fraction_target"] == 1 and labels["fraction_lit"] > 0.3:
            assert image[craft].mean() > 20
        if labels["sun_fraction_target"] == 0:
            assert image[craft].mean() < 5
