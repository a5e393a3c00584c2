"""Metrics against COCO's own code, closed forms and vectors worked out by hand."""

import contextlib
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from scipy.spatial.transform import Rotation

from posse_core.evaluation.metrics import (
    Truth,
    box_iou,
    coco_metrics,
    overlap_metrics,
    pose_errors,
    proposal_recall,
    quaternion_pose_errors,
    speed_score,
)
from posse_core.interfaces.detector import Detection

pytest.importorskip("faster_coco_eval")
CLASSES = ("aqua", "cluster")


def random_case(seed: int, images: int = 12):
    """Truths, and detections near them, elsewhere, of the wrong class, or none."""
    random = np.random.default_rng(seed)
    truths, found = [], []
    for _ in range(images):
        shown, seen = [], []
        for _ in range(random.integers(0, 3)):
            box = np.concatenate([random.integers(0, 200, 2), random.integers(5, 150, 2)]).astype(float)
            label = CLASSES[random.integers(2)]
            shown.append(Truth(label, box))
            for _ in range(random.integers(0, 4)):
                near = box + random.normal(0, 0.1 * box[2], 4)
                near[2:] = np.abs(near[2:]) + 1
                seen.append(Detection(CLASSES[random.integers(2)], float(random.uniform()), near))
        truths.append(shown)
        found.append(seen)
    return truths, found


def by_pycocotools(truths, found):
    annotations = [
        {"image_id": i, "category_id": CLASSES.index(t.label), "bbox": list(t.box_px)}
        for i, image in enumerate(truths)
        for t in image
    ]
    for number, annotation in enumerate(annotations, 1):
        area = annotation["bbox"][2] * annotation["bbox"][3]
        annotation.update(id=number, area=area, iscrowd=0)
    results = [
        {"image_id": i, "category_id": CLASSES.index(d.label), "bbox": list(d.box_px), "score": d.score}
        for i, image in enumerate(found)
        for d in image
    ]
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        coco.dataset = {
            "info": {},
            "images": [{"id": i} for i in range(len(truths))],
            "annotations": annotations,
            "categories": [{"id": i, "name": name} for i, name in enumerate(CLASSES)],
        }
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(results), "bbox")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return evaluation.stats


@given(st.integers(0, 2**32 - 1))
def test_averages_are_those_of_pycocotools(seed):
    truths, found = random_case(seed)
    if not any(truths) or not any(found):
        return
    theirs = by_pycocotools(truths, found)
    ours = coco_metrics(truths, found, CLASSES)
    for name, place in (("mAP", 0), ("mAP50", 1), ("mAP75", 2), ("mAR", 8)):
        assert ours[name] == pytest.approx(theirs[place], abs=1e-12)


def test_nothing_found_scores_nothing():
    truths = [[Truth("aqua", np.array([1.0, 2, 30, 40]))]]
    assert coco_metrics(truths, [[]], CLASSES)["mAP"] == 0
    assert overlap_metrics(truths, [[]]) == {"box IoU mean": 0, "box IoU median": 0}
    assert overlap_metrics([[]], [[]]) == {}


def test_only_a_thousand_proposals_reach_the_truth():
    truth = [[Truth("aqua", np.array([10.0, 10, 40, 40]))]]
    boxes = [np.array([200.0, 200, 5, 5])] * 150 + [np.array([12.0, 10, 40, 40])]
    scores = list(np.linspace(1, 0, len(boxes)))
    assert proposal_recall([boxes], [scores], truth) == {"AR100": 0.0, "AR1k": 1.0}


boxes = st.tuples(*[st.integers(0, 30)] * 2, *[st.integers(1, 30)] * 2)


@given(boxes, boxes)
def test_overlap_counts_pixels(a, b):
    masks = np.zeros((2, 64, 64), bool)
    for mask, (x, y, w, h) in zip(masks, (a, b), strict=True):
        mask[y : y + h, x : x + w] = True
    expected = (masks[0] & masks[1]).sum() / (masks[0] | masks[1]).sum()
    assert box_iou(np.array(a, float), np.array(b, float)) == pytest.approx(expected)


@given(st.integers(0, 2**32 - 1), st.floats(0, np.pi), st.floats(0, 2))
def test_speed_errors_are_the_angle_and_the_relative_distance(seed, angle, share):
    random = np.random.default_rng(seed)
    attitude = Rotation.random(random_state=random)
    axis = random.normal(size=3)
    other = attitude * Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    t, away = random.normal((0, 0, 10), 1), random.normal(size=3)
    found = t + share * np.linalg.norm(t) * away / np.linalg.norm(away)
    q, q_other = (np.roll(r.as_quat(), 1) for r in (attitude, other))
    e_t, e_q = quaternion_pose_errors(q, t, q_other, found)
    assert e_t == pytest.approx(share, abs=1e-9)
    assert e_q == pytest.approx(angle, abs=1e-7)
    assert e_q == pytest.approx(2 * np.arccos(min(abs(q @ q_other), 1)), abs=1e-6)
    assert quaternion_pose_errors(q, t, -q_other, found)[1] == pytest.approx(e_q, abs=1e-9)


def test_a_symmetry_costs_nothing():
    turn = np.diag([1.0, -1.0, -1.0])
    R = Rotation.random(random_state=1).as_matrix()
    t = np.array([0.0, 0, 5])
    assert pose_errors(R, t, R @ turn, t)[1] == pytest.approx(np.pi)
    assert pose_errors(R, t, R @ turn, t, [turn])[1] == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize(
    ("version", "expected"),
    [
        # poses: both fine; only e_t fine; only e_q fine; none fine
        ("2019", [0.002 + np.deg2rad(0.1), 0.002 + np.deg2rad(1), 0.01 + np.deg2rad(0.1), 0.5 + np.pi]),
        ("2021", [0.0, 0.002 + np.deg2rad(1), 0.01 + np.deg2rad(0.1), 0.5 + np.pi]),
        ("2023", [0.0, np.deg2rad(1), 0.01, 0.5 + np.pi]),
    ],
)
def test_the_three_speed_scores(version, expected):
    e_t = np.array([0.002, 0.002, 0.01, 0.5])
    e_q = np.array([np.deg2rad(0.1), np.deg2rad(1), np.deg2rad(0.1), np.pi])
    for place, value in enumerate(expected):
        assert speed_score(e_t[place : place + 1], e_q[place : place + 1], version) == pytest.approx(
            value
        )
    assert speed_score(e_t, e_q, version) == pytest.approx(np.mean(expected))
