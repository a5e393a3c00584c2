"""Detectors of POSSE from ONNX files. Importing this module imports no onnxruntime."""

from __future__ import annotations

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_detectors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "onnx",
            "finds spacecraft by a .onnx file of 'posse export-onnx'",
            "posse_detect_onnx.models:OnnxDetector",
            "posse_detect_onnx.options:OnnxOptions",
            capabilities=frozenset({"boxes", ".onnx", "shipped"}),
        ),
        ComponentSpec(
            "onnx-keypoints",
            "finds keypoints by a .onnx file of 'posse export-onnx'",
            "posse_detect_onnx.models:OnnxKeypoints",
            "posse_detect_onnx.options:OnnxOptions",
            capabilities=frozenset({"keypoints", ".onnx", "shipped"}),
        ),
    ]
