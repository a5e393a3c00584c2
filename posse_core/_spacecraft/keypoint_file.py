"""Keypoint files: a user's own, the description of a package, or a dataset's spacecraft/NAME.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, field_validator, model_validator

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._model.spacecraft import Part
from posse_core._plugins.options import Options, nearest, validated
from posse_core._scenario.yaml_lines import YamlText

Triple = tuple[float, float, float]


class Corner(Options):
    """A keypoint defined as the vertex of a part that is farthest in a direction."""

    part: str = Field(description="name of the part")
    corner: Triple = Field(
        description="direction in body axes, scaled by the sides of the part's box:"
        " [1, -1, 1] is its corner at +X -Y +Z"
    )


@dataclass(frozen=True)
class Keypoints:
    """The keypoints, skeleton and symmetries of a spacecraft.

    Attributes:
        points: by name, a position (3,) in metres, body axes, or the corner of a part.
        skeleton: pairs of keypoint names.
        symmetries: rotations (3, 3).
    """

    points: Mapping[str, FloatArray | Corner] = field(default_factory=dict)
    skeleton: tuple[tuple[str, str], ...] = ()
    symmetries: tuple[FloatArray, ...] = ()


class KeypointModel(Options):
    """The keys that a keypoint file may have."""

    keypoints: dict[str, Triple | Corner] = Field(
        min_length=1,
        description="name: [x, y, z] in metres, body axes, or {part: bus, corner: [1, 1, -1]}; names are"
        " T (main body top), B (bottom), A (antenna) or S (solar panel) with a number",
    )
    skeleton: tuple[tuple[str, str], ...] = Field(
        (), description="pairs of keypoint names to draw lines between"
    )
    symmetries: tuple[tuple[Triple, Triple, Triple], ...] = Field(
        (), description="rotations, as rows, that leave the spacecraft's appearance unchanged"
    )

    @field_validator("symmetries")
    @classmethod
    def _rotations(cls, matrices: Any) -> Any:
        for rows in matrices:
            R = np.array(rows)
            if not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0.0:
                raise ValueError("a symmetry must be a rotation matrix")
        return matrices

    @model_validator(mode="after")
    def _known_names(self) -> KeypointModel:
        for pair in self.skeleton:
            for name in pair:
                if name not in self.keypoints:
                    raise ValueError(f"skeleton names {name!r}, which is not a keypoint")
        return self

    def records(self) -> Keypoints:
        """The same as arrays."""
        return Keypoints(
            {
                name: point if isinstance(point, Corner) else np.array(point)
                for name, point in self.keypoints.items()
            },
            self.skeleton,
            tuple(np.array(rows) for rows in self.symmetries),
        )


def read_keypoints(path: Path) -> Keypoints:
    """Read keypoints from YAML or JSON; other keys, as in a dataset's spacecraft record, are ignored.

    Raises:
        InputError: the file is missing or not a keypoint file.
    """
    raw = read_mapping(path)
    known = {key: value for key, value in raw.items() if key in KeypointModel.model_fields}
    return validated(KeypointModel, known, lambda key: f"{path}: {'.'.join(map(str, key))}").records()


def read_mapping(path: Path) -> dict[str, Any]:
    """Read a YAML or JSON file that contains a mapping.

    Raises:
        InputError: the file is missing, or not such a file.
    """
    raw = YamlText.read(path).value
    if not isinstance(raw, dict):
        raise InputError(f"{path}: not a mapping of keys to values")
    return raw


def located(
    points: Mapping[str, FloatArray | Corner], parts: Sequence[Part], path: Path
) -> dict[str, FloatArray]:
    """Positions (3,) of all keypoints, m, body axes.

    Raises:
        InputError: a part does not exist, or a corner has no direction.
    """
    by_name = {part.name: part for part in parts}
    positions_m: dict[str, FloatArray] = {}
    for name, point in points.items():
        if not isinstance(point, Corner):
            positions_m[name] = point
            continue
        if point.part not in by_name:
            hint = nearest(point.part, by_name)
            raise InputError(f"{path}: keypoints.{name}: no part is named {point.part!r}{hint}")
        if not any(point.corner):
            raise InputError(f"{path}: keypoints.{name}.corner: all zero; give it a direction")
        vertices = by_name[point.part].vertices_body_m
        size = np.ptp(vertices, axis=0)
        reach = vertices @ (np.array(point.corner) / np.where(size > 0.0, size, 1.0))
        positions_m[name] = vertices[int(np.argmax(reach))].copy()
    return positions_m
