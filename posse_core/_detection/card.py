"""What a model file says of itself: the net, its classes and input, the data that it learned from."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from posse_core._dataset.dataset import PARTITION_FILE, Dataset
from posse_core._errors import InputError
from posse_core._files.atomic import sha256

KEY = "posse_model"
"""The metadata key that holds the card, as JSON, in safetensors and ONNX files alike."""
_FORMAT = 1


@dataclass(frozen=True)
class ModelCard:
    """Travels inside the model file.

    Attributes:
        net: the detector's name, as ``posse train --detector`` takes it.
        task: ``boxes`` (finds spacecraft in images) or ``keypoints`` (finds their points in boxes).
        classes: spacecraft names; a class id is a place here.
        input_px: side of the square that the net takes.
        keypoints_body_m: class → keypoint name → (3,) metres, body frame; order is that of the outputs.
        symmetries: class → rotations (3, 3) that leave the craft's looks unchanged.
        dataset_sha256, scenario_sha256: of the training data; see :func:`dataset_hash`.
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

    def metadata(self) -> dict[str, str]:
        """For the metadata of a model file."""
        return {KEY: json.dumps({"format": _FORMAT, **asdict(self)})}

    @staticmethod
    def from_metadata(metadata: Mapping[str, str], path: Path) -> ModelCard:
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
            return ModelCard(**{**value, "classes": tuple(value["classes"])})
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: its POSSE metadata cannot be read: {error}") from None


def read_card(path: Path) -> ModelCard:
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
    return ModelCard.from_metadata(metadata, path)


def dataset_hash(dataset: Dataset) -> str:
    """SHA-256 over the manifest's digests and the division into parts.

    The images' own digests stand in the label lines, which are hashed there.
    """
    digests = dict(dataset.manifest["sha256"])
    if dataset.is_divided:
        digests[PARTITION_FILE] = sha256(dataset.folder / PARTITION_FILE)
    rows = "".join(f"{digests[path]}  {path}\n" for path in sorted(digests))
    return hashlib.sha256(rows.encode()).hexdigest()


def scenario_hash(dataset: Dataset) -> str:
    """Digest of ``scenario.yaml``; empty where a dataset has none (``posse collect``)."""
    return str(dataset.manifest["sha256"].get("scenario.yaml", ""))


def card_of(dataset: Dataset, **more: Any) -> ModelCard:
    """The card of a net that learns from ``dataset``; ``more`` has what the data does not say."""
    crafts = dataset.spacecraft_by_name
    return ModelCard(
        classes=tuple(sorted(crafts)),
        keypoints_body_m={
            name: {k: [float(v) for v in x] for k, x in craft.keypoints_body_m.items()}
            for name, craft in sorted(crafts.items())
        },
        symmetries={
            name: [R.tolist() for R in craft.symmetries] for name, craft in sorted(crafts.items())
        },
        dataset_sha256=dataset_hash(dataset),
        scenario_sha256=scenario_hash(dataset),
        **more,
    )
