"""What a model file says of itself: the net, its classes and input, the data that it learned from."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.images import LabelledImages
from posse_core._errors import InputError

KEY = "posse_model"
"""The metadata key that holds the card, as JSON, in safetensors and ONNX files alike."""
_FORMAT = 1


@dataclass(frozen=True)
class ModelCard:
    """What a model file says of the net in it; it travels in the metadata of safetensors and ONNX files.

    Attributes:
        net: the detector's name, as ``posse train --detector`` takes it.
        task: ``boxes`` (finds spacecraft in images) or ``keypoints`` (finds their points in boxes).
        classes: spacecraft names; a net's label is an index into them.
        input_px: side of the square that the net takes.
        keypoints_body_m: class → keypoint name → (3,) metres, body frame, in the order of the outputs.
        symmetries: class → rotations (3, 3) that leave the craft's looks unchanged.
        dataset_sha256, scenario_sha256: of the training data: :attr:`Dataset.sha256`, and its
            ``scenario.yaml``, empty where it has none (``posse collect``).
        options: the net's options.
        epochs: trained so far.
        version: of the distribution that trained it.
    """

    net: str
    task: str
    classes: tuple[str, ...]
    input_px: int
    dataset_sha256: str
    scenario_sha256: str
    version: str
    keypoints_body_m: Mapping[str, Mapping[str, list[float]]] = field(default_factory=dict)
    symmetries: Mapping[str, list[list[list[float]]]] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    epochs: int = 0

    @classmethod
    def of_dataset(
        cls,
        dataset: LabelledImages,
        *,
        net: str,
        task: str,
        input_px: int,
        version: str,
        options: Mapping[str, Any] | None = None,
    ) -> Self:
        """The card of a net that learns from ``dataset``; the rest is as of the attributes.

        Raises:
            InputError: the run that makes the dataset has not ended.
        """
        crafts = sorted(dataset.spacecraft_by_name.items())
        return cls(
            net=net,
            task=task,
            classes=tuple(name for name, _ in crafts),
            input_px=input_px,
            keypoints_body_m={
                name: {k: [float(v) for v in x] for k, x in craft.keypoints_body_m.items()}
                for name, craft in crafts
            },
            symmetries={name: [R.tolist() for R in craft.symmetries] for name, craft in crafts},
            dataset_sha256=dataset.sha256,
            scenario_sha256=dataset.scenario_sha256,
            version=version,
            options=dict(options or {}),
        )

    @classmethod
    def read(cls, path: Path) -> Self:
        """The card of a ``.safetensors`` file, from its header alone.

        Raises:
            InputError: missing, not of that format, or without a card.
        """
        try:
            with open(path, "rb") as stream:
                (length,) = struct.unpack("<Q", stream.read(8))
                if length > path.stat().st_size:
                    raise ValueError("its header is longer than the file")
                header = json.loads(stream.read(length))
            metadata = header.get("__metadata__", {})
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        except (struct.error, ValueError, AttributeError):
            raise InputError(f"{path}: not a safetensors file") from None
        return cls.from_metadata(metadata, path)

    @property
    def keypoint_outputs(self) -> dict[str, slice]:
        """Class → its keypoints among a net's outputs, which hold those of all classes, in order."""
        outputs, start = {}, 0
        for name in self.classes:
            count = len(self.keypoints_body_m[name])
            outputs[name] = slice(start, start + count)
            start += count
        return outputs

    @property
    def keypoint_arrays_m(self) -> dict[str, FloatArray]:
        """Class → (K, 3) keypoints, metres, body frame."""
        return {
            name: np.array(list(points.values()), np.float64).reshape(-1, 3)
            for name, points in self.keypoints_body_m.items()
        }

    def metadata(self) -> dict[str, str]:
        """For the metadata of a model file."""
        return {KEY: json.dumps({"format": _FORMAT, **asdict(self)})}

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str], path: Path) -> Self:
        """Read what :meth:`metadata` wrote into the file ``path``.

        Raises:
            InputError: it has no card, or one of another format.
        """
        if KEY not in metadata:
            raise InputError(
                f"{path}: has no POSSE metadata; name a model by 'posse train' or 'posse export-onnx'"
            )
        try:
            value = json.loads(metadata[KEY])
            if value.pop("format") != _FORMAT:
                raise ValueError("written by another version of POSSE")
            return cls(**{**value, "classes": tuple(value["classes"])})
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: its POSSE metadata cannot be read: {error}") from None
