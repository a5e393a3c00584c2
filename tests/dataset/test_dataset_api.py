"""The public Dataset against the files themselves, and a COCO folder by the same methods."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import cuboid
import cv2
import numpy as np
import pytest

import posse_core as posse
from posse_core._formats.coco import CocoWriter
from posse_core._plugins.options import NoOptions


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Six frames, of which that with index 1 is missing: position and index differ."""
    folder = cuboid.write_dataset(tmp_path_factory.mktemp("d") / "d")
    lines = cuboid.read_lines(folder)
    lines[0]["nearest"] = {"nearest_m": 7.25}
    del lines[1]
    cuboid.write_lines(folder, lines, frames=6)
    return folder


@pytest.fixture(scope="module")
def dataset(folder) -> posse.Dataset:
    return posse.Dataset(str(folder))


def test_it_is_a_sequence_of_label_lines(dataset, folder):
    lines = cuboid.read_lines(folder)
    assert len(dataset) == len(lines) == 5
    assert [json.loads(line.to_json()) for line in dataset] == lines
    assert [dataset[i].index for i in range(-5, 5)] == [0, 2, 3, 4, 5] * 2
    assert [line.index for line in dataset[1:4]] == [2, 3, 4]
    assert dataset.indices.tolist() == [0, 2, 3, 4, 5]
    assert [dataset.position(index) for index in (0, 2, 5)] == [0, 1, 4]
    for i in (5, -6):
        with pytest.raises(IndexError, match=f"none at position {i}"):
            dataset[i]
    with pytest.raises(posse.InputError, match="has no frame 1"):
        dataset.position(1)


