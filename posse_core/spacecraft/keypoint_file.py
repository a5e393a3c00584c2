"""Keypoints in a file: the user's own, or those of a package or a dataset's spacecraft/NAME.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import Field, field_validator, model_validator

from posse_core.errors import InputError
from posse_core.model.arrays import FloatArray
from posse_core.options import Options, validated

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Keypoints:
    """What :class:`~posse_core.model.spacecraft.Spacecraft` holds besides its mesh."""

    keypoints_body_m: Mapping[str, FloatArray] = field(default_factory=dict)
    skeleton: tuple[tuple[str, str], ...] = ()
    symmetries: tuple[FloatArray, ...] = ()


class KeypointModel(Options):
    """The keys that a keypoint file may have."""

    keypoints: dict[str, Triple] = Field(
        min_length=1,
        description="name: [x, y, z] in metres in the body frame; T main body top, B bottom,"
        " A antenna, S solar panel, each with a number",
    )
    skeleton: tuple[tuple[str, str], ...] = Field(
        (), description="pairs of keypoint names to draw lines between"
    )
    symmetries: tuple[tuple[Triple, Triple, Triple], ...] = Field(
        (), description="rotations, as rows, that leave the spacecraft's looks unchanged"
    )

    @field_validator("symmetries")
    @classmethod
    def _rotations(cls, matrices: Any) -> Any:
        for rows in matrices:
            R = np.array(rows)
            if not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0.0:
                raise ValueError("a symmetry is a rotation matrix")
        return matrices

    @model_validator(mode="after")
    def _known_names(self) -> KeypointModel:
        for pair in self.skeleton:
            for name in pair:
                if name not in self.keypoints:
                    raise ValueError(f"skeleton names {name!r}, which is not a keypoint")
        return self

    def records(self) -> Keypoints:
        """As arrays."""
        return Keypoints(
            {name: np.array(point) for name, point in self.keypoints.items()},
            self.skeleton,
            tuple(np.array(rows) for rows in self.symmetries),
        )


def read_keypoints(path: Path) -> Keypoints:
    """Keypoints from YAML or JSON; other keys of a dataset's spacecraft record are passed over.

    Raises:
        InputError: the file is missing, or holds something else.
    """
    raw = read_mapping(path)
    known = {key: value for key, value in raw.items() if key in KeypointModel.model_fields}
    return validated(KeypointModel, known, lambda key: f"{path}: {'.'.join(map(str, key))}").records()


def read_mapping(path: Path) -> dict[str, Any]:
    """A YAML or JSON file that holds a mapping.

    Raises:
        InputError: it is missing, or not such a file.
    """
    try:
        raw = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark is not None else ""
        raise InputError(f"{path}{line}: not a YAML file") from None
    if not isinstance(raw, dict):
        raise InputError(f"{path}: not a mapping of keys to values")
    return raw
