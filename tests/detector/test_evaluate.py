"""A detector that reads the labels scores full marks, and one that errs by a known amount loses them."""

import base64
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cuboid
import cv2
import numpy as np
import pytest
from command import run_posse
from telling import Labels, Points

from posse_core._dataset.dataset import Dataset
from posse_core._detection.card import KEY, ModelCard
from posse_core._detection.evaluate import evaluate, frames_of
from posse_core._detection.glossary import METRICS
from posse_core._detection.groups import columns, groups, trusts
from posse_core._detection.models import open_detector
from posse_core._detection.page import make_page
from posse_core._errors import InputError
from posse_core._interfaces.detector import Detection
from posse_core._plugins.loading import load_plugins

pytest.importorskip("faster_coco_eval")
PLATE = np.array([1.4, 1.4, 0.1])


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    crafts = (("brick", cuboid.HALF), ("plate", PLATE))
    return Dataset(cuboid.write_dataset(tmp_path_factory.mktemp("d") / "d", crafts))


def measured(dataset, detector, finder=None):
    judged = evaluate(dataset, frames_of(dataset, "all"), detector, finder)
    return groups(dataset, judged)


def test_the_labels_score_full_marks(dataset):
    found = measured(dataset, Labels(dataset), Points(dataset))
    whole = found[0]
    assert (whole.name, whole.frames) == ("all", 12)
    assert [g.name for g in found[1:3]] == ["brick", "plate"]
    assert sum(g.frames for g in found if g.name.endswith(" m")) == 12
    assert sum(g.frames for g in found if g.name.startswith("phase")) == 12
    for name in ("mAP", "mAP50", "mAR", "AP.brick", "AP.plate", "box IoU mean", "poses estimated"):
        assert whole.metrics[name] == pytest.approx(1), name
    for name in ("ADD < 0.1 d", "ADI < 0.1 d"):
        assert whole.metrics[name] == 1, name
    assert whole.metrics["e_t median"] < 1e-6
    assert whole.metrics["e_q median, deg"] < 1e-4
    assert whole.metrics["SPEED 2023"] == pytest.approx(0, abs=1e-5)
    assert whole.metrics["ADD median, d"] < 1e-5
    assert whole.metrics["ADI median, d"] < 1e-5


def test_poses_that_are_wrong_in_a_fifth_of_the_frames_show_beyond_the_median(dataset):
    """The median knows nothing of them, the 90th percentile does."""
    labels = Labels(dataset)

    class Sometimes(Points):
        def find(self, image, detections):
            found = super().find(image, detections)
            if labels.line(image).index % 5:
                return found
            return [replace(d, keypoints_px=d.keypoints_px * 1.1) for d in found]

    whole = measured(dataset, labels, Sometimes(dataset))[0].metrics
    assert whole["e_t median"] < 1e-6
    assert whole["e_t 90th percentile"] > 0.01
    assert whole["e_q median, deg"] < 1e-4
    assert whole["e_q 90th percentile, deg"] > 0.1


def test_a_turn_about_a_symmetry_counts_for_add_alone(dataset):
    """The cuboids look alike when turned by half a turn about x; each corner goes to the one across."""

    class Turned(Points):
        def find(self, image, detections):
            half = {"brick": cuboid.HALF, "plate": PLATE}[detections[0].label]
            order = [7 - i ^ 1 for i in range(8)]  # corner (x, y, z) to (x, −y, −z)
            swapped = cuboid.corners(half)[order]
            assert (swapped == cuboid.corners(half) * [1, -1, -1]).all()
            (told,) = super().find(image, detections)
            return [replace(told, keypoints_px=told.keypoints_px[order])]

    for name, half in (("brick", cuboid.HALF), ("plate", PLATE)):
        indices = [i for i in range(12) if dataset[i].spacecraft == name]
        judged = evaluate(dataset, indices, Labels(dataset), Turned(dataset))
        poses = [body.pose for j in judged for body in j.bodies if body.pose is not None]
        assert len(poses) == 5
        across = np.linalg.norm(half[1:]) / np.linalg.norm(half)
        for pose in poses:
            assert pose.add == pytest.approx(across, rel=1e-4)
            assert pose.adi < 1e-4
            assert pose.e_q_rad < 1e-4  # the craft's symmetry is one of its package
        metrics = groups(dataset, judged)[0].metrics
        assert (metrics["ADD < 0.1 d"], metrics["ADI < 0.1 d"]) == (0, 1)


def test_boxes_too_far_off_score_nothing(dataset):
    metrics = measured(dataset, Labels(dataset, shift_px=500))[0].metrics
    assert metrics["mAP"] == 0
    assert metrics["box IoU median"] == 0
    assert "poses estimated" not in metrics


