"""The kit of annotators catches what it is there for."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest

from posse_core import Annotator, ComponentError, Labels, Look, Options
from posse_core.testing import AnnotatorConformance

WRITTEN = "test_its_labels_can_be_written"
SAME = "test_every_frame_has_the_same_labels_and_arrays"
SOMETHING = "test_it_makes_something"
ALONE = "test_a_frame_does_not_depend_on_others"
WORKER = "test_a_worker_gives_the_same_labels"
CAMERAS = "test_another_camera_and_another_body"
PLAIN = "test_a_spacecraft_without_keypoints"
UNTOUCHED = "test_what_it_is_given_is_left_alone"

CAUGHT = {
    "nothing": {},
    "label left out": {SAME: "is a label left out"},
    "array left out": {SAME: "is a label left out"},
    "other type where empty": {SAME: "an array of another type"},
    "NaN": {WRITTEN: "give None for no value"},
    "object": {WRITTEN: "which JSON does not have"},
    "whole image": {WRITTEN: "must be the view's box"},
    "no labels": {SOMETHING: "neither labels nor arrays"},
    "remembers": {ALONE: "keep something of the last frame"},
    "counts instances": {ALONE: "does the class keep a state"},
    "of its process": {WORKER: "other labels in another process"},
    "first camera": {CAMERAS: "view's box"},
    "first scene": {CAMERAS: "keep the camera or the scene"},
    "needs keypoints": {PLAIN: "no keypoints"},
    "modifies": {UNTOUCHED: "changed an array of its look"},
}


class SpoiledOptions(Options):
    wrong: str = "nothing"


class Spoiled(Annotator[SpoiledOptions]):
    """The nearest point and the heights in the image, with one thing wrong."""

    made = 0
    asked = 0
    box: Any = None
    scene: Any = None

    def __init__(self, options: SpoiledOptions) -> None:
        super().__init__(options)
        type(self).made += 1
        self.number = type(self).made

    def annotate(self, look: Look) -> Labels:
        wrong, view = self.options.wrong, look.view()
        seen = bool(view.mask.any())
        nearest = float(view.depth_m[view.mask].min()) if seen else None
        values: dict[str, Any] = {"nearest_m": nearest, "lit": int(view.lit.sum())}
        height = np.where(view.hit, view.depth_m, np.nan).astype(np.float32)
        arrays: dict[str, Any] = {"height_m": height}
        self.asked += 1
        if wrong == "label left out" and not seen:
            del values["nearest_m"]
        if wrong == "array left out" and not seen:
            arrays = {}
        if wrong == "other type where empty" and not seen:
            arrays = {"height_m": np.zeros(view.mask.shape)}
        if wrong == "NaN" and not seen:
            values["nearest_m"] = np.nan
        if wrong == "object":
            values["box"] = view.box
        if wrong == "whole image":
            camera = look.scene.camera
            arrays["height_m"] = np.zeros((camera.height_px, camera.width_px), np.float32)
        if wrong == "no labels":
            return Labels()
        if wrong == "remembers":
            values["asked"] = self.asked
        if wrong == "counts instances":
            values["made"] = self.number
        if wrong == "of its process":
            values["process"] = os.getpid()
        if wrong == "first camera":
            self.box = self.box or look.scene.camera
            sides = (self.box.height_px, self.box.width_px)
            arrays["height_m"] = height if self.box == look.scene.camera else np.zeros(sides, np.float32)
        if wrong == "first scene":
            self.scene = self.scene or look.scene
            values |= {part.name: 0 for part in look.scene.spacecraft.parts}
        if wrong == "needs keypoints":
            assert len(view.keypoints_px), "the spacecraft has no keypoints"
        if wrong == "modifies":
            view.depth_m[np.isnan(view.depth_m)] = 0
        return Labels(values, arrays)


@pytest.mark.parametrize("wrong", CAUGHT)
def test_a_wrong_annotator_fails_for_its_own_reason(wrong: str) -> None:
    class Case(AnnotatorConformance):
        def annotator(self) -> Annotator:
            return Spoiled(SpoiledOptions(wrong=wrong))

    for test in (name for name in vars(AnnotatorConformance) if name.startswith("test_")):
        reason = CAUGHT[wrong].get(test)
        if reason is not None:
            with pytest.raises((AssertionError, ComponentError), match=reason):
                getattr(Case(), test)()
        elif not CAUGHT[wrong]:
            getattr(Case(), test)()
