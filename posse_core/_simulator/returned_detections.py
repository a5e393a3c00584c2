"""Checks of what detectors return; see :mod:`posse_core._simulator.returned`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._errors import ComponentError
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder, KeypointPlaces
from posse_core._plugins.component import failures_named
from posse_core._simulator.returned_types import floats, of_type, sequence

_ROUNDING: Final = 1e-4
"""How far the sum of shares may be above 1."""


class CheckedDetector(Detector):
    """A detector whose detections are checked."""

    def __init__(self, detector: Detector, name: str) -> None:
        super().__init__(detector.options)
        self._detector = detector
        self._name = name
        self.classes = detector.classes

    def load(self, path: Path) -> None:
        self._detector.load(path)
        self.classes = self._detector.classes

    def predict(self, images: Sequence[AnyArray]) -> list[list[Detection]]:
        who = f"detector {self._name!r}"
        with failures_named("detector", self._name):
            made = self._detector.predict(images)
        by_image = sequence(made, who, "a list of detections for each image")
        if len(by_image) != len(images):
            raise ComponentError(f"{who} returned {len(by_image)} lists for {len(images)} images")
        return [
            [_checked_detection(each, who) for each in sequence(found, who, "a list of detections")]
            for found in by_image
        ]


class CheckedKeypointFinder(KeypointFinder):
    """A finder of keypoints whose keypoints are checked."""

    def __init__(self, finder: KeypointFinder, name: str) -> None:
        super().__init__(finder.options)
        self._finder = finder
        self._name = name
        self._take_card()

    def _take_card(self) -> None:
        self.classes = self._finder.classes
        self.keypoints_body_m = getattr(self._finder, "keypoints_body_m", {})
        self.knows_any_roll = self._finder.knows_any_roll

    def load(self, path: Path) -> None:
        self._finder.load(path)
        self._take_card()

    def find(self, image: AnyArray, detections: Sequence[Detection]) -> list[Detection]:
        who = f"detector {self._name!r}"
        with failures_named("detector", self._name):
            made = self._finder.find(image, detections)
        found = [_checked_detection(each, who) for each in sequence(made, who, "detections")]
        if [each.label for each in found] != [each.label for each in detections]:
            raise ComponentError(f"{who} returned other detections than it was given")
        for each in found:
            wanted = len(self.keypoints_body_m.get(each.label, ()))
            if each.keypoints_px is None or len(each.keypoints_px) != wanted:
                raise ComponentError(f"{who} did not return the keypoints of {each.label!r}")
        return found


def _checked_detection(made: object, who: str) -> Detection:
    found = of_type(made, Detection, who)
    if not isinstance(found.label, str):
        raise ComponentError(f"{who}: the label {found.label!r} of a detection is not a string")
    score = _number(found.score)
    if score is None or not 0 <= score <= 1:
        raise ComponentError(f"{who}: the score {found.score!r} of a detection is not within 0 … 1")
    points, sigma = found.keypoints_px, found.keypoints_sigma_px
    if points is not None:
        points = floats(points, (None, 2), f"{who}: keypoints_px")
    if sigma is not None:
        count = None if points is None else len(points)
        sigma = floats(sigma, (count,), f"{who}: keypoints_sigma_px")
    return replace(
        found,
        score=score,
        box_px=floats(found.box_px, (4,), f"{who}: box_px"),
        keypoints_px=points,
        keypoints_sigma_px=sigma,
        places=None if found.places is None else _checked_places(found.places, points, who),
    )


def _checked_places(made: object, points: FloatArray | None, who: str) -> KeypointPlaces:
    places = of_type(made, KeypointPlaces, f"{who}: places")
    if points is None:
        raise ComponentError(f"{who}: a detection has places, but no keypoints_px")
    points_px = floats(places.points_px, (len(points), None, 2), f"{who}: places.points_px")
    shape = points_px.shape[:2]
    sigma_px = floats(places.sigma_px, shape, f"{who}: places.sigma_px")
    share = floats(places.share, shape, f"{who}: places.share")
    if (share < 0).any() or (share.sum(axis=1) > 1 + _ROUNDING).any() or (sigma_px <= 0).any():
        raise ComponentError(
            f"{who}: places have shares below 0 or of more than 1 together, or standard deviations of 0"
        )
    return KeypointPlaces(points_px, sigma_px, share)


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float | np.floating | np.integer) else None
