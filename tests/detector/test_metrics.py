"""Metrics of boxes against COCO's own code and counted pixels."""

import contextlib
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from posse_core._evaluation.metrics import (
    TrueBox,
    box_iou,
    coco_metrics,
    matches,
    precision_by_recall,
)
from posse_core._interfaces.detector import Detection

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
            shown.append(TrueBox(label, box))
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
    return evaluation


@given(st.integers(0, 2**32 - 1))
def test_averages_are_those_of_pycocotools(seed):
    truths, found = random_case(seed)
    if not any(truths) or not any(found):
        return
    evaluation = by_pycocotools(truths, found)
    theirs = evaluation.stats
    ours = coco_metrics(truths, found, CLASSES)
    for name, place in (("mAP", 0), ("mAP50", 1), ("mAP75", 2), ("mAR", 8)):
        assert ours[name] == pytest.approx(theirs[place], abs=1e-12)
    recall = evaluation.eval["recall"][:, :, 0, 2]
    known = [row[row > -1] for row in recall]
    assert ours["AR50"] == pytest.approx(max(row.mean() for row in known), abs=1e-12)
    for name, curves in precision_by_recall(truths, found, CLASSES).items():
        np.testing.assert_allclose(list(curves), np.linspace(0.5, 0.95, 10), atol=1e-12)
        for row, curve in enumerate(curves.values()):
            expected = evaluation.eval["precision"][row, :, CLASSES.index(name), 0, 2]
            np.testing.assert_allclose(curve, expected, atol=1e-12)


def test_nothing_found_scores_nothing():
    truths = [[TrueBox("aqua", np.array([1.0, 2, 30, 40]))]]
    assert coco_metrics(truths, [[]], CLASSES)["mAP"] == 0
    assert matches(truths[0], []) == [None]
    assert matches([], []) == []


@given(st.integers(0, 2**32 - 1))
def test_the_only_craft_of_a_class_is_judged_by_its_best_detection(seed):
    """However far off it is, as the single craft of an image always was."""
    for truths, found in zip(*random_case(seed), strict=True):
        labels = [truth.label for truth in truths]
        for truth, place in zip(truths, matches(truths, found), strict=True):
            if labels.count(truth.label) == 1:
                assert place == next((i for i, d in enumerate(found) if d.label == truth.label), None)


@given(st.integers(0, 2**32 - 1))
def test_craft_of_one_class_are_told_apart_as_coco_does(seed):
    """Boxes that do not overlap, found once each and within a few pixels: COCO's own matching."""
    random = np.random.default_rng(seed)
    corners = random.permutation([(x, y) for x in range(0, 400, 100) for y in range(0, 300, 100)])
    boxes = [np.array([*corner, *random.integers(40, 60, 2)], float) for corner in corners[:5]]
    truths = [TrueBox("aqua", box) for box in boxes]
    order = random.permutation(5)
    found = [Detection("aqua", 0.9, boxes[i] + random.normal(0, 2, 4)) for i in order]
    missed = int(random.integers(5))
    again = Detection("aqua", 0.1, boxes[missed] + 1)  # found twice: the better one counts
    evaluation = by_pycocotools([truths], [[*found, again]])
    (image,) = (
        e
        for e in evaluation.evalImgs
        if e and e["category_id"] == 0 and e["aRng"][0] == 0 and e["aRng"][1] > 1e9
    )
    of_truth = image["gtMatches"][0]  # ids from 1, of the detections
    assert matches(truths, [*found, again]) == [int(i) - 1 for i in of_truth]


boxes = st.tuples(*[st.integers(0, 30)] * 2, *[st.integers(1, 30)] * 2)


@given(boxes, boxes)
def test_overlap_counts_pixels(a, b):
    masks = np.zeros((2, 64, 64), bool)
    for mask, (x, y, w, h) in zip(masks, (a, b), strict=True):
        mask[y : y + h, x : x + w] = True
    expected = (masks[0] & masks[1]).sum() / (masks[0] | masks[1]).sum()
    assert box_iou(np.array(a, float), np.array(b, float)) == pytest.approx(expected)
