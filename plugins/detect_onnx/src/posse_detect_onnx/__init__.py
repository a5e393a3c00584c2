"""POSSE detectors from ONNX files. Importing this module does not import onnxruntime."""

from __future__ import annotations

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_detectors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "onnx",
            "finds spacecraft with an .onnx file made by 'posse export-onnx'",
            "posse_detect_onnx.models:OnnxDetector",
            "posse_detect_onnx.options:OnnxOptions",
            capabilities=frozenset({"boxes", ".onnx", "shipped"}),
        ),
        ComponentSpec(
            "onnx-keypoints",
            "finds keypoints with an .onnx file made by 'posse export-onnx'",
            "posse_detect_onnx.models:OnnxKeypoints",
            "posse_detect_onnx.options:OnnxOptions",
            capabilities=frozenset({"keypoints", ".onnx", "shipped"}),
        ),
    ]
