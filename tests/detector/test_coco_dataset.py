"""COCO files as a dataset: they tell what the dataset that they were exported from tells."""

import json
import shutil

import cuboid
import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from posse_core._cli.eval import command
from posse_core._dataset.dataset import Dataset
from posse_core._detection.card import ModelCard
from posse_core._detection.evaluate import evaluate, frames_of
from posse_core._detection.groups import groups
from posse_core._errors import InputError
from posse_core._evaluation.metrics import true_boxes
from posse_core._formats.coco import CocoWriter
from posse_core._formats.opening import open_dataset
from posse_core._interfaces.detector import Detection, Detector
from posse_core._plugins.options import NoOptions

pytest.importorskip("faster_coco_eval")
PLATE = np.array([1.4, 1.4, 0.1])


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    crafts = (("brick", cuboid.HALF), ("plate", PLATE))
    return Dataset(cuboid.write_dataset(tmp_path_factory.mktemp("d") / "d", crafts))


@pytest.fixture
def folder(source, tmp_path):
    """The dataset as three COCO files of four frames each, with nothing else beside its images."""
    shutil.copytree(source.folder / "images", tmp_path / "images")
    CocoWriter(NoOptions()).write(source, tmp_path)
    whole = json.loads((tmp_path / "coco.json").read_text())
    for number, part in enumerate(("train", "valid", "test")):
        images = whole["images"][4 * number : 4 * number + 4]
        ids = {image["id"] for image in images}
        mine = [a for a in whole["annotations"] if a["image_id"] in ids]
        value = {**whole, "images": images, "annotations": mine}
        (tmp_path / f"{part}.json").write_text(json.dumps(value))
    return tmp_path


def test_it_tells_what_the_dataset_tells(source, folder):
    coco = open_dataset(folder)
    assert [coco.part(part) for part in ("train", "valid", "test")] == [
        [0, 1, 2, 3],
        [4, 5, 6, 7],
        [8, 9, 10, 11],
    ]
    assert list(coco.spacecraft_by_name) == ["brick", "plate"]
    assert frames_of(coco, "all") == list(range(12))
    for index in range(12):
        ours, theirs = coco[index], source[index]
        assert np.array_equal(coco.image(index), source.image(index))
        assert coco.size_px(index) == (120, 160)
        assert not ours.has("keypoints")  # nothing says where they are on the craft
        for a, b in zip(true_boxes(ours), true_boxes(theirs), strict=True):
            assert a.label == b.label
            assert np.array_equal(a.box_px, b.box_px)


def test_keypoints_come_with_the_craft_and_the_camera(source, folder):
    shutil.copytree(source.folder / "spacecraft", folder / "spacecraft")
    shutil.copy(source.folder / "camera.json", folder)
    coco = open_dataset(folder)
    assert coco.camera == source.camera
    ours, theirs = (
        ModelCard.of_dataset(d, net="", task="", input_px=0, version="") for d in (coco, source)
    )
    assert ours.keypoints_body_m == theirs.keypoints_body_m
    for index in range(12):
        if not true_boxes(source[index]):
            continue
        known = source[index].keypoints
        for name, (u, v, visibility) in coco[index].keypoints.items():
            assert visibility == known[name][2]
            assert (u, v) == (tuple(known[name][:2]) if visibility else (None, None))


class Boxes(Detector):
    """Tells every box of a list, image after image."""

    classes = ("brick", "plate")

    def __init__(self, truths):
        self.truths = iter(truths)

    def load(self, path):
        raise NotImplementedError

    def predict(self, images):
        return [[Detection(t.label, 0.9, t.box_px) for t in next(self.truths)] for _ in images]


@pytest.mark.parametrize("name", ["coco.json", "."])
def test_a_file_or_a_folder_is_measured(folder, name):
    coco = open_dataset(folder / name)
    detector = Boxes([true_boxes(line) for line in coco])
    whole, *others = groups(coco, evaluate(coco, frames_of(coco, "all"), detector))
    assert whole.frames == 12
    assert whole.metrics["mAP"] == pytest.approx(1)
    assert [(g.name, g.frames) for g in others] == [("brick", 5), ("plate", 5)]


def test_the_hash_follows_labels_and_images(folder):
    hashes = {open_dataset(folder).sha256}
    image = cv2.imread(str(folder / "images" / "000003.png"), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(folder / "images" / "000003.png"), 255 - image)
    hashes.add(open_dataset(folder).sha256)
    value = json.loads((folder / "valid.json").read_text())
    value["annotations"][0]["bbox"][0] += 1
    (folder / "valid.json").write_text(json.dumps(value))
    hashes.add(open_dataset(folder).sha256)
    assert len(hashes) == 3


def change(folder, make):
    value = json.loads((folder / "train.json").read_text())
    make(value)
    (folder / "train.json").write_text(json.dumps(value))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda v: v.clear(), "train.json: not valid COCO: images: missing; add it"),
        (lambda v: v["annotations"].append(v["annotations"][0]), "two annotations have the id"),
        (lambda v: v["annotations"][0].update(category_id=9), "not valid COCO"),
    ],
)
def test_what_is_not_coco_is_refused(folder, make, words):
    change(folder, make)
    with pytest.raises(InputError, match=words):
        open_dataset(folder)


def test_bad_input_is_told_in_one_line(folder):
    coco = open_dataset(folder / "coco.json")
    with pytest.raises(InputError, match="has no part 'test'; it has all"):
        coco.part("test")
    change(folder, lambda v: v["images"][1].update(width=320))
    with pytest.raises(InputError, match=r"000001.png: is 160 × 120 pixels, but .* 320 × 120"):
        open_dataset(folder).image(1)
    (folder / "valid.json").unlink()
    assert open_dataset(folder).part("valid") == []
    (folder / "images" / "000002.png").unlink()
    with pytest.raises(InputError, match=r"000002.png: cannot be read"):
        _ = open_dataset(folder).sha256
    for part in ("train", "test"):
        (folder / f"{part}.json").write_text('{"images": [], "annotations": [], "categories": []}')
    with pytest.raises(InputError, match="has no images"):
        open_dataset(folder)
    done = CliRunner().invoke(command, [str(folder), "--model", "none.onnx"])
    assert "has no images" in str(done.exception)
