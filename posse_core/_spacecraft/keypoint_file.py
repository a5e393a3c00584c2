"""Keypoints in a file: the user's own, or those of a package or a dataset's spacecraft/NAME.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import Field, field_validator, model_validator

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._model.spacecraft import Part
from posse_core._plugins.options import Options, nearest, validated

Triple = tuple[float, float, float]


class Corner(Options):
    """A keypoint picked by name: the vertex of a part that lies farthest in a direction."""

    part: str = Field(description="the part's name")
    corner: Triple = Field(
        description="direction in body axes, in sides of the part's box:"
        " [1, -1, 1] is its corner at +X -Y +Z"
    )


@dataclass(frozen=True)
class Keypoints:
    """What :class:`~posse_core.Spacecraft` holds besides its mesh.

    Attributes:
        places: a point (3,) in metres in the body frame, or a part's corner.
    """

    places: Mapping[str, FloatArray | Corner] = field(default_factory=dict)
    skeleton: tuple[tuple[str, str], ...] = ()
    symmetries: tuple[FloatArray, ...] = ()


class KeypointModel(Options):
    """The keys that a keypoint file may have."""

    keypoints: dict[str, Triple | Corner] = Field(
        min_length=1,
        description="name: [x, y, z] in metres in the body frame, or {part: bus, corner: [1, 1, -1]};"
        " T main body top, B bottom, A antenna, S solar panel, each with a number",
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
            {
                name: place if isinstance(place, Corner) else np.array(place)
                for name, place in self.keypoints.items()
            },
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


def located(
    places: Mapping[str, FloatArray | Corner], parts: Sequence[Part], path: Path
) -> dict[str, FloatArray]:
    """Points (3,) in the body frame for all keypoints.

    Raises:
        InputError: a part that is not there, or a corner without a direction.
    """
    by_name = {part.name: part for part in parts}
    points: dict[str, FloatArray] = {}
    for name, place in places.items():
        if not isinstance(place, Corner):
            points[name] = place
            continue
        if place.part not in by_name:
            hint = nearest(place.part, by_name)
            raise InputError(f"{path}: keypoints.{name}: no part named {place.part!r}{hint}")
        if not any(place.corner):
            raise InputError(f"{path}: keypoints.{name}.corner: all zero; give it a direction")
        vertices = by_name[place.part].vertices_body_m
        size = np.ptp(vertices, axis=0)
        reach = vertices @ (np.array(place.corner) / np.where(size > 0.0, size, 1.0))
        points[name] = vertices[int(np.argmax(reach))].copy()
    return points
