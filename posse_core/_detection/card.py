"""Model cards, which describe the network in a model file and the data that it was trained on."""

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
"""The metadata key of safetensors and ONNX files under which the card is stored as JSON."""
_FORMAT = 1


@dataclass(frozen=True)
class ModelCard:
    """The description of a network, stored in the metadata of its safetensors or ONNX file.

    Attributes:
        net: name of the detector, as in ``posse train --detector``.
        task: ``boxes`` (finds spacecraft in images) or ``keypoints`` (finds keypoints in boxes).
        classes: names of the spacecraft; the network's labels are indices into them.
        input_px: side of the network's square input.
        keypoints_body_m: class → keypoint name → (3,) metres, body axes, in the order of the outputs.
        symmetries: class → rotations (3, 3) that leave the spacecraft's appearance unchanged.
        dataset_sha256: :attr:`Dataset.sha256` of the training data.
        scenario_sha256: SHA-256 of its ``scenario.yaml``; empty if it has none (``posse collect``).
        options: options of the network.
        epochs: number of epochs trained so far.
        version: version of the distribution that trained it.
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
        """Make the card of a network that learns from ``dataset``; see the attributes.

        Raises:
            InputError: The run that makes the dataset has not ended.
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
        """Read the card of a ``.safetensors`` file from its header.

        Raises:
            InputError: The file is missing, of another format, or without a card.
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
        """Class → slice of its keypoints among the outputs, which are ordered by class."""
        outputs, start = {}, 0
        for name in self.classes:
            count = len(self.keypoints_body_m[name])
            outputs[name] = slice(start, start + count)
            start += count
        return outputs

    @property
    def keypoint_arrays_m(self) -> dict[str, FloatArray]:
        """Class → (K, 3) keypoints in metres, body axes."""
        return {
            name: np.array(list(points.values()), np.float64).reshape(-1, 3)
            for name, points in self.keypoints_body_m.items()
        }

    def metadata(self) -> dict[str, str]:
        """Return the card as metadata of a model file."""
        return {KEY: json.dumps({"format": _FORMAT, **asdict(self)})}

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str], path: Path) -> Self:
        """Read the card from the metadata of the file ``path``.

        Raises:
            InputError: The file has no card, or one of another format.
        """
        if KEY not in metadata:
            raise InputError(
                f"{path}: has no POSSE metadata; give a model of 'posse train' or 'posse export-onnx'"
            )
        try:
            value = json.loads(metadata[KEY])
            if value.pop("format") != _FORMAT:
                raise ValueError("written by another version of POSSE")
            return cls(**{**value, "classes": tuple(value["classes"])})
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: its POSSE metadata cannot be read: {error}") from None
