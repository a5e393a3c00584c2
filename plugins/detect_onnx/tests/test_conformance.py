"""The conformance kit on the models that come with the package."""

from __future__ import annotations

from posse_core.testing import DetectorConformance
from posse_detect_onnx.models import OnnxDetector, OnnxKeypoints
from posse_detect_onnx.options import OnnxOptions


class TestBoxes(DetectorConformance):
    capabilities = frozenset({"boxes", ".onnx", "shipped"})

    def detector(self) -> OnnxDetector:
        detector = OnnxDetector(OnnxOptions())
        detector.load(OnnxDetector.shipped["aqua", "cluster"])
        return detector


class TestKeypoints(DetectorConformance):
    capabilities = frozenset({"keypoints", ".onnx", "shipped"})

    def detector(self) -> OnnxKeypoints:
        finder = OnnxKeypoints(OnnxOptions())
        finder.load(OnnxKeypoints.shipped["aqua", "cluster"])
        return finder
