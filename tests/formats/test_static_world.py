"""COLMAP and nerfstudio: the target as a static world, read by pycolmap or by the file's own rules."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cuboid
import cv2
import numpy as np
import pycolmap
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._dataset.camera import write_camera
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.mesh import Mesh
from posse_core._errors import InputError
from posse_core._formats.colmap import ColmapWriter
from posse_core._formats.nerfstudio import NerfstudioWriter
from posse_core._formats.sparse_points import surface_points
from posse_core._model.distortion import BrownConrady
from posse_core._plugins.options import NoOptions
from posse_core._selection.partition import write_partition

SCENARIO = """\
target: {name: aqua}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7080000, e: 0.001, i_deg: 98, raan_deg: 10,
             argp_deg: 20, mean_anomaly_deg: 30}
relative: {roe_m: [0, 0, 15, 0, 15, 0]}
times: {duration_orbits: 1, count: 9}
camera: {width_px: 96, height_px: 72, hfov_deg: 60, LENS}
sky: {earth: false, stars: null}
renderer: {name: flat}
writers: [colmap, nerfstudio]
"""
LENSES = {
    "PINHOLE": "distortion: null",
    "OPENCV": "distortion: [-0.12, 0.03, 0.002, -0.003]",
    "FULL_OPENCV": "distortion: [-0.12, 0.03, 0.002, -0.003, 0.01]",
    "OPENCV_FISHEYE": "distortion_model: fisheye, distortion: [-0.02, 0.01, -0.003, 0.0005]",
}
WRITERS = {"COLMAP": ColmapWriter, "nerfstudio": NerfstudioWriter}


@pytest.fixture(scope="module", params=LENSES)
def lens(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def folder(tmp_path_factory, posse_in, lens) -> Path:
    """Nine views around Aqua, exported at the end of the run."""
    above = tmp_path_factory.mktemp(lens)
    (above / "around.yaml").write_text(SCENARIO.replace("LENS", LENSES[lens]))
    done = posse_in(above, "run", "around.yaml", "--out", "d")
    assert done.returncode == 0, done.stderr
    return above / "d"


@pytest.fixture(scope="module")
def bricks(tmp_path_factory) -> Path:
    """The dataset of two cuboids, exported to both formats; not to be changed."""
    crafts = (("brick", cuboid.HALF), ("plate", np.array([2.0, 1.0, 0.1])))
    folder = cuboid.write_dataset(tmp_path_factory.mktemp("bricks") / "d", crafts)
    for writer in WRITERS.values():
        writer(NoOptions()).write(Dataset(folder), folder)
    return folder


def model_of(folder: Path, name: str) -> pycolmap.Reconstruction:
    return pycolmap.Reconstruction(str(folder / "colmap" / name / "sparse" / "0"))


def labels_by_name(folder: Path, name: str) -> dict:
    return {Path(line.image).name: line for line in Dataset(folder) if line.spacecraft == name}


# COLMAP


def test_colmap_s_own_camera_projects_keypoints_to_their_labels(folder, lens):
    dataset, model = Dataset(folder), model_of(folder, "aqua")
    labels = labels_by_name(folder, "aqua")
    assert {image.name for image in model.images.values()} == labels.keys()
    assert len(model.reg_image_ids()) == 9
    compared = 0
    for image in model.images.values():
        camera = model.cameras[image.camera_id]
        assert camera.model.name == lens
        for name, (u_px, v_px, visibility) in labels[image.name].keypoints.items():
            if visibility:
                x_cam_m = image.cam_from_world() * dataset.spacecraft.keypoints_body_m[name]
                # The first pixel's centre is (0.5, 0.5) in COLMAP.
                u, v = camera.img_from_cam(x_cam_m) - 0.5
                assert np.hypot(u - u_px, v - v_px) < 0.01
                compared += 1
    assert compared > 30


def test_colmap_tracks_are_where_pycolmap_projects_their_points(folder):
    model = model_of(folder, "aqua")
    assert len(model.points3D) > 1000
    for id_, point in model.points3D.items():
        assert point.track.length() >= 2
        for element in point.track.elements:
            image = model.images[element.image_id]
            observed = image.points2D[element.point2D_idx]
            assert observed.point3D_id == id_
            projected = model.cameras[image.camera_id].img_from_cam(image.cam_from_world() * point.xyz)
            assert np.abs(projected - observed.xy).max() < 0.01


def test_colmap_shows_the_points_that_another_ray_tracer_sees(folder):
    mesh = Dataset(folder).mesh()
    solid = trimesh.Trimesh(mesh.vertices_body_m, mesh.faces, process=False)
    tracer = trimesh.ray.ray_triangle.RayMeshIntersector(solid)
    model = model_of(folder, "aqua")
    ids = sorted(model.points3D)[::12]
    x_body_m = np.array([model.points3D[id_].xyz for id_ in ids])
    for image in list(model.images.values())[::4]:
        camera, shown = model.cameras[image.camera_id], {p.point3D_id for p in image.points2D}
        camera_m = image.projection_center()
        uv = camera.img_from_cam(np.array([image.cam_from_world() * x for x in x_body_m]))
        inside = ((uv >= 0) & (uv < [camera.width, camera.height])).all(axis=1)
        away_m = np.linalg.norm(x_body_m - camera_m, axis=1)
        rays = (x_body_m - camera_m) / away_m[:, None]
        met, ray, _ = tracer.intersects_location(np.tile(camera_m, (len(rays), 1)), rays)
        first_m = np.full(len(rays), np.inf)
        np.minimum.at(first_m, ray, np.linalg.norm(met - camera_m, axis=1))
        expected = inside & (away_m < first_m + 1e-5)
        assert 0.1 < expected.mean() < 0.9
        assert np.array_equal([id_ in shown for id_ in ids], expected)


def test_colmap_adjusts_disturbed_poses_back_to_the_labels(folder):
    """Bundle adjustment of poses (1 degree, 0.3 m off) and points (0.1 m off); two poses are held, which
    fixes scale and axes."""
    random = np.random.default_rng(5)
    model = model_of(folder, "aqua")
    held = (1, 4)
    config = pycolmap.BundleAdjustmentConfig()
    for id_, image in model.images.items():
        config.add_image(id_)
        pose = image.cam_from_world()
        if id_ in held:
            config.set_constant_rig_from_world_pose(image.frame_id)
            continue
        turn = Rotation.from_rotvec(random.normal(0, np.radians(1), 3)).as_matrix()
        image.frame.rig_from_world = pycolmap.Rigid3d(
            pycolmap.Rotation3d(turn @ pose.rotation.matrix()),
            pose.translation + random.normal(0, 0.3, 3),
        )
    for point in model.points3D.values():
        point.xyz = point.xyz + random.normal(0, 0.1, 3)
    model.update_point_3d_errors()
    assert model.compute_mean_reprojection_error() > 1
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = False
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()
    labels = labels_by_name(folder, "aqua")
    for image in model.images.values():
        found, line = image.cam_from_world(), labels[image.name]
        w, x, y, z = line.q_cam_from_body
        off = Rotation.from_matrix(found.rotation.matrix()) * Rotation.from_quat([x, y, z, w]).inv()
        assert off.magnitude() < 1e-6
        assert np.linalg.norm(found.translation - line.t_body_cam_m) < 1e-5


def test_colmap_finds_features_within_the_masks_only(bricks, tmp_path):
    colmap = bricks / "colmap" / "brick"

    def features(database: Path, **options: object) -> list[np.ndarray]:
        extraction = pycolmap.FeatureExtractionOptions(num_threads=1, use_gpu=False)
        pycolmap.extract_features(
            database, colmap / "images", reader_options=options, extraction_options=extraction
        )
        with pycolmap.Database.open(database) as opened:
            return [opened.read_keypoints(i + 1)[:, :2] for i in range(opened.num_images())]

    def outside(found: list[np.ndarray]) -> int:
        masks = [Dataset(bricks).mask(i) for i in range(6)]
        return sum(
            int((~mask[uv[:, 1].astype(int), uv[:, 0].astype(int)]).sum())
            for mask, uv in zip(masks, found, strict=True)
        )

    assert outside(features(tmp_path / "all.db")) > 0
    within = features(tmp_path / "masked.db", mask_path=colmap / "masks")
    assert sum(map(len, within)) > 0
    assert outside(within) == 0


def test_colmap_model_of_each_cuboid_has_its_faces_colours_and_visibility(bricks):
    for name, half in (("brick", cuboid.HALF), ("plate", np.array([2.0, 1.0, 0.1]))):
        model, labels = model_of(bricks, name), labels_by_name(bricks, name)
        assert len(model.images) == 6
        empty = [image.name for image in model.images.values() if image.num_points2D() == 0]
        assert empty == [key for key, line in labels.items() if line.box_visible_px is None]
        for point in model.points3D.values():
            share = point.xyz / half
            axis = np.abs(share).argmax()
            assert np.abs(share).max() == pytest.approx(1, abs=1e-12)
            side = 2 * axis + (share[axis] > 0)
            shown = {element.image_id for element in point.track.elements}
            for id_, image in model.images.items():
                looks_on = image.projection_center()[axis] * np.sign(share[axis]) > half[axis]
                uv = model.cameras[1].img_from_cam(image.cam_from_world() * point.xyz)
                inside = uv is not None and (uv >= 0).all() and (uv < [160, 120]).all()
                assert (id_ in shown) == (looks_on and inside)
            inner = np.delete(half - np.abs(point.xyz), axis).min()
            if name == "brick" and inner > 0.5:  # no pixel that shows the point meets another face
                assert np.array_equal(point.color, np.full(3, 40 * side + 30))


# nerfstudio


def transforms(folder: Path, name: str) -> dict:
    return json.loads((folder / "nerfstudio" / name / "transforms.json").read_text())


def projected(value: dict, frame: dict, x_world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) pixels and (N,) depth by nerfstudio's conventions: camera axes of OpenGL, the first pixel's
    centre at (0.5, 0.5), distortion as OpenCV's."""
    pose = np.array(frame["transform_matrix"])
    x_gl = (x_world - pose[:3, 3]) @ pose[:3, :3]
    x_cam = x_gl * [1, -1, -1]
    K = np.array([[value["fl_x"], 0, value["cx"]], [0, value["fl_y"], value["cy"]], [0, 0, 1]])
    if value["camera_model"] == "OPENCV_FISHEYE":
        project, names = cv2.fisheye.projectPoints, ("k1", "k2", "k3", "k4")
    else:
        project, names = cv2.projectPoints, ("k1", "k2", "p1", "p2", "k3")
    lens = np.array([value[key] for key in names])
    uv, _ = project(x_cam[:, None], np.zeros(3), np.zeros(3), K, lens)
    return uv[:, 0], x_cam[:, 2]


