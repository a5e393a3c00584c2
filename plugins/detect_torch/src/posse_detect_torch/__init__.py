"""Detectors of POSSE by PyTorch. Importing this module imports no torch."""

from __future__ import annotations

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_detectors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "nano",
            "a light detector for use on board: below 1.5 M parameters and 1 GMAC, no NMS",
            "posse_detect_torch.nano_detector:NanoDetector",
            "posse_detect_torch.options:NanoOptions",
            capabilities=frozenset({"boxes", "train", "onnx", "int8"}),
        ),
        ComponentSpec(
            "simcc",
            "keypoints with their uncertainty, in the square around a box",
            "posse_detect_torch.simcc_finder:SimccFinder",
            "posse_detect_torch.options:SimccOptions",
            capabilities=frozenset({"keypoints", "train", "onnx", "int8"}),
        ),
        ComponentSpec(
            "sdn",
            "the thesis' detector: ResNet, feature pyramid, region proposals; 28.9 M parameters",
            "posse_detect_torch.sdn_detector:SdnDetector",
            "posse_detect_torch.options:SdnOptions",
            capabilities=frozenset({"boxes", "train", "onnx", "int8"}),
        ),
    ]
