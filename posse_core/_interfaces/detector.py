"""Detectors: learn from a dataset, find the spacecraft in an image."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from posse_core._arrays import AnyArray, FloatArray
from posse_core._plugins.component import Component, OptionsT

if TYPE_CHECKING:  # plugins that name this interface beside their hooks are loaded by every command
    from posse_core._dataset.images import LabelledImages


@dataclass(frozen=True)
class Detection:
    """One found spacecraft.

    Attributes:
        label: the class, such as ``aqua``.
        score: 0 … 1.
        box_px: (4,) x, y, width, height; x and y are of the first pixel column and row.
        keypoints_px: (K, 2) in the order of the class's keypoints, or None where none were sought.
        keypoints_sigma_px: (K,) standard deviation of each, or None.
    """

    label: str
    score: float
    box_px: FloatArray
    keypoints_px: FloatArray | None = None
    keypoints_sigma_px: FloatArray | None = None


class Model(Component[OptionsT]):
    """A network that is trained, or read from a file. Its capabilities say what it can do."""

    shipped: Path | None = None
    """Model file of the trained net that comes with the plugin."""

    classes: Sequence[str] = ()
    """What it can find; known once it is loaded."""

    @abstractmethod
    def load(self, path: Path) -> None:
        """Take the weights from a model file.

        Raises:
            posse_core.InputError: not a file of this net.
        """

    def train(self, dataset: LabelledImages, folder: Path) -> Path:
        """Train on the dataset's train part; checkpoints and curves go to ``folder``, and a training
        cut short goes on from the last one. Returns the trained model's file."""
        raise NotImplementedError

    def export_onnx(self, path: Path, images: Sequence[AnyArray]) -> Mapping[str, float]:
        """Write the net as ONNX and hold it against the net itself on ``images``.

        Returns:
            Name → greatest difference found.

        Raises:
            posse_core.ComponentError: they differ by more than they may; no file is left.
        """
        raise NotImplementedError

    def write_int8(self, path: Path, out: Path, seen: Sequence[tuple[AnyArray, FloatArray]]) -> None:
        """Write what :meth:`export_onnx` wrote to ``path`` in eight bits to ``out``.

        Args:
            seen: images with the box (4,) x, y, width, height of what each shows: what the net sees of
                them tells how far its activations reach.
        """
        raise NotImplementedError


class Detector(Model[OptionsT]):
    """Finds spacecraft in images."""

    @abstractmethod
    def predict(self, images: Sequence[AnyArray]) -> Sequence[Sequence[Detection]]:
        """Detections by image, best first. Images: (H, W) or (H, W, 3), uint8 or uint16."""


class KeypointFinder(Model[OptionsT]):
    """Finds the keypoints of a spacecraft in the box around it."""

    keypoints_body_m: Mapping[str, FloatArray]
    """Class → (K, 3) metres, body frame, in the order of what it finds; known once it is loaded."""

    @abstractmethod
    def find(self, image: AnyArray, detections: Sequence[Detection]) -> Sequence[Detection]:
        """The detections, with their keypoints."""