def test_nerfstudio_projects_keypoints_to_their_labels(folder):
    dataset, value = Dataset(folder), transforms(folder, "aqua")
    assert (value["w"], value["h"]) == (96, 72)
    labels = labels_by_name(folder, "aqua")
    assert [Path(frame["file_path"]).name for frame in value["frames"]] == list(labels)
    points = np.array(list(dataset.spacecraft.keypoints_body_m.values()))
    for frame in value["frames"]:
        pose = np.array(frame["transform_matrix"])
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
        uv, depth_m = projected(value, frame, points)
        assert (depth_m > 0).all()
        for (u, v), (u_px, v_px, visibility) in zip(
            uv, labels[Path(frame["file_path"]).name].keypoints.values(), strict=True
        ):
            if visibility:
                assert np.hypot(u - 0.5 - u_px, v - 0.5 - v_px) < 0.01


def test_nerfstudio_points_are_on_the_masks(folder):
    """A point may be hidden, but it is never beside the spacecraft, except on what is thinner than a
    pixel and meets no pixel's centre."""
    value, home = transforms(folder, "aqua"), folder / "nerfstudio" / "aqua"
    cloud = trimesh.load(home / value["ply_file_path"])
    model = model_of(folder, "aqua")
    assert len(cloud.vertices) == len(model.points3D)
    assert np.abs(cloud.vertices - [p.xyz for _, p in sorted(model.points3D.items())]).max() < 1e-6
    for frame in value["frames"]:
        mask = cv2.imread(str(home / frame["mask_path"]), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(mask == 255, Dataset(folder).mask(int(Path(frame["mask_path"]).stem)))
        uv, _ = projected(value, frame, np.array(cloud.vertices))
        column, row = np.floor(uv).astype(int).T
        inside = (column >= 0) & (column < 96) & (row >= 0) & (row < 72)
        near = cv2.dilate(mask, np.ones((3, 3)))  # a point may be seen between two pixels' centres
        assert np.mean(near[row[inside], column[inside]] == 255) > 0.99


def test_nerfstudio_parts_are_those_of_the_partition(bricks, tmp_path):
    shutil.copytree(bricks, tmp_path / "d")
    dataset = Dataset(tmp_path / "d")
    parts = write_partition(dataset, (2, 1, 1), 0, "frame")
    NerfstudioWriter(NoOptions()).write(dataset, tmp_path)
    for part, key in (("train", "train"), ("valid", "val"), ("test", "test")):
        names = [transforms(tmp_path, name)[f"{key}_filenames"] for name in ("brick", "plate")]
        assert [int(Path(name).stem) for both in names for name in both] == parts[part]
    assert "train_filenames" not in transforms(bricks, "brick")


def test_a_rational_lens_is_full_opencv_to_colmap_and_refused_by_nerfstudio(bricks, tmp_path):
    shutil.copytree(bricks, tmp_path / "d")
    lens = BrownConrady(0.3, -0.1, 0.001, -0.002, 0.02, 0.5, 0.1, -0.02)
    camera = replace(cuboid.CAMERA, distortion=lens)
    write_camera(camera, tmp_path / "d/camera.json")
    dataset = Dataset(tmp_path / "d")
    ColmapWriter(NoOptions()).write(dataset, tmp_path)
    theirs = model_of(tmp_path, "brick").cameras[1]
    assert theirs.model.name == "FULL_OPENCV"
    x_cam_m = np.random.default_rng(0).uniform([-1, -1, 3], [1, 1, 5], (50, 3))
    np.testing.assert_allclose(theirs.img_from_cam(x_cam_m) - 0.5, camera.project(x_cam_m), atol=1e-9)
    with pytest.raises(InputError, match=r"nerfstudio cannot describe OpenCV's rational lens.*colmap"):
        NerfstudioWriter(NoOptions()).write(dataset, tmp_path)


# Both


@pytest.mark.parametrize("format_name", WRITERS)
def test_images_are_the_dataset_s(bricks, format_name):
    for name in ("brick", "plate"):
        home = bricks / format_name.lower() / name / "images"
        images = sorted(home.iterdir())
        assert [path.name for path in images] == sorted(labels_by_name(bricks, name))
        for path in images:
            assert path.read_bytes() == (bricks / "images" / path.name).read_bytes()


@pytest.mark.parametrize("format_name", WRITERS)
def test_images_of_16_bits_become_images_of_8(dataset_folder, tmp_path, format_name):
    shutil.copytree(dataset_folder, tmp_path / "d")
    for path in (tmp_path / "d/images").iterdir():
        grey = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(np.uint16) * 257
        cv2.imwrite(str(path), np.stack([grey // 2, grey // 4, grey], axis=-1))  # blue, green, red
    WRITERS[format_name](NoOptions()).write(Dataset(tmp_path / "d"), tmp_path)
    path = tmp_path / format_name.lower() / "brick" / "images" / "000001.png"
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    original = cv2.imread(str(dataset_folder / "images/000001.png"), cv2.IMREAD_UNCHANGED)
    assert found.dtype == np.uint8
    assert np.array_equal(found[..., 2], original)
    assert np.abs(found[..., 1] * 4.0 - original).max() <= 4


@pytest.mark.parametrize("format_name", WRITERS)
def test_a_rolling_shutter_is_refused(dataset_folder, tmp_path, format_name):
    shutil.copytree(dataset_folder, tmp_path / "d")
    write_camera(replace(cuboid.CAMERA, line_time_s=1e-5), tmp_path / "d/camera.json")
    with pytest.raises(InputError, match=f"{format_name} supports a global shutter only"):
        WRITERS[format_name](NoOptions()).write(Dataset(tmp_path / "d"), tmp_path)


@pytest.mark.parametrize("format_name", WRITERS)
def test_a_dataset_without_masks_is_refused(dataset_folder, tmp_path, format_name):
    shutil.copytree(dataset_folder, tmp_path / "d")
    lines = cuboid.read_lines(dataset_folder)
    cuboid.write_lines(tmp_path / "d", [{k: v for k, v in x.items() if k != "mask_rle"} for x in lines])
    with pytest.raises(InputError, match=f"{format_name} needs; add 'mask'"):
        WRITERS[format_name](NoOptions()).write(Dataset(tmp_path / "d"), tmp_path)


@given(
    half_m=st.tuples(*[st.floats(0.1, 10)] * 3),
    count=st.integers(1, 300),
)
def test_surface_points_are_spread_by_area(half_m, count):
    """Each face of a box has its share of the points, to within one at each of its ends."""
    half = np.array(half_m)
    craft = cuboid.cuboid(half=half)
    first = np.arange(len(craft.parts)) * 4
    mesh = Mesh(
        vertices_body_m=np.concatenate([part.vertices_body_m for part in craft.parts]),
        faces=np.concatenate([part.faces + n for part, n in zip(craft.parts, first, strict=True)]),
        part_id=np.repeat(np.arange(len(craft.parts), dtype=np.int16), 2),
    )
    share = surface_points(mesh, count) / half
    assert np.abs(share).max(axis=1) == pytest.approx(1, abs=1e-12)
    areas = np.repeat(np.prod(half) / half, 2)
    axis = np.abs(share).argmax(axis=1)
    side = 2 * axis + (share[np.arange(count), axis] > 0)
    expected = count * areas / areas.sum()
    assert np.abs(np.bincount(side, minlength=6) - expected).max() <= 1