def test_images_and_arrays_are_those_of_the_position(dataset, folder):
    for i, line in enumerate(cuboid.read_lines(folder)):
        image = cv2.imread(str(folder / line["image"]), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(dataset.image(i), image)
        with np.load(folder / line["truth"]) as arrays:
            assert np.array_equal(dataset.depth(i), arrays["depth_m"], equal_nan=True)
            assert np.array_equal(dataset.mask(i), arrays["part_id"] >= 0)
            assert dataset.truth(i).keys() == set(arrays)
        assert dataset.trajectory.t_s[dataset[i].index] == line["t_s"]
    assert np.array_equal(dataset.image(-1), dataset.image(4))


def test_its_repr_says_what_it_is(dataset, folder, tmp_path):
    size = f"{cuboid.CAMERA.width_px} × {cuboid.CAMERA.height_px}"
    assert repr(dataset) == f"Dataset({str(folder)!r}: 5 frames of brick, {size}, complete)"
    shutil.copytree(folder, tmp_path / "d")
    (tmp_path / "d/manifest.json").unlink()
    assert "no manifest yet" in repr(posse.Dataset(tmp_path / "d"))


def test_a_table_has_a_row_a_frame(dataset, folder):
    table = dataset.dataframe()
    assert len(table) == 5
    for i, line in enumerate(cuboid.read_lines(folder)):
        row = table.iloc[i]
        assert row["index"] == line["index"]
        assert [row[f"t_body_cam_{axis}_m"] for axis in "xyz"] == line["t_body_cam_m"]
        assert [row[f"q_cam_from_body_{axis}"] for axis in "wxyz"] == line["q_cam_from_body"]
        u_px, v_px, visibility = line["keypoints"]["T1"]
        assert row["keypoint_T1_visibility"] == visibility
        assert (row["keypoint_T1_u_px"], row["keypoint_T1_v_px"]) == (u_px, v_px)
        assert row["part_z+_area_px"] == line["part_area_px"]["z+"]
        box = [row[f"box_visible_{side}_px"] for side in ("x", "y", "width", "height")]
        assert np.isnan(box).all() if line["box_visible_px"] is None else box == line["box_visible_px"]
    assert table["nearest.nearest_m"].tolist()[0] == 7.25
    assert table["nearest.nearest_m"].isna().tolist() == [False, True, True, True, True]
    assert "mask_rle" not in table


def test_a_table_without_pandas_says_what_to_install(dataset, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(posse.ComponentError, match="pip install pandas"):
        dataset.dataframe()


def test_a_file_that_a_line_names_is_in_the_folder(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "d")
    lines = cuboid.read_lines(folder)
    shutil.copy(folder / lines[0]["image"], tmp_path / "secret.png")
    lines[0]["image"], lines[1]["truth"] = "../secret.png", str(tmp_path / "secret.npz")
    cuboid.write_lines(tmp_path / "d", lines)
    dataset = posse.Dataset(tmp_path / "d")
    with pytest.raises(posse.InputError, match="is outside the folder"):
        dataset.image(0)
    with pytest.raises(posse.InputError, match="is outside the folder"):
        dataset.truth(1)


@pytest.mark.parametrize(
    ("depth_m", "told"),
    [
        (lambda sound: sound.astype("U32"), "is <U32 of shape"),
        (lambda sound: sound[..., None], "must be numbers of shape"),
        (lambda sound: sound[:, :5], "must be numbers of shape"),
    ],
)
def test_arrays_of_something_else_are_told_by_their_names(folder, tmp_path, depth_m, told):
    shutil.copytree(folder, tmp_path / "d")
    dataset = posse.Dataset(tmp_path / "d")
    path = dataset.folder / dataset[1].truth
    arrays = dataset.truth(1)
    np.savez(path, **{**arrays, "depth_m": depth_m(arrays["depth_m"])})
    with pytest.raises(posse.InputError, match=rf"{path.name}: depth_m: .*{told}"):
        dataset.depth(1)


def test_a_fault_within_a_line_is_named(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "d")
    shard = tmp_path / "d/labels/shard-00000.jsonl"
    shard.write_text(shard.read_text().replace('"sequence": 0', '"sequence": ', 1))
    with pytest.raises(posse.InputError, match=r"frame 0: .*JSON|frame 0: .*json"):
        posse.Dataset(tmp_path / "d")[0]


def test_a_manifest_is_a_record(dataset, folder):
    assert dataset.manifest.state == "complete"
    assert dataset.manifest.frames == 6
    assert dataset.manifest.as_json() == json.loads((folder / "manifest.json").read_text())


def test_a_coco_folder_keeps_the_same_methods(dataset, folder, tmp_path):
    CocoWriter(NoOptions()).write(dataset, tmp_path)
    for name in ("images", "spacecraft"):
        shutil.copytree(folder / name, tmp_path / name)
    shutil.copy(folder / "camera.json", tmp_path)
    coco = posse.open_dataset(tmp_path / "coco.json")
    assert isinstance(coco, posse.LabelledImages)
    assert isinstance(dataset, posse.LabelledImages)
    assert repr(coco) == f"CocoDataset({str(tmp_path)!r}: 5 images of brick)"
    assert np.array_equal(coco.mesh().vertices_body_m, dataset.mesh().vertices_body_m)
    assert coco.camera == dataset.camera
    with pytest.raises(posse.InputError, match="has no spacecraft 'plate'; it has brick"):
        coco.mesh("plate")
    for i, (ours, theirs) in enumerate(zip(coco, dataset, strict=True)):
        assert coco.position(ours.index) == i
        assert coco.size_px(i) == dataset.size_px(i)
        assert np.array_equal(coco.image(i), dataset.image(i))
        assert ours.box_visible_px == theirs.box_visible_px
        if ours.has("mask_rle"):
            assert np.array_equal(coco.mask(i), dataset.mask(i))
        with pytest.raises(posse.InputError, match=f"frame {i} has no 't_s'"):
            _ = ours.t_s
    (tmp_path / "spacecraft/brick.ply").unlink()
    with pytest.raises(posse.InputError, match=r"brick.ply: missing"):
        posse.open_dataset(tmp_path / "coco.json").mesh()
