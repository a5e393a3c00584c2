"""Model cards, which describe the network in a model file and the data that it was trained on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from posse_core._arrays import FloatArray
from posse_core._dataset.images import LabelledImages
from posse_core._errors import InputError
from posse_core._files.reading import FileRecord, check_file, record_of
from posse_core._model.label_line import first_fault

KEY = "posse_model"
"""The metadata key of safetensors and ONNX files under which the card is stored as JSON."""
_FORMAT = 1
_MOST = 1000
"""The most classes, and the most keypoints, of a network."""
Task = Literal["boxes", "keypoints"]
"""What a network does: find spacecraft in images, or keypoints in boxes."""
_Position = Annotated[list[float], Field(min_length=3, max_length=3)]


@dataclass(frozen=True)
class ModelCard:
    """The description of a network, stored in the metadata of its safetensors or ONNX file.

    Attributes:
        net: name of the detector, as in ``posse train --detector``.
        task: ``boxes`` (finds spacecraft in images) or ``keypoints`` (finds keypoints in boxes).
        classes: names of the spacecraft; the network's labels are indices into them.
        input_px: side of the network's square input.
        keypoints_body_m: class → keypoint name → (3,) metres, body axes, in the order of the outputs.
        loose_keypoints: class → names of the keypoints that have no place of their own in body axes
            (:meth:`LabelledImages.loose_keypoints`).
        symmetries: class → rotations (3, 3) that leave the spacecraft's appearance unchanged.
        dataset_sha256: :attr:`Dataset.sha256` of the training data.
        scenario_sha256: SHA-256 of its ``scenario.yaml``; empty if it has none (``posse collect``).
        options: options of the network.
        epochs: number of epochs trained so far.
        version: version of the distribution that trained it.
    """

    __pydantic_config__ = FileRecord.model_config  # how the card of a file is checked

    net: str
    task: Task
    classes: Annotated[tuple[str, ...], Field(min_length=1, max_length=_MOST)]
    input_px: Annotated[int, Field(ge=8, le=4096)]
    dataset_sha256: str
    scenario_sha256: str
    version: str
    keypoints_body_m: Mapping[str, Mapping[str, _Position]] = field(default_factory=dict)
    loose_keypoints: Mapping[str, list[str]] = field(default_factory=dict)
    symmetries: Mapping[str, list[list[list[float]]]] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    epochs: Annotated[int, Field(ge=0)] = 0

    @classmethod
    def of_dataset(
        cls,
        dataset: LabelledImages,
        *,
        net: str,
        task: Task,
        input_px: int,
        version: str,
        options: Mapping[str, Any] | None = None,
    ) -> Self:
        """Make the card of a network that learns from ``dataset``; see the attributes.

        Raises:
            InputError: The run that makes the dataset has not ended.
        """
        crafts = sorted(dataset.classes.items())
        return cls(
            net=net,
            task=task,
            classes=tuple(name for name, _ in crafts),
            input_px=input_px,
            keypoints_body_m={
                name: {k: [float(v) for v in x] for k, x in craft.keypoints_body_m.items()}
                for name, craft in crafts
            },
            loose_keypoints={
                name: loose for name, _ in crafts if (loose := dataset.loose_keypoints(name))
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
        check_file(path)
        with open(path, "rb") as stream:
            length = int.from_bytes(stream.read(8), "little")
            if length > path.stat().st_size:
                raise InputError(f"{path}: not a safetensors file: its header is longer than the file")
            text = stream.read(length)
        header = record_of(text, _Header, f"{path}: not a safetensors file")
        return cls.from_metadata(header.metadata, path)

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
        """Class → (K, 3) keypoints in metres, body axes; NaN for :attr:`loose_keypoints`."""
        nowhere = [np.nan] * 3
        return {
            name: np.array(
                [
                    nowhere if key in self.loose_keypoints.get(name, ()) else point
                    for key, point in points.items()
                ],
                np.float64,
            ).reshape(-1, 3)
            for name, points in self.keypoints_body_m.items()
        }

    @property
    def knows_any_roll(self) -> bool:
        """Whether the network learned from pictures that were turned by any angle."""
        return bool(self.options.get("augment") and self.options.get("turn"))

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
        text, where = metadata[KEY].encode(), f"{path}: its POSSE metadata cannot be read"
        if record_of(text, _Format, where).format != _FORMAT:
            raise InputError(f"{where}: written by another version of POSSE")
        try:
            card = TypeAdapter(cls).validate_json(text)
        except ValidationError as error:
            raise InputError(f"{where}: {first_fault(error)}") from None
        if len(set(card.classes)) < len(card.classes):
            raise InputError(f"{where}: classes: one of {', '.join(card.classes)} is given twice")
        if card.task == "keypoints":
            card._check_keypoints(where)
        return card

    def _check_keypoints(self, where: str) -> None:
        for name in self.classes:
            if name not in self.keypoints_body_m:
                raise InputError(f"{where}: keypoints_body_m: has no keypoints of {name!r}")
        if not 0 < sum(map(len, self.keypoints_body_m.values())) <= _MOST:
            raise InputError(f"{where}: keypoints_body_m: has no keypoints, or more than {_MOST}")


class _Header(FileRecord):
    """The header of a safetensors file, as far as it is read here."""

    metadata: dict[str, str] = Field(default_factory=dict, alias="__metadata__")


class _Format(FileRecord):
    """The version of a card."""

    format: int