def test_an_estimated_pose_may_be_wrong_and_its_name_says_no_more(dataset):
    """Boxes beside the spacecraft still give a pose: nothing is found well, but a pose is estimated."""
    metrics = measured(dataset, Labels(dataset, shift_px=60), Points(dataset))[0].metrics
    assert metrics["mAP"] == 0
    assert metrics["poses estimated"] == 1
    assert "however wrong" in METRICS["poses estimated"]


def test_every_column_is_explained_in_help_page_and_documentation(dataset):
    found = measured(dataset, Labels(dataset), Points(dataset))
    of_boxes, of_poses = columns(found)
    shown = [re.sub(r"^AP\..*", "AP.NAME", name) for name in (*of_boxes, *of_poses)]
    refinement = {"e_t before", "e_q before, deg", "refined", "worsened"}  # with --refine alone
    mixed = {"trust AUC"}  # where there are right and wrong poses
    assert set(shown) | refinement | mixed == set(METRICS)
    code, said, _ = run_posse("eval", "--help")
    assert code == 0
    text = " ".join(said.split())
    documented = (Path(__file__).parents[2] / "docs/detector.md").read_text()
    documented = documented.partition("## Metrics")[2].partition("## ONNX")[0]
    for name in METRICS:
        assert f"{name}: " in text
        for word in name.split(", ")[0].split():  # a row of the documentation may define several
            assert word in documented, name


def test_all_frames_of_a_divided_dataset_include_those_of_training(dataset, tmp_path):
    folder = Path(shutil.copytree(dataset.folder, tmp_path / "d"))
    arguments = ("eval", folder, "--model", "no.onnx", "--part", "all")
    assert "train part" not in run_posse(*arguments)[2]
    assert run_posse("partition", folder)[0] == 0
    trained = len(Dataset(folder).part("train"))
    assert f"--part all includes the {trained} frames of the train part" in run_posse(*arguments)[2]


@pytest.mark.parametrize(
    ("files", "way_out"),
    [
        ((), "without a model file in it"),
        (("last.safetensors", "model.safetensors"), "such as {folder}/model.safetensors"),
        (("nano.onnx", "curves.html"), "such as {folder}/nano.onnx"),
    ],
)
def test_a_folder_is_no_model_and_the_file_in_it_is_named(files, way_out, dataset, tmp_path):
    for name in files:
        (tmp_path / name).touch()
    code, _, error = run_posse("eval", dataset.folder, "--model", tmp_path, "--part", "all")
    assert code == 2
    assert f"{tmp_path}: is a folder" in error
    assert way_out.format(folder=tmp_path) in error
    code, _, again = run_posse("export-onnx", tmp_path, "--dataset", dataset.folder, "--out", "x.onnx")
    assert (code, again) == (2, error)


def test_the_page_shows_what_was_measured(dataset):
    """It needs nothing from elsewhere, is well formed, and has the numbers of the table."""

    class Late(Points):
        def find(self, image, detections):
            (told,) = super().find(image, detections)
            random = np.random.default_rng(int(told.box_px.sum()))
            return [replace(told, keypoints_px=told.keypoints_px + random.normal(0, 1, (8, 2)))]

    judged = evaluate(dataset, frames_of(dataset, "all"), Labels(dataset, shift_px=3), Late(dataset))
    found = groups(dataset, judged)
    text = make_page("a <model> on d", "summary", dataset, judged, found)
    assert "a &lt;model&gt; on d" in text
    assert not re.search(r'(?:src|href)="(?!data:)', text)
    for name in ("mAP", "ADD median, d"):
        assert f'<td class="number">{found[0].metrics[name]:.4g}</td>' in text
    assert "<td>mAP of the spacecraft brick</td>" in text
    plots = [ElementTree.fromstring(svg) for svg in re.findall(r"<svg.*?</svg>", text, re.S)]
    # a curve for each class; trust and its curve; overlap, place, attitude, ADD by range
    assert [len(plot.findall("polyline")) for plot in plots] == [10, 10, 1, 1, 0, 0, 0, 0]
    told = [min(int(10 * trust), 9) for trust, _ in trusts(judged)]
    circles = [len(plot.findall(".//circle")) for plot in plots]
    assert circles == [0, 0, len(set(told)), 0, 10, 10, 10, 10]
    worst = re.findall(r"frame (\d+), IoU ([\d.]+)</figcaption>", text)
    assert [float(iou) for _, iou in worst] == sorted(float(iou) for _, iou in worst)
    overlaps = {str(j.labels.index): j.bodies[0].overlap for j in judged if j.bodies}
    assert {index: f"{overlaps[index]:.2f}" for index, _ in worst} == dict(worst)
    for data in re.findall(r'src="data:image/jpeg;base64,([^"]+)"', text):
        picture = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
        assert picture.shape == (240, 320, 3)


