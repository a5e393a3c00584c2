"""Detectors of POSSE by PyTorch, and :class:`PoseDataset`.

Importing this module does not import torch; torch is imported when a name is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from posse_core import ComponentSpec, hookimpl

if TYPE_CHECKING:
    from posse_detect_torch.pose_dataset import PoseDataset as PoseDataset
    from posse_detect_torch.pose_dataset import PoseSample as PoseSample

__all__ = ["PoseDataset", "PoseSample", "posse_detectors"]


def __getattr__(name: str) -> Any:
    if name in ("PoseDataset", "PoseSample"):
        from posse_detect_torch import pose_dataset

        return getattr(pose_dataset, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


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
            "heatmap",
            "keypoints with their uncertainty, in the square around a box",
            "posse_detect_torch.heatmap_finder:HeatmapFinder",
            "posse_detect_torch.options:HeatmapOptions",
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
