"""The folder, read: lines by place, mesh and camera as another program reads them, bad folders."""

import json
import shutil
import tracemalloc
from pathlib import Path

import cuboid
import cv2
import numpy as np
import pytest
import trimesh

from posse_core._dataset.camera import read_camera, write_camera
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.lines import LabelLines
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady, Fisheye


def test_frames_are_ordered_by_index_over_shards(dataset_folder, tmp_path):
    lines = cuboid.read_lines(dataset_folder)
    shutil.copytree(dataset_folder, tmp_path / "d")
    (tmp_path / "d/labels/shard-00000.jsonl").write_text(
        "".join(json.dumps(lines[i]) + "\n" for i in (4, 1, 0))
    )
    (tmp_path / "d/labels/shard-00001.jsonl").write_text(
        "".join(json.dumps(lines[i]) + "\n" for i in (5, 3, 2))
    )
    dataset = Dataset(tmp_path / "d")
    assert [json.loads(line.to_json()) for line in dataset] == lines
    assert [line.index for line in dataset[-2:]] == [4, 5]
    assert [dataset[i].index for i in (3, -1, -6)] == [3, 5, 0]
    for i in (6, -7):
        with pytest.raises(IndexError, match=f"none at position {i}"):
            dataset[i]
    with pytest.raises(InputError, match="has no frame 6"):
        dataset.position(6)


def test_a_torn_last_line_is_no_frame(dataset_folder, tmp_path):
    shard = tmp_path / "shard-00000.jsonl"
    text = (dataset_folder / "labels/shard-00000.jsonl").read_bytes()
    whole = text.rfind(b"\n", 0, -1) + 1
    for end in (whole + 1, whole + 40, len(text) - 1):
        shard.write_bytes(text[:end])
        frames = LabelLines(tmp_path)
        assert frames.indices.tolist() == [0, 1, 2, 3, 4]
        assert frames.damaged == []
    shard.write_bytes(text)
    assert len(LabelLines(tmp_path)) == 6


