"""Options of the detectors. Importing this module does not import torch."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import Field, FilePath, ValidationError, field_serializer

from posse_core import InputError, ModelCard, Options

Size = Literal["nano", "small", "base"]


class TrainOptions(Options):
    """Options of training and running a network."""

    epochs: int = Field(100, ge=1, description="passes over the train part")
    batch: int = Field(16, ge=1, description="pictures per training step")
    learning_rate: float = Field(
        2e-3, gt=0, description="largest learning rate; it falls along a cosine"
    )
    weight_decay: float = Field(0.01, ge=0, description="weight decay of AdamW")
    augment: bool = Field(
        True, description="augment the training pictures: rotate, zoom, relight, blur and cover them"
    )
    turn: bool = Field(
        True, description="rotate pictures when augmenting; otherwise the camera's roll is learned too"
    )
    start: FilePath | None = Field(
        None,
        description="model file to start from, .safetensors or (nano, heatmap) .onnx; weights that agree"
        " in name and shape are loaded",
    )
    seed: int = Field(0, ge=0, description="seed of the initial weights, the order and the augmentation")
    threads: int = Field(
        1, ge=1, description="CPU threads; training is reproducible for the same number of threads"
    )
    device: Literal["cpu", "cuda"] = Field("cpu", description="device that the network runs on")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "auto",
        description="numbers that training multiplies; auto takes bfloat16 where the processor has"
        " instructions for it",
    )

    @field_serializer("start", "backbone_weights", check_fields=False)
    def _name_and_digest(self, path: Path | None) -> str | None:
        """Return the file's name and digest, which the model card records in place of its path."""
        if path is None:
            return None
        with open(path, "rb") as file:
            return f"{path.name}, SHA-256 {hashlib.file_digest(file, 'sha256').hexdigest()}"


class BoxOptions(TrainOptions):
    """Options of a network that finds boxes."""

    input_px: int = Field(
        320, ge=64, le=1024, multiple_of=32, description="side of the network's square input, px"
    )


class NanoOptions(BoxOptions):
    """Options of the light detector."""

    size: Size = Field("nano", description="number of channels: 1.4, 2.2 or 4.3 million weights")
    detections: int = Field(16, ge=1, le=100, description="largest number of detections in an image")


class SdnOptions(BoxOptions):
    """Options of the thesis' network; the defaults are those of the thesis."""

    epochs: int = Field(60, ge=1, description="passes over the train part")
    batch: int = Field(48, ge=1, description="pictures per training step")
    learning_rate: float = Field(1e-3, gt=0, description="learning rate, the same at every step")
    weight_decay: float = Field(1e-4, ge=0, description="weight decay of SGD")
    augment: bool = Field(
        False, description="augment the training pictures: rotate, zoom, relight, blur and cover them"
    )
    input_px: int = Field(
        640, ge=64, le=1024, multiple_of=64, description="side of the network's square input, px"
    )
    depth: Literal[18, 50] = Field(18, description="number of layers of the ResNet")
    backbone_weights: FilePath | None = Field(
        None,
        description="safetensors file of an ImageNet ResNet from torchvision or timm to start from;"
        " without it the initial weights are random",
    )
    regions: int = Field(
        512, ge=4, description="regions of a picture to learn from; fewer are faster on a CPU"
    )
    sampling: Literal[1, 2] = Field(
        1, description="samples along each axis of a region's bin; 2 is more accurate"
    )
    least_score: float = Field(
        0.7, ge=0, lt=1, description="detections of a lower score are dropped; 0 gives a higher mAP"
    )


class HeatmapOptions(TrainOptions):
    """Options of the keypoint network."""

    input_px: int = Field(
        256, ge=64, le=512, multiple_of=32, description="side of the network's square input, px"
    )
    size: Size = Field("small", description="number of channels: 1.4, 2.2 or 4.3 million weights")


OptionsT = TypeVar("OptionsT", bound=TrainOptions)


def trained_with(card: ModelCard, options: type[OptionsT]) -> OptionsT:
    """Return the options that a network was trained with; files that it started from are left out.

    Raises:
        InputError: The card has other options.
    """
    files = {"start": None, "backbone_weights": None}  # cards record only their digests
    known = {key: files.get(key, value) for key, value in card.options.items()}
    try:
        return options.model_validate(known)
    except ValidationError as error:
        key = ".".join(map(str, error.errors()[0]["loc"]))
        raise InputError(f"its POSSE metadata cannot be read: options.{key}") from None
