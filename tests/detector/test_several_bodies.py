"""Images that show several craft: what is found of each is judged by itself."""

import json
from dataclasses import replace

import company
import numpy as np
import pytest

from posse_core import InputError, ModelCard
from posse_core._dataset.dataset import Dataset
from posse_core._detection.evaluate import evaluate, frames_of
from posse_core._detection.groups import groups
from posse_core._detection.page import make_page
from posse_core._detection.pnp import solve_pose
from posse_core._evaluation.metrics import box_iou, seen_bodies, true_box, true_boxes
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder

pytest.importorskip("faster_coco_eval")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return Dataset(company.write_dataset(tmp_path_factory.mktemp("company") / "d", frames=12))


class Labels(Detector):
    """Tells every body of the images, of the classes that it knows, in an order that varies."""

    def __init__(self, dataset, classes=("plate", "winged")):
        self.classes = classes
        self.lines = {dataset.image(i).tobytes(): dataset[i] for i in range(len(dataset))}

    def load(self, path):
        raise NotImplementedError

    def predict(self, images):
        found = []
        for image in images:
            line = self.lines.get(image.tobytes())
            if line is None:  # a part of an image, of which nothing is told
                found.append([])
                continue
            seen = [t for t in true_boxes(line) if t.label in self.classes]
            turned = seen[line.index % 3 :] + seen[: line.index % 3]
            found.append([Detection(t.label, 0.9 - 0.1 * i, t.box_px) for i, t in enumerate(turned)])
        return found


class Points(KeypointFinder):
    """Tells where the labels of the body in a box say that the keypoints are."""

    def __init__(self, dataset, classes=("plate", "winged")):
        self.classes = classes
        self.lines = Labels(dataset).lines
        card = ModelCard.of_dataset(dataset, net="", task="keypoints", input_px=8, version="")
        self.keypoints_body_m = card.keypoint_arrays_m

    def load(self, path):
        raise NotImplementedError

    def find(self, image, detections):
        line, found = self.lines[image.tobytes()], []
        for detection in detections:
            body = max(
                (b for b in seen_bodies(line).values() if b.spacecraft == detection.label),
                key=lambda b: float(box_iou(true_box(b).box_px, detection.box_px)),
            )
            points = np.array([p[:2] for p in body.keypoints.values()])
            sigma = np.ones(len(points))
            found.append(replace(detection, keypoints_px=points, keypoints_sigma_px=sigma))
        return found


def test_each_body_that_is_seen_counts_once(dataset):
    seen = sum(len(seen_bodies(line)) for line in dataset)
    shown = {(image.body == k).any() for image in company.images(12) for k in range(3)}
    assert shown == {True, False}
    assert seen == sum((image.body == k).any() for image in company.images(12) for k in range(3))
    judged = evaluate(dataset, frames_of(dataset, "all"), Labels(dataset), Points(dataset))
    assert sum(len(j.bodies) for j in judged) == seen
    whole, *others = groups(dataset, judged)
    for name in ("mAP", "mAR", "AP.plate", "AP.winged", "box IoU mean", "poses estimated"):
        assert whole.metrics[name] == pytest.approx(1), name
    assert whole.metrics["e_t median"] < 1e-6
    assert whole.metrics["e_q median, deg"] < 1e-4
    assert [(g.name, g.frames) for g in others[:2]] == [("plate", 12), ("winged", 12)]
    assert "AP.plate" not in others[1].metrics
    text = make_page("title", "summary", dataset, judged, [whole, *others])
    by_range = text.partition("By range")[2]
    assert by_range.count("<circle") == 4 * seen  # overlap, place, attitude and ADD of every body


def test_points_that_a_joint_carries_give_no_pose(dataset):
    """The wing is elsewhere than with its joint at zero; by all points the pose would be wrong."""
    card = ModelCard.of_dataset(dataset, net="", task="keypoints", input_px=8, version="")
    points = card.keypoint_arrays_m["winged"]
    assert np.isnan(points).all(axis=1).sum() == 8
    line = dataset[0]
    uv = np.array([p[:2] for p in line.keypoints.values()])
    pose = solve_pose(points, uv, np.ones(16), dataset.camera)
    assert pose is not None
    np.testing.assert_allclose(pose.t_body_cam_m, line.t_body_cam_m, atol=1e-4)
    assert pose.inliers.tolist() == [True] * 8 + [False] * 8


def test_points_in_which_bodies_of_one_name_differ_give_no_pose(tmp_path):
    """Fragments share a class and its keypoints' names, but not their shapes."""
    folder = company.write_dataset(tmp_path / "d", frames=2)
    path = folder / "bodies/twin/winged.json"
    info = json.loads(path.read_text())
    info["keypoints"]["B1"][0] += 0.1
    path.write_text(json.dumps(info))
    card = ModelCard.of_dataset(Dataset(folder), net="", task="keypoints", input_px=8, version="")
    wing = [name for name in info["keypoints"] if name.startswith("wing")]
    assert card.loose_keypoints == {"winged": ["B1", *wing]}
    assert ModelCard.from_metadata(card.metadata(), path) == card
    info["keypoints"]["another"] = info["keypoints"].pop("B1")
    path.write_text(json.dumps(info))
    with pytest.raises(InputError, match="body 'twin' is named 'winged' like another"):
        ModelCard.of_dataset(Dataset(folder), net="", task="keypoints", input_px=8, version="")


def test_a_net_of_the_target_is_not_judged_by_bodies_that_it_does_not_know(dataset):
    only = ("winged",)
    judged = evaluate(dataset, frames_of(dataset, "all"), Labels(dataset, only), Points(dataset, only))
    assert {body.truth.label for j in judged for body in j.bodies} == {"winged"}
    found = groups(dataset, judged)
    assert "plate" not in {group.name for group in found}
    metrics = found[0].metrics
    assert metrics["mAP"] == pytest.approx(1)
    assert "AP.plate" not in metrics
    assert metrics["poses estimated"] == 1


def test_a_finder_of_one_class_is_judged_by_that_class_alone(dataset):
    """A detector that knows both, and keypoints of the target's class alone."""
    judged = evaluate(dataset, frames_of(dataset, "all"), Labels(dataset), Points(dataset, ("winged",)))
    plates = [body for j in judged for body in j.bodies if body.truth.label == "plate"]
    assert plates
    assert not any(body.is_posed for body in plates)
    assert groups(dataset, judged)[0].metrics["poses estimated"] == 1


def test_one_that_is_missed_or_taken_for_another_costs_its_part(dataset):
    """Without the twin's boxes, recall falls by its share of the class."""

    class Blind(Labels):
        def predict(self, images):
            (found,) = super().predict(images)
            line = self.lines[images[0].tobytes()]
            twin = line.bodies["twin"].box_visible_px
            return [[d for d in found if twin is None or (d.box_px != twin).any()]]

    judged = evaluate(dataset, frames_of(dataset, "all"), Blind(dataset))
    metrics = groups(dataset, judged)[0].metrics
    bodies = [body for j in judged for body in j.bodies]
    twins = sum(line.bodies["twin"].box_visible_px is not None for line in dataset)
    winged = sum(body.truth.label == "winged" for body in bodies)
    assert metrics["AP.plate"] == pytest.approx(1)
    assert metrics["mAR"] == pytest.approx((1 + (winged - twins) / winged) / 2)
    lost = [body for body in bodies if body.overlap == 0]
    assert len(lost) == twins
