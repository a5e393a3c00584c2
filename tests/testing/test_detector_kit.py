"""The kit of detectors catches what it is there for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posse_core import (
    ComponentError,
    Detection,
    Detector,
    InputError,
    KeypointFinder,
    Model,
    NoOptions,
    to_grey,
)
from posse_core.testing import DetectorConformance

CAPABLE = "test_it_does_what_its_capabilities_say"
CLASSES = "test_it_knows_its_classes"
REFUSED = "test_a_file_that_is_no_model_is_refused"
FORMED = "test_boxes_are_well_formed"
TOGETHER = "test_images_together_and_alone"
SAME = "test_the_same_image_gives_the_same_detections"
BITS = "test_bits_and_colours"
POINTS = "test_keypoints_are_well_formed"
POINTS_TOGETHER = "test_keypoints_together_and_alone"
UNTOUCHED = "test_what_it_is_given_is_left_alone"

BOXES = {
    "nothing": {},
    "no classes": {CLASSES: "set self.classes in load"},
    "class twice": {CLASSES: "a class is there twice"},
    "any error": {REFUSED: "raised OSError"},
    "error without the file": {REFUSED: "does not name the file"},
    "black image": {FORMED: "zero-size array"},
    "worst first": {FORMED: "are not sorted"},
    "centre": {FORMED: "x and y its corner"},
    "network's pixels": {FORMED: "not of the network's input"},
    "score of 2": {FORMED: "not within 0 … 1"},
    "unknown class": {FORMED: "is none of the classes"},
    "no width": {FORMED: "0.0 px wide"},
    "normalised over all images": {TOGETHER: "normalised over all of them"},
    "in reverse": {TOGETHER: "matched to the wrong images"},
    "no images": {TOGETHER: "need at least one"},
    "remembers": {SAME: "does it keep or draw something"},
    "training": {SAME: "is it in training mode"},
    "8 bits alone": {BITS: "full scale of its own type"},
    "red alone": {BITS: "the best detection of the image is not found"},
    "modifies": {UNTOUCHED: "changed the image"},
    "claims training": {CAPABLE: "claims 'train' and has no method"},
    "claims a model": {CAPABLE: "names no model file"},
    "ships a model that is not there": {CAPABLE: "left out of the wheel"},
    "ships a model by a name alone": {CAPABLE: "no tuple of the names"},
    "claims nothing": {CAPABLE: "neither 'boxes' nor 'keypoints'"},
}
KEYPOINTS = {
    "nothing": {},
    "no keypoints of a class": {POINTS: "keypoints_body_m has none of plate"},
    "detection dropped": {POINTS: "other detections than it was given"},
    "NaN": {POINTS: "keypoints_px has numbers that are"},
    "sigma of 0": {POINTS: "poses divide by it"},
    "scores of its own": {POINTS: "changed the score"},
    "boxes of its own": {POINTS: "changed the box"},
    "relative to the first box": {POINTS_TOGETHER: "has other keypoints than alone"},
    "modifies a box": {UNTOUCHED: "changed a box"},
}
CLAIMS = {
    "claims training": {"boxes", "train"},
    "claims a model": {"boxes", "shipped"},
    "ships a model that is not there": {"boxes", "shipped"},
    "ships a model by a name alone": {"boxes", "shipped"},
    "claims nothing": set(),
}
MADE = [0]


class Bright(Detector[NoOptions]):
    """The box of what is bright, and fainter ones within it, with one thing wrong."""

    asked = 0

    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong = wrong
        MADE[0] += 1
        self.number = MADE[0]
        self.classes = {"no classes": (), "class twice": ("craft", "craft")}.get(wrong, ("craft",))

    def load(self, path: Path) -> None:
        if self.wrong == "any error":
            raise OSError("bad magic number")
        raise InputError("no model" if self.wrong == "error without the file" else f"{path}: no model")

    def predict(self, images: Sequence[Any]) -> list[list[Detection]]:
        wrong = self.wrong
        if wrong == "no images":
            images = list(images)
            assert images, "need at least one"
        peak = max((to_grey(image).max() for image in images), default=0.0)
        found = [self.boxes(image, float(peak)) for image in images]
        return found[::-1] if wrong == "in reverse" else found

    def boxes(self, image: Any, peak: float) -> list[Detection]:
        wrong = self.wrong
        self.asked += 1
        grey = to_grey(image)
        if wrong == "8 bits alone":
            grey = np.minimum((image if image.ndim == 2 else image.mean(axis=-1)) / 255, 1.0)
        if wrong == "red alone" and image.ndim == 3:
            grey = 0.2126 * image[..., 0] / np.iinfo(image.dtype).max
        if wrong == "modifies":
            image[:] = image[::-1]
        rows, columns = np.nonzero(grey > 0.2)
        if wrong == "black image":
            rows.max()
        if len(rows) == 0:
            return []
        box = np.array([columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1], float)
        score = float(grey.max())
        if wrong == "normalised over all images":
            score /= 2 * max(peak, 0.1)
        if wrong == "remembers":
            score /= self.asked
        if wrong == "training":
            score /= self.number
        if wrong == "score of 2":
            score *= 2.01
        if wrong == "centre":
            box[:2] += box[2:]
        if wrong == "network's pixels":
            box = box / max(image.shape[:2]) * 512
        if wrong == "no width":
            box[2] = 0
        label = "ship" if wrong == "unknown class" else "craft"
        faint = Detection(label, score / 2, box * [1, 1, 0.5, 1])
        found = [Detection(label, score, box), faint]
        return found[::-1] if wrong == "worst first" else found


class Corners(KeypointFinder[NoOptions]):
    """The corners of boxes, with one thing wrong."""

    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong = wrong
        self.classes = ("brick", "plate")
        self.keypoints_body_m = {"brick": np.zeros((2, 3)), "plate": np.zeros((2, 3))}
        if wrong == "no keypoints of a class":
            self.keypoints_body_m = {"brick": np.zeros((2, 3))}

    def load(self, path: Path) -> None:
        raise InputError(f"{path}: no model")

    def find(self, image: Any, detections: Sequence[Detection]) -> list[Detection]:
        wrong, found = self.wrong, []
        for each in detections[1:] if wrong == "detection dropped" else detections:
            base = detections[0] if wrong == "relative to the first box" else each
            x, y, w, h = base.box_px
            points = np.array([[x, y], [x + w, y + h]])
            sigma = np.full(2, 0.0 if wrong == "sigma of 0" else 1.5)
            if wrong == "NaN":
                points[0] = np.nan
            score = each.score / 2 if wrong == "scores of its own" else each.score
            box = each.box_px + 1 if wrong == "boxes of its own" else each.box_px
            if wrong == "modifies a box":
                each.box_px[:] = np.rint(each.box_px) + 1
            found.append(
                replace(each, score=score, box_px=box, keypoints_px=points, keypoints_sigma_px=sigma)
            )
        return found


def check(make: Callable[[], Model], claims: set[str], caught: dict[str, str]) -> None:
    class Case(DetectorConformance):
        capabilities = frozenset(claims)

        def detector(self) -> Model:
            return make()

    for test in (name for name in vars(DetectorConformance) if name.startswith("test_")):
        if test in caught:
            with pytest.raises((AssertionError, ComponentError), match=caught[test]):
                getattr(Case(), test)()
        elif not caught:
            getattr(Case(), test)()


@pytest.mark.parametrize("wrong", BOXES)
def test_a_wrong_detector_fails_for_its_own_reason(wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if wrong == "ships a model that is not there":
        monkeypatch.setattr(Bright, "shipped", {("aqua",): Path("/nowhere/boxes.onnx")})
    if wrong == "ships a model by a name alone":
        monkeypatch.setattr(Bright, "shipped", {"aqua": Path("/nowhere/boxes.onnx")})
    check(lambda: Bright(wrong), CLAIMS.get(wrong, {"boxes"}), BOXES[wrong])


@pytest.mark.parametrize("wrong", KEYPOINTS)
def test_a_wrong_finder_of_keypoints_fails_for_its_own_reason(wrong: str) -> None:
    check(lambda: Corners(wrong), {"keypoints"}, KEYPOINTS[wrong])
