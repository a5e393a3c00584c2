"""Detectors: learn from a dataset, find the spacecraft in an image."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel

from posse_core.dataset import Dataset
from posse_core.model.arrays import AnyArray, FloatArray


@dataclass(frozen=True)
class Detection:
    """One found spacecraft.

    Attributes:
        label: the class, such as ``aqua``.
        score: 0 … 1.
        box_px: (4,) x, y, width, height.
        keypoints_px: (K, 2), or None where the detector has none.
        keypoints_sigma_px: (K,) standard deviation of each, or None.
    """

    label: str
    score: float
    box_px: FloatArray
    keypoints_px: FloatArray | None = None
    keypoints_sigma_px: FloatArray | None = None


class Detector(ABC):
    """Capabilities: ``train``, ``onnx`` (can be exported), ``keypoints``."""

    def __init__(self, options: BaseModel) -> None:
        self.options = options

    @abstractmethod
    def train(self, dataset: Dataset, folder: Path) -> Path:
        """Train on the dataset's train part; checkpoints and curves go to ``folder``, and a training
        cut short goes on from the last one. Returns the final checkpoint (safetensors)."""

    @abstractmethod
    def load(self, checkpoint: Path) -> None:
        """Take the weights from a checkpoint of :meth:`train`."""

    @abstractmethod
    def predict(self, images: Sequence[AnyArray]) -> Sequence[Sequence[Detection]]:
        """Detections by image, best first. Images: (H, W) or (H, W, 3), uint8 or uint16."""

    @abstractmethod
    def evaluate(self, dataset: Dataset, split: str) -> Mapping[str, float]:
        """Metrics on one part of the dataset, by name."""

    @abstractmethod
    def export_onnx(self, path: Path) -> None:
        """Write the net as ONNX with the metadata that running it needs."""
