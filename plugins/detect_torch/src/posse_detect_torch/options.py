"""Options of the nets; importing this imports no torch."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

from pydantic import Field, FilePath, field_serializer

from posse_core import Options


class TrainOptions(Options):
    """How a net runs and learns."""

    epochs: int = Field(100, ge=1, description="passes over the train part")
    batch: int = Field(16, ge=1, description="pictures a step")
    learning_rate: float = Field(2e-3, gt=0, description="its greatest value; it falls along a cosine")
    weight_decay: float = Field(0.01, ge=0, description="of AdamW")
    augment: bool = Field(True, description="turn, zoom, light, blur and cover the pictures")
    turn: bool = Field(True, description="turn them; else the craft is known as the camera holds it")
    start: FilePath | None = Field(
        None, description="model file whose weights, where name and shape agree, are begun with"
    )
    seed: int = Field(0, ge=0, description="of weights, order and augmentation")
    threads: int = Field(1, ge=1, description="CPU threads; a training repeats itself for one number")
    device: Literal["cpu", "cuda"] = Field("cpu", description="where the net runs")

    @field_serializer("start", "backbone_weights", check_fields=False)
    def _told(self, path: Path | None) -> str | None:
        """What model files tell: the file and its digest, not its place on this machine."""
        if path is None:
            return None
        with open(path, "rb") as file:
            return f"{path.name}, SHA-256 {hashlib.file_digest(file, 'sha256').hexdigest()}"


class BoxOptions(TrainOptions):
    """A net that finds boxes."""

    input_px: int = Field(320, ge=64, le=1024, multiple_of=32, description="side of the net's picture")


class NanoOptions(BoxOptions):
    """The light detector."""

    detections: int = Field(16, ge=1, le=100, description="most that it finds in an image")


class SdnOptions(BoxOptions):
    """The thesis' net; the defaults are the thesis' own."""

    epochs: int = Field(60, ge=1, description="passes over the train part")
    batch: int = Field(48, ge=1, description="pictures a step")
    learning_rate: float = Field(1e-3, gt=0, description="the same at every step")
    weight_decay: float = Field(1e-4, ge=0, description="of SGD")
    augment: bool = Field(False, description="turn, zoom, light, blur and cover the pictures")
    input_px: int = Field(640, ge=64, le=1024, multiple_of=64, description="side of the net's picture")
    depth: Literal[18, 50] = Field(18, description="of the ResNet")
    backbone_weights: FilePath | None = Field(
        None, description="safetensors of an ImageNet ResNet, torchvision's or timm's; else random"
    )
    regions: int = Field(
        512, ge=4, description="regions of a picture to learn from; the fewer the faster on a CPU"
    )
    sampling: Literal[1, 2] = Field(1, description="samples along a region's bin; 2 is better")
    least_score: float = Field(0.7, ge=0, lt=1, description="detections below are dropped; 0 is better")


class SimccOptions(TrainOptions):
    """The keypoint net."""

    input_px: int = Field(256, ge=64, le=512, multiple_of=32, description="side of the net's square")