def test_a_damaged_line_within_is_an_error_with_its_place(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    shard = tmp_path / "d/labels/shard-00000.jsonl"
    rows = shard.read_text().splitlines(keepends=True)
    rows[2] = rows[2][:30] + "\n"
    shard.write_text("".join(rows))
    with pytest.raises(InputError, match=r"shard-00000.jsonl, line 3: not a label"):
        len(Dataset(tmp_path / "d"))


def test_memory_is_not_that_of_the_labels(tmp_path):
    padding = "x" * 20_000
    with open(tmp_path / "shard-00000.jsonl", "w") as stream:
        for i in range(1000):
            stream.write(json.dumps({"index": i, "mask": padding}) + "\n")
    tracemalloc.start()
    frames = LabelLines(tmp_path)
    assert sum(json.loads(line)["index"] for line in frames) == 999 * 1000 / 2
    assert tracemalloc.get_traced_memory()[1] < 2_000_000  # the file has 20 MB
    tracemalloc.stop()


def test_mesh_is_read_by_trimesh_with_the_same_numbers(dataset_folder):
    ours = Dataset(dataset_folder).mesh()
    theirs = trimesh.load(dataset_folder / "spacecraft/brick.ply", process=False)
    assert np.array_equal(theirs.vertices, ours.vertices_body_m)
    assert np.array_equal(theirs.faces, ours.faces)
    assert theirs.volume == pytest.approx(8 * np.prod(cuboid.HALF))
    normals = trimesh.Trimesh(ours.vertices_body_m, ours.faces, process=False).face_normals
    axis = np.argmax(np.abs(normals), axis=1)
    assert np.array_equal(ours.part_id, 2 * axis + (normals[np.arange(12), axis] > 0))


def test_spacecraft_is_read_as_it_was(dataset_folder):
    craft, info = cuboid.cuboid(), Dataset(dataset_folder).spacecraft
    assert info.parts == cuboid.SIDES
    assert list(info.keypoints_body_m) == list(cuboid.NAMES)
    assert all(np.array_equal(info.keypoints_body_m[k], craft.keypoints_body_m[k]) for k in cuboid.NAMES)
    assert info.skeleton == craft.skeleton
    assert np.array_equal(info.symmetries[0], craft.symmetries[0])


@pytest.mark.parametrize(
    "lens",
    [
        None,
        BrownConrady(-0.2, 0.05, 0.001, -0.002, 0.003),
        BrownConrady(-0.2, 0.05, 0.001, -0.002, 0.003, 0.1, 0.02, 0.003),
        Fisheye(),
        Fisheye(-0.02, 0.01, -0.003, 0.0005),
    ],
)
def test_camera_file_agrees_with_itself(tmp_path, lens):
    camera = Camera(1280, 960, 640.0, 655.5, 639.5, 470.25, 0.036, distortion=lens)
    write_camera(camera, tmp_path / "camera.json")
    value = json.loads((tmp_path / "camera.json").read_text())
    assert (value["Nu"], value["Nv"]) == (1280, 960)
    assert value["fx"] / value["ppx"] == pytest.approx(640.0)
    assert value["fy"] / value["ppy"] == pytest.approx(655.5)
    assert value["ppx"] * 1280 == pytest.approx(0.036)
    # A point by OpenCV, from the file alone.
    K, d = np.array(value["cameraMatrix"]), np.array(value["distCoeffs"])
    project = cv2.fisheye.projectPoints if value["distModel"] == "fisheye" else cv2.projectPoints
    uv, _ = project(np.array([[[1.0, -2.0, 7.0]]]), np.zeros(3), np.zeros(3), K, d)
    assert uv.reshape(2) == pytest.approx(camera.project(np.array([1.0, -2.0, 7.0])))
    assert read_camera(tmp_path / "camera.json") == camera


def test_a_camera_file_of_another_lens_model_or_one_that_folds_over_is_refused(tmp_path):
    write_camera(Camera(64, 48, 60.0, 60.0, 31.5, 23.5, 0.01), tmp_path / "camera.json")
    value = json.loads((tmp_path / "camera.json").read_text())
    for keys, words in (
        ({"distCoeffs": [0.1, 0, 0, 0, 0, 0, 0, 0, 0.2, 0, 0, 0]}, "more than the eight"),
        ({"distCoeffs": [0.1, 0, 0]}, "has 4, 5 or 8 coefficients, not 3"),
        ({"distCoeffs": [-0.6, 0, 0, 0, 0]}, "folds over"),
        ({"distModel": "fisheye"}, "distCoeffs: a fisheye has 4 coefficients, not 5"),
        ({"distModel": "omni"}, "distModel: .*'brown-conrady' or 'fisheye'"),
    ):
        (tmp_path / "camera.json").write_text(json.dumps({**value, **keys}))
        with pytest.raises(InputError, match=words):
            read_camera(tmp_path / "camera.json")


def test_images_are_red_green_blue_and_keep_their_depth(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    red = np.zeros((120, 160, 3), dtype=np.uint16)
    red[..., 2] = 50_000  # OpenCV writes blue, green, red
    cv2.imwrite(str(tmp_path / "d/images/000001.png"), red)
    dataset = Dataset(tmp_path / "d")
    image = dataset.image(1)
    assert image.dtype == np.uint16
    assert image[5, 5].tolist() == [50_000, 0, 0]
    assert dataset.image(0).shape == (120, 160)
    (tmp_path / "d/images/000002.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=r"000002.png: not an image"):
        dataset.image(2)


def test_truth_is_full_size_and_never_unpickled(dataset_folder, tmp_path):
    assert set(Dataset(dataset_folder).truth(0)) == {"part_id", "depth_m", "normal_cam"}
    shutil.copytree(dataset_folder, tmp_path / "d")
    np.savez(tmp_path / "d/truth/000000.npz", part_id=np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match="cannot be read"):
        Dataset(tmp_path / "d").truth(0)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda d: shutil.rmtree(d), "there is no such folder"),
        (lambda d: shutil.rmtree(d / "labels"), "not a dataset"),
        (lambda d: (d / "camera.json").unlink(), "camera.json"),
        (lambda d: (d / "camera.json").write_text('{"Nu": 3}'), "not a camera file"),
        (lambda d: (d / "camera.json").write_text("[]"), "not a camera file"),
        (lambda d: (d / "spacecraft/brick.json").unlink(), "no NAME.json"),
        (lambda d: (d / "spacecraft/brick.json").write_text("{}"), "not a spacecraft file"),
    ],
)
def test_what_is_no_dataset_is_told_in_one_line(dataset_folder, tmp_path, spoil, words):
    shutil.copytree(dataset_folder, tmp_path / "d")
    spoil(tmp_path / "d")
    with pytest.raises(InputError, match=words) as caught:
        Dataset(tmp_path / "d")
    assert "\n" not in str(caught.value)


def test_a_folder_of_datasets_names_them(dataset_folder, tmp_path):
    for name in ("posse-v1", "posse-v2"):
        shutil.copytree(dataset_folder, tmp_path / "v3" / name)
    with pytest.raises(InputError, match=r"one of those in it \(posse-v1, posse-v2\).*posse collect"):
        Dataset(tmp_path / "v3")


def test_a_mesh_that_is_cut_or_foreign_is_refused(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    path = tmp_path / "d/spacecraft/brick.ply"
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(InputError, match="incomplete"):
        Dataset(tmp_path / "d").mesh()
    trimesh.creation.box().export(path)
    with pytest.raises(InputError, match="not a mesh file of POSSE"):
        Dataset(tmp_path / "d").mesh()
    path.unlink()
    with pytest.raises(InputError, match="missing"):
        Dataset(tmp_path / "d").mesh()


def test_a_run_that_has_not_ended_says_so(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    (tmp_path / "d/manifest.json").unlink()
    dataset = Dataset(Path(tmp_path / "d"))
    assert len(dataset) == 6
    with pytest.raises(InputError, match="--resume"):
        _ = dataset.manifest
