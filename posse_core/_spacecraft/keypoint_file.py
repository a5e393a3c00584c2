"""Keypoint files: a user's own, the description of a package, or a dataset's spacecraft/NAME.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._model.joints import Joint
from posse_core._model.spacecraft import Part
from posse_core._plugins.options import Options, nearest, validated
from posse_core._scenario.yaml_lines import YamlText
from posse_core._spacecraft.joint_keys import Triple

_REACH = 0.01
"""A keypoint that is given as a position belongs to the nearest part, if that is no farther than this
share of the spacecraft's radius."""


class Corner(Options):
    """A keypoint defined as the vertex of a part that is farthest in a direction."""

    part: str = Field(description="name of the part")
    corner: Triple = Field(
        description="direction in body axes, scaled by the sides of the part's box:"
        " [1, -1, 1] is its corner at +X -Y +Z"
    )


class OnJoint(Options):
    """A keypoint on what a joint carries."""

    at: Triple = Field(description="metres, body axes, with every joint at zero")
    joint: str | None = Field(description="name of the joint that carries it; null is the body")


def _way(value: Any) -> str:
    """The way in which a file gives a keypoint."""
    if isinstance(value, Corner) or (isinstance(value, Mapping) and {"part", "corner"} & value.keys()):
        return "[corner]"
    return "[at]" if isinstance(value, Mapping | OnJoint) else "[position]"


GivenPoint = Annotated[
    Annotated[Triple, Tag("[position]")]
    | Annotated[Corner, Tag("[corner]")]
    | Annotated[OnJoint, Tag("[at]")],
    Discriminator(_way),
]
"""A keypoint in a file: a position, or one of the other ways to give it."""
Point = FloatArray | Corner | OnJoint
"""A keypoint: a position (3,), m, body axes, or one of the other ways to give it."""


@dataclass(frozen=True)
class Keypoints:
    """The keypoints, skeleton and symmetries of a spacecraft.

    Attributes:
        points: by name; positions are measured from :attr:`measured_from_m`.
        skeleton: pairs of keypoint names.
        symmetries: rotations (3, 3).
        measured_from_m: (3,) m, along body axes from the mesh file's origin; None is the centre of mass.
    """

    points: Mapping[str, Point] = field(default_factory=dict)
    skeleton: tuple[tuple[str, str], ...] = ()
    symmetries: tuple[FloatArray, ...] = ()
    measured_from_m: FloatArray | None = None

    def from_centre(self, centre_of_mass_m: FloatArray) -> dict[str, Point]:
        """The points with their positions measured from the centre of mass, which is at (3,) m along
        body axes from the mesh file's origin."""
        if self.measured_from_m is None:
            return dict(self.points)
        shift_m = self.measured_from_m - centre_of_mass_m
        return {name: _shifted(point, shift_m) for name, point in self.points.items()}


def _shifted(point: Point, shift_m: FloatArray) -> Point:
    if isinstance(point, Corner):
        return point
    if isinstance(point, OnJoint):
        x, y, z = np.array(point.at) + shift_m
        return point.model_copy(update={"at": (x, y, z)})
    return point + shift_m


class KeypointModel(Options):
    """The keys that a keypoint file may have."""

    keypoints: dict[str, GivenPoint] = Field(
        min_length=1,
        description="name: [x, y, z] in metres, body axes, {part: bus, corner: [1, 1, -1]}, or"
        " {at: [x, y, z], joint: wing}; names are T (main body top), B (bottom), A (antenna) or S (solar"
        " panel) with a number",
    )
    measured_from_m: Triple | None = Field(
        None,
        description="where positions are measured from, in metres along body axes from the mesh file's"
        " origin; null: the centre of mass",
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
                name: np.array(point) if isinstance(point, tuple) else point
                for name, point in self.keypoints.items()
            },
            self.skeleton,
            tuple(np.array(rows) for rows in self.symmetries),
            None if self.measured_from_m is None else np.array(self.measured_from_m),
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
    points: Mapping[str, Point], parts: Sequence[Part], joints: Sequence[Joint], path: Path
) -> tuple[dict[str, FloatArray], dict[str, str]]:
    """Positions (3,) of all keypoints, m, body axes with every joint at zero, and the joint of each that
    a joint carries.

    The corner of a part is carried by the part's joint. A position belongs to the part whose surface is
    nearest, and to the body if none is near.

    Raises:
        InputError: a part or a joint does not exist, or a corner has no direction.
    """
    by_name = {part.name: part for part in parts}
    known = [joint.name for joint in joints]
    positions_m: dict[str, FloatArray] = {}
    carriers: dict[str, str | None] = {}
    for name, point in points.items():
        where = f"{path}: keypoints.{name}"
        if isinstance(point, Corner):
            if point.part not in by_name:
                hint = nearest(point.part, by_name)
                raise InputError(f"{where}: no part is named {point.part!r}{hint}")
            if not any(point.corner):
                raise InputError(f"{where}.corner: all zero; give it a direction")
            part = by_name[point.part]
            size = np.ptp(part.vertices_body_m, axis=0)
            reach = part.vertices_body_m @ (np.array(point.corner) / np.where(size > 0.0, size, 1.0))
            positions_m[name] = part.vertices_body_m[int(np.argmax(reach))].copy()
            carriers[name] = part.joint
        elif isinstance(point, OnJoint):
            if point.joint is not None and point.joint not in known:
                raise InputError(
                    f"{where}.joint: no joint is named {point.joint!r}{nearest(point.joint, known)}"
                )
            positions_m[name], carriers[name] = np.array(point.at), point.joint
        else:
            positions_m[name] = point
            carriers[name] = carrier_at(point, parts) if joints else None
    return positions_m, {name: joint for name, joint in carriers.items() if joint is not None}


def carrier_at(point_m: FloatArray, parts: Sequence[Part]) -> str | None:
    """Name of the joint that carries the part at a position (3,), m, body axes; None for the body.

    The part is the one whose surface is nearest, the first of several; none if it is farther than
    :data:`_REACH` of the spacecraft's radius.
    """
    import trimesh  # slow to import, and seldom needed

    closest_point: Any = trimesh.triangles.closest_point
    distances_m = []
    for part in parts:
        corners = part.vertices_body_m[part.faces]
        near = closest_point(corners, np.broadcast_to(point_m, (len(corners), 3)))
        distances_m.append(float(np.linalg.norm(near - point_m, axis=1).min()))
    radius_m = max(float(np.linalg.norm(part.vertices_body_m, axis=1).max()) for part in parts)
    first = int(np.argmin(distances_m))
    return parts[first].joint if distances_m[first] <= _REACH * radius_m else None
