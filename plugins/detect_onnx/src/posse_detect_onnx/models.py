"""Detectors from ONNX files. The graph includes the decoding: it takes pictures and returns pixels."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime

from posse_core import (
    AnyArray,
    Detection,
    Detector,
    Float32Array,
    FloatArray,
    InputError,
    KeypointFinder,
    KeypointPlaces,
    ModelCard,
    Square,
    to_grey,
)
from posse_detect_onnx.options import OnnxOptions

onnxruntime.disable_telemetry_events()

_BOXES, _KEYPOINTS = ["boxes", "scores", "labels"], ["points", "sigma"]
"""Names of the outputs of the two tasks' graphs."""
_SHARE = "share"
"""Output of graphs that know several places of each keypoint: their points are (B, P, M, 2), their
standard deviations and shares (B, P, M). Others give points (B, P, 2) and standard deviations (B, P)."""
_NETS = {
    ("aqua", "cluster"): "aqua-cluster",
    ("aqua",): "aqua",
    ("cluster",): "cluster",
    ("tango",): "tango",
}
"""Names of spacecraft → folder of the networks that know them."""
_BEFORE_REASON = re.compile(
    r"^(.*\[ONNXRuntimeError\] : \d+ : \w+ : )?(.*? failed:)?(/\S+:\d+ .*?\) (?=[A-Z]))?"
)
"""What onnxruntime writes before the reason: its code, the file, and the line of its own source."""


def _shipped(task: str) -> Mapping[tuple[str, ...], Path]:
    """The shipped models of a task by the spacecraft that they know."""
    nets = Path(__file__).parent / "nets"
    return {names: nets / folder / f"{task}.onnx" for names, folder in _NETS.items()}


def _open(
    path: Path, task: str, outputs: Sequence[str], threads: int
) -> tuple[onnxruntime.InferenceSession, ModelCard]:
    """Open a model and its card.

    Raises:
        InputError: The file is not ONNX, has no POSSE model card, is for another task, or its graph has
            other inputs or outputs.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    # Two models run in turn; spinning idle threads of one would occupy the cores that the other needs.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(
            str(path), sess_options=options, providers=["CPUExecutionProvider"]
        )
        metadata = session.get_modelmeta().custom_metadata_map
    except Exception as error:  # onnxruntime's exception classes are not public
        reason = _BEFORE_REASON.sub("", str(error).strip().splitlines()[0])
        raise InputError(f"{path}: not an ONNX file that onnxruntime can run: {reason}") from None
    card = ModelCard.from_metadata(metadata, path)
    if card.task != task:
        raise InputError(f"{path}: this model finds {card.task}, but one that finds {task} is needed")
    square = [1, card.input_px, card.input_px]
    taken = {
        entry.name: entry.shape[1:]
        if entry.shape[:1] == [1] or isinstance(entry.shape[0], str)
        else entry.shape
        for entry in session.get_inputs()
    }
    if taken != {"picture": square}:
        raise InputError(f"{path}: takes {taken}, but POSSE gives it {{'picture': {square}}}")
    missing = set(outputs) - {entry.name for entry in session.get_outputs()}
    if missing:
        raise InputError(f"{path}: does not give {', '.join(sorted(missing))}; export the model again")
    return session, card


class OnnxDetector(Detector[OnnxOptions]):
    """Finds the boxes of spacecraft with an ONNX model."""

    shipped = _shipped("boxes")

    def load(self, path: Path) -> None:
        self._session, self._card = _open(path, "boxes", _BOXES, self.options.threads)
        self.classes = self._card.classes

    def predict(self, images: Sequence[AnyArray]) -> list[list[Detection]]:
        found = []
        for image in images:
            square = Square.of_image(image.shape[0], image.shape[1], self._card.input_px)
            boxes, scores, labels = self._session.run(_BOXES, {"picture": _picture(image, square)})
            arrays = boxes[0], scores[0], labels[0]
            found.append(square.detections_out(*arrays, self.classes, *image.shape[:2]))
        return found


class OnnxKeypoints(KeypointFinder[OnnxOptions]):
    """Finds keypoints in boxes with an ONNX model."""

    shipped = _shipped("keypoints")

    def load(self, path: Path) -> None:
        self._session, self._card = _open(path, "keypoints", _KEYPOINTS, self.options.threads)
        given = {entry.name for entry in self._session.get_outputs()}
        self._outputs = [*_KEYPOINTS, *(name for name in [_SHARE] if name in given)]
        self.classes = self._card.classes
        self.keypoints_body_m: Mapping[str, FloatArray] = self._card.keypoint_arrays_m
        self.knows_any_roll = self._card.knows_any_roll

    def find(self, image: AnyArray, detections: Sequence[Detection]) -> list[Detection]:
        found = []
        ranges = self._card.keypoint_outputs
        for detection in detections:
            square = Square.around(detection.box_px, self._card.input_px)
            outputs = self._session.run(self._outputs, {"picture": _picture(image, square)})
            points, sigma, *share = (
                np.asarray(output[0, ranges[detection.label]], np.float64) for output in outputs
            )
            points_px, sigma_px = square.points_out(points), sigma / square.scale
            if share:
                found.append(detection.with_places(KeypointPlaces(points_px, sigma_px, *share)))
            else:
                found.append(replace(detection, keypoints_px=points_px, keypoints_sigma_px=sigma_px))
        return found


def _picture(image: AnyArray, square: Square) -> Float32Array:
    """Return the model's input (1, 1, S, S)."""
    return square.cut(to_grey(image))[None, None]