def test_trust_is_judged_by_right_and_wrong_poses(dataset):
    """Keypoints are off by as much as they say, a little or a lot, and every image has a false box."""

    class Twice(Labels):
        def predict(self, images):
            false = Detection("brick", 0.5, np.array([1.0, 1.0, 40.0, 40.0]))
            return [[*told, false] for told in super().predict(images)]

    class Off(Points):
        def find(self, image, detections):
            line = self.labels.line(image)
            if detections[0].score == 0.5:
                random = np.random.default_rng(line.index)
                anywhere, wide = random.uniform(0, 40, (8, 2)), np.full(8, 30.0)
                return [replace(d, keypoints_px=anywhere, keypoints_sigma_px=wide) for d in detections]
            (told,) = super().find(image, detections)
            random, sigma = np.random.default_rng(line.index), [0.5, 8.0][line.index % 2]
            off = told.keypoints_px + random.normal(0, sigma, (8, 2))
            return [replace(told, keypoints_px=off, keypoints_sigma_px=np.full(8, sigma))]

    judged = evaluate(dataset, frames_of(dataset, "all"), Twice(dataset), Off(dataset))
    assert any(j.false_poses for j in judged)
    metrics = groups(dataset, judged)[0].metrics
    told = trusts(judged)
    right, wrong = ([trust for trust, is_right in told if is_right is kept] for kept in (True, False))
    assert len(wrong) > sum(len(j.false_poses) for j in judged) > 0 < len(right)
    wins = [(r > w) + (r == w) / 2 for r in right for w in wrong]
    assert metrics["trust AUC"] == pytest.approx(np.mean(wins))
    assert metrics["trust AUC"] > 0.9
    assert metrics["right"] == pytest.approx(len(right) / len(told))
    assert metrics["right if trusted"] > 0.9 > 0.7 > metrics["right"]


def test_what_cannot_be_measured_is_refused(dataset):
    class Other(Labels):
        classes = ("brick",)

    with pytest.raises(InputError, match="does not know plate"):
        evaluate(dataset, [0], Other(dataset))
    with pytest.raises(InputError, match="posse partition"):
        frames_of(dataset, "test")


def test_a_card_travels_whole(dataset, tmp_path):
    card = replace(
        ModelCard.of_dataset(dataset, net="x", task="boxes", input_px=64, version="1"), epochs=3
    )
    assert ModelCard.from_metadata(card.metadata(), Path("m")) == card
    assert list(card.keypoints_body_m["brick"]) == list(cuboid.NAMES)
    with pytest.raises(InputError, match="m: has no POSSE metadata"):
        ModelCard.from_metadata({}, Path("m"))
    for text in ("{}", "[]", "nonsense", '{"format": 99}', '{"format": 1, "classes": 3}'):
        with pytest.raises(InputError, match="cannot be read"):
            ModelCard.from_metadata({KEY: text}, Path("m"))
    for number, data in enumerate((b"", b"12345678", b"\xff" * 16, b"\x02" + bytes(7) + b"{}")):
        path = tmp_path / f"{number}.safetensors"
        path.write_bytes(data)
        with pytest.raises(InputError, match=f"{number}.safetensors"):
            ModelCard.read(path)


@pytest.mark.parametrize(
    ("change", "told"),
    [({"task": "poses"}, "task: "), ({"net": "nothing"}, "no detector named 'nothing'")],
)
def test_a_model_that_nothing_reads_is_told_by_its_file(dataset, tmp_path, change, told):
    card = replace(
        ModelCard.of_dataset(dataset, net="x", task="boxes", input_px=64, version="1"), **change
    )
    header = json.dumps({"__metadata__": card.metadata()}).encode()
    path = tmp_path / "m.safetensors"
    path.write_bytes(len(header).to_bytes(8, "little") + header)
    with pytest.raises(InputError, match=rf"m\.safetensors: .*{told}"):
        open_detector(path, load_plugins().registry, {})


def test_the_hash_follows_the_data_and_its_division(dataset, tmp_path):
    from posse_core._selection.partition import write_partition

    other = Dataset(cuboid.write_dataset(tmp_path / "d", (("brick", cuboid.HALF * 1.01),)))
    hashes = [dataset.sha256, other.sha256]
    for seed in (0, 1):
        write_partition(other, (50, 25, 25), seed, "frame")
        hashes.append(other.sha256)
    assert len(set(hashes)) == 4
