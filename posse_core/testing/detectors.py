"""The conformance class for detectors and finders of keypoints."""

from __future__ import annotations

import tempfile
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._errors import InputError
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder, Model
from posse_core._simulator.returned_detections import CheckedDetector, CheckedKeypointFinder
from posse_core.testing.conformance import Conformance

_SAME_PX, _SAME_SCORE = 0.5, 0.01
"""How far apart detections in two forms of one image may be."""
_METHODS = {"train": "train", "onnx": "export_onnx", "int8": "write_int8"}
"""Capability → the method of :class:`posse_core.Model` that it promises."""


class DetectorConformance(Conformance):
    """What every detector and finder of keypoints must do. A subclass provides :meth:`detector`, and may
    provide :meth:`image`."""

    @abstractmethod
    def detector(self) -> Model[Any]:
        """A new detector or finder, with a model that is loaded."""

    def image(self) -> AnyArray:
        """(H, W) uint8 or uint16, an image in which there may be something to find."""
        random = np.random.default_rng(3)
        picture = random.normal(8, 3, (96, 128)).clip(0, 255)
        cv2.fillConvexPoly(picture, np.array([[30, 20], [80, 30], [70, 70], [28, 55]]), 180.0)
        cv2.fillConvexPoly(picture, np.array([[80, 30], [95, 45], [84, 78], [70, 70]]), 90.0)
        return np.asarray(picture, dtype=np.uint8)

    def test_it_does_what_its_capabilities_say(self) -> None:
        """Each has its methods, and a shipped model is there."""
        kind = type(self.detector())
        assert self.capabilities & {"boxes", "keypoints"}, (
            "it claims neither 'boxes' nor 'keypoints', so nothing would ever use it"
        )
        for word, name in _METHODS.items():
            if word in self.capabilities:
                assert getattr(kind, name) is not getattr(Model, name), (
                    f"it claims {word!r} and has no method {name} of its own"
                )
        if "shipped" in self.capabilities:
            assert kind.shipped, "it claims 'shipped' and names no model file in `shipped`"
            for names, path in kind.shipped.items():
                assert isinstance(names, tuple), f"{names!r} is no tuple of the names that it knows"
                assert path.is_file(), f"{path} is not there; is it left out of the wheel?"

    def test_it_knows_its_classes(self) -> None:
        """After a model was loaded."""
        classes = self.detector().classes
        assert classes, "it has no classes; set self.classes in load"
        assert all(isinstance(name, str) and name for name in classes), f"{classes!r} are not all names"
        assert len(set(classes)) == len(classes), f"a class is there twice: {classes!r}"

    def test_a_file_that_is_no_model_is_refused(self) -> None:
        """By an ``InputError`` of one line that names the file, unless it needs no file."""
        with tempfile.TemporaryDirectory(prefix="posse-detector-kit-") as folder:
            for name, content in (
                ("empty.bin", b""),
                ("text.onnx", b"no model"),
                ("photo.png", b"\x89"),
            ):
                path = Path(folder) / name
                path.write_bytes(content)
                said = _refusal(self.detector(), path)
                if said is not None:
                    assert name in said, f"the error {said!r} does not name the file"
                    assert len(said.splitlines()) == 1, f"the error is not one line: {said}"

    def test_boxes_are_well_formed(self) -> None:
        """Capability ``boxes``: in the image, best first, of a class that it knows; whatever the image
        shows, and whatever its size, colours and bits."""
        if "boxes" not in self.capabilities:
            return
        detector = self._checked_detector()
        for what, image in _images(self.image()).items():
            (found,) = detector.predict([image])
            height, width = image.shape[:2]
            scores = [each.score for each in found]
            assert scores == sorted(scores, reverse=True), f"{what}: the scores {scores} are not sorted"
            for each in found:
                x, y, w, h = each.box_px
                assert w > 0, f"{what}: the box {each.box_px} is {w} px wide"
                assert h > 0, f"{what}: the box {each.box_px} is {h} px high"
                inside = x >= 0 and y >= 0 and x + w <= width + 1e-6 and y + h <= height + 1e-6
                assert inside, (
                    f"{what}: the box {each.box_px} is not within the image of {width} × {height}; are"
                    " x and y its corner (not its centre), in pixels of the image (not of the"
                    " network's input), and is it clipped?"
                )
                assert each.label in detector.classes, (
                    f"{what}: {each.label!r} is none of the classes {list(detector.classes)}"
                )

    def test_images_together_and_alone(self) -> None:
        """Capability ``boxes``: each image has its own detections, in the order of the images."""
        if "boxes" not in self.capabilities:
            return
        detector = self._checked_detector()
        assert detector.predict([]) == [], "of no images there are no detections"
        dim = (self.image() // 2)[:, ::-1].copy()
        images = [self.image(), np.zeros_like(dim), dim]
        together = detector.predict(images)
        for number, image in enumerate(images):
            (alone,) = detector.predict([image])
            _assert_alike(
                together[number],
                alone,
                f"image {number} of {len(images)} has other detections than alone; are they matched to"
                " the wrong images, or normalised over all of them?",
            )

    def test_the_same_image_gives_the_same_detections(self) -> None:
        """Capability ``boxes``: also after other images, and from a new detector."""
        if "boxes" not in self.capabilities:
            return
        detector = self._checked_detector()
        (first,) = detector.predict([self.image()])
        detector.predict([np.zeros((64, 48), np.uint8)])
        (again,) = detector.predict([self.image()])
        _assert_equal(
            again, first, "asked again, it finds something else; does it keep or draw something?"
        )
        (new,) = self._checked_detector().predict([self.image()])
        _assert_equal(new, first, "a new detector finds something else; is it in training mode?")

    def test_bits_and_colours(self) -> None:
        """Capability ``boxes``: an image of 16 bits, or with three equal bands, is the same image."""
        if "boxes" not in self.capabilities:
            return
        detector, image = self._checked_detector(), self.image()
        (grey,) = detector.predict([image])
        forms = {"three equal bands": np.stack([image] * 3, axis=-1)}
        if image.dtype == np.uint8:
            forms["16 bits"] = image.astype(np.uint16) * 257
        for what, other in forms.items():
            (found,) = detector.predict([other])
            _assert_alike(
                found[:1],
                grey,
                f"with {what} the same image has another best detection; is it divided by the full scale"
                " of its own type, as posse_core.to_grey does?",
            )
            _assert_alike(grey[:1], found, f"with {what} the best detection of the image is not found")

    def test_keypoints_are_well_formed(self) -> None:
        """Capability ``keypoints``: finite positions of each keypoint of the class, in the order of
        the detections, which are otherwise as they were; also in boxes across the border."""
        if "keypoints" not in self.capabilities:
            return
        finder = self._checked_finder()
        for what, image in _images(self.image()).items():
            given = _boxes(finder, image)
            found = finder.find(image, given)
            assert len(found) == len(given), f"{what}: {len(found)} detections of {len(given)}"
            for before, after in zip(given, found, strict=True):
                assert after.score == before.score, f"{what}: it changed the score of a detection"
                np.testing.assert_array_equal(
                    after.box_px, before.box_px, f"{what}: it changed the box of a detection"
                )
                sigma_px = after.keypoints_sigma_px
                if sigma_px is not None:
                    assert (sigma_px > 0).all(), (
                        f"{what}: a standard deviation is not positive: {sigma_px}; poses divide by it"
                    )

    def test_keypoints_together_and_alone(self) -> None:
        """Capability ``keypoints``: those of a detection do not depend on the others, nor on what was
        asked before."""
        if "keypoints" not in self.capabilities:
            return
        finder, image = self._checked_finder(), self.image()
        given = _boxes(finder, image)
        assert finder.find(image, []) == [], "of no detections there are no keypoints"
        together = finder.find(image, given)
        for number, each in enumerate(given):
            (alone,) = finder.find(image, [each])
            away_px = np.asarray(together[number].keypoints_px) - np.asarray(alone.keypoints_px)
            assert np.abs(away_px).max(initial=0.0) <= _SAME_PX, (
                f"detection {number} of {len(given)} has other keypoints than alone, by up to"
                f" {np.abs(away_px).max():.1f} px; are they matched to the wrong detections?"
            )

    def test_what_it_is_given_is_left_alone(self) -> None:
        image = self.image()
        kept = image.copy()
        if "boxes" in self.capabilities:
            self._checked_detector().predict([image])
        if "keypoints" in self.capabilities:
            finder = self._checked_finder()
            given = _boxes(finder, image)
            boxes = [each.box_px.copy() for each in given]
            finder.find(image, given)
            for before, each in zip(boxes, given, strict=True):
                np.testing.assert_array_equal(each.box_px, before, "it changed a box that it was given")
                assert each.keypoints_px is None, "it wrote keypoints into a detection that it was given"
        np.testing.assert_array_equal(image, kept, "it changed the image that it was given; copy it")

    def _checked_detector(self) -> CheckedDetector:
        model = self.detector()
        assert isinstance(model, Detector), "with the capability 'boxes' it is a posse_core.Detector"
        return CheckedDetector(model, type(model).__name__)

    def _checked_finder(self) -> CheckedKeypointFinder:
        model = self.detector()
        assert isinstance(model, KeypointFinder), (
            "with the capability 'keypoints' it is a posse_core.KeypointFinder"
        )
        finder = CheckedKeypointFinder(model, type(model).__name__)
        missing = sorted(set(finder.classes) - finder.keypoints_body_m.keys())
        assert not missing, f"keypoints_body_m has none of {', '.join(missing)}; set it in load"
        return finder


def _refusal(model: Model[Any], path: Path) -> str | None:
    """The message by which a file is refused; None if it is not, by a detector that needs none."""
    try:
        model.load(path)
    except InputError as error:
        return str(error)
    except Exception as error:
        raise AssertionError(
            f"load of a file that is no model raised {type(error).__name__}: {error}; raise an"
            " InputError that names the file"
        ) from error
    return None


def _images(image: AnyArray) -> Mapping[str, AnyArray]:
    """The image, and others that a detector must bear."""
    random = np.random.default_rng(5)
    noise = random.integers(0, 256, (120, 160, 3), dtype=np.uint8)
    return {
        "the image": image,
        "black": np.zeros((120, 160), np.uint8),
        "white, 16 bits": np.full((120, 160), 65535, np.uint16),
        "noise, in colour": noise,
        "noise, in colour, 16 bits": noise.astype(np.uint16) * 257,
        "an upright image": np.ascontiguousarray(noise.transpose(1, 0, 2)[..., 0]),
        "a wide strip": noise[:9, :, 0],
        "a few pixels": noise[:5, :7],
        "a view of a larger array": noise[::2, ::-2, 1],
    }


def _boxes(finder: KeypointFinder[Any], image: AnyArray) -> Sequence[Detection]:
    """Detections of every class: within the image, across its border, larger than it, and thin."""
    height, width = image.shape[:2]
    whole = np.array([0.0, 0.0, width, height])
    placed = [
        np.array([0.2, 0.2, 0.5, 0.5]) * [width, height, width, height],
        np.array([0.7 * width, 0.6 * height, width, height]),
        whole * 1.4 - [0.2 * width, 0.2 * height, 0, 0],
        np.array([0.5 * width, 0.0, 1.0, height]),
    ]
    first = Detection("", 0.9, whole)
    return [
        replace(first, label=name, score=0.9 - 0.1 * number, box_px=box)
        for number, box in enumerate(placed)
        for name in finder.classes
    ]


def _assert_alike(found: Sequence[Detection], among: Sequence[Detection], why: str) -> None:
    """Check that each of the detections that are not faint is among others."""
    for each in found:
        near = (
            other.label == each.label
            and abs(other.score - each.score) <= _SAME_SCORE
            and np.abs(other.box_px - each.box_px).max() <= _SAME_PX
            for other in among
        )
        assert each.score < 0.05 or any(near), f"{why} ({each.label}, {each.score:.3f}, {each.box_px})"


def _assert_equal(found: Sequence[Detection], other: Sequence[Detection], why: str) -> None:
    assert len(found) == len(other), f"{why} ({len(found)} detections instead of {len(other)})"
    for one, two in zip(found, other, strict=True):
        assert (one.label, one.score) == (two.label, two.score), why
        np.testing.assert_array_equal(one.box_px, two.box_px, why)
