"""Reading and writing the files of a spacecraft, ``NAME.json`` and ``NAME.ply``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import Field, field_validator, model_validator

from posse_core._arrays import FloatArray
from posse_core._dataset.mesh import Mesh, write_mesh
from posse_core._errors import InputError
from posse_core._files.atomic import write_json
from posse_core._files.reading import FileRecord, read_record
from posse_core._model.joints import Joint, JointKind
from posse_core._model.spacecraft import Spacecraft

_UNIT_LENGTH_ERROR: Final = 1e-9


@dataclass(frozen=True)
class SpacecraftInfo:
    """The names, keypoints, symmetries and joints of a spacecraft; :meth:`posse_core.Dataset.mesh` has
    its mesh, which is where its joints put it when all of them are at zero.

    Attributes:
        name: the class name.
        parts: names of the parts; the id of a part in the labels is its index here.
        keypoints_body_m: name → (3,) metres, body axes, in the order of the labels.
        skeleton: pairs of names of keypoints that drawings connect by lines.
        symmetries: rotations (3, 3) that leave the appearance unchanged, without the identity.
        joints: the joints that move in the dataset, each after the one that carries it.
        part_joints: name of a part → name of the joint that carries it, of those that one carries.
        keypoint_joints: the same of keypoints.
    """

    name: str
    parts: tuple[str, ...]
    keypoints_body_m: Mapping[str, FloatArray]
    skeleton: tuple[tuple[str, str], ...]
    symmetries: tuple[FloatArray, ...]
    joints: tuple[Joint, ...] = ()
    part_joints: Mapping[str, str] = field(default_factory=dict)
    keypoint_joints: Mapping[str, str] = field(default_factory=dict)


def write_spacecraft(spacecraft: Spacecraft, folder: Path) -> None:
    """Write ``NAME.json`` and ``NAME.ply`` (binary, body axes, metres, float64, a part id per face).

    The keys of joints are written only where the spacecraft has some.
    """
    value: dict[str, Any] = {
        "name": spacecraft.name,
        "parts": [part.name for part in spacecraft.parts],
        "keypoints": {k: np.asarray(x).tolist() for k, x in spacecraft.keypoints_body_m.items()},
        "skeleton": [list(pair) for pair in spacecraft.skeleton],
        "symmetries": [np.asarray(R).tolist() for R in spacecraft.symmetries],
    }
    if spacecraft.joints:
        value["joints"] = [_joint_record(joint) for joint in spacecraft.joints]
        value["part_joints"] = {
            part.name: part.joint for part in spacecraft.parts if part.joint is not None
        }
        value["keypoint_joints"] = dict(spacecraft.keypoint_joints)
    write_mesh(mesh_of(spacecraft), folder / f"{spacecraft.name}.ply")
    write_json(folder / f"{spacecraft.name}.json", value)


def mesh_of(spacecraft: Spacecraft) -> Mesh:
    """All parts of a spacecraft as one mesh, with every joint at zero."""
    parts = spacecraft.parts
    first_vertex = np.cumsum([0, *(len(part.vertices_body_m) for part in parts)])
    return Mesh(
        vertices_body_m=np.concatenate([part.vertices_body_m for part in parts]),
        faces=np.concatenate([part.faces + first_vertex[i] for i, part in enumerate(parts)]),
        part_id=np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts]),
    )


def read_spacecraft(path: Path) -> SpacecraftInfo:
    """Read the ``NAME.json`` of :func:`write_spacecraft`.

    Raises:
        InputError: The file is missing or of another kind.
    """
    record = read_record(path, _SpacecraftFile, "a spacecraft file")
    if record.name != path.stem:
        raise InputError(f"{path}: name: is {record.name!r}, and the file is named {path.stem!r}")
    return SpacecraftInfo(
        name=record.name,
        parts=record.parts,
        keypoints_body_m={k: np.array(x) for k, x in record.keypoints.items()},
        skeleton=record.skeleton,
        symmetries=tuple(np.array(R) for R in record.symmetries),
        joints=tuple(joint.joint() for joint in record.joints),
        part_joints=record.part_joints,
        keypoint_joints=record.keypoint_joints,
    )


def read_bodies(folder: Path) -> dict[str, SpacecraftInfo]:
    """Read the spacecraft of the bodies beside the target, by the bodies' names.

    Args:
        folder: with a folder for each body; it need not exist.

    Raises:
        InputError: A body's folder does not have the file of one spacecraft, or it is of another kind.
    """
    bodies = {}
    for body in sorted(path for path in folder.glob("[!.]*") if path.is_dir()):
        files = sorted(body.glob("[!.]*.json"))
        if len(files) != 1:
            raise InputError(
                f"{body}: has {len(files)} files NAME.json; one is needed, of its spacecraft"
            )
        bodies[body.name] = read_spacecraft(files[0])
    return bodies


def _joint_record(joint: Joint) -> dict[str, Any]:
    """A joint for JSON; a limit that is infinite is null."""
    return {
        "name": joint.name,
        "kind": joint.kind,
        "origin_body_m": np.asarray(joint.origin_body_m).tolist(),
        "axis_body": np.asarray(joint.axis_body).tolist(),
        "parent": joint.parent,
        "limits": [float(limit) if np.isfinite(limit) else None for limit in joint.limits],
        "facing_body": None if joint.facing_body is None else np.asarray(joint.facing_body).tolist(),
    }


Vector = tuple[float, float, float]


class _JointFile(FileRecord):
    """A joint of ``NAME.json``; see :class:`posse_core.Joint`."""

    name: str
    kind: JointKind
    origin_body_m: Vector
    axis_body: Vector
    parent: str | None
    limits: tuple[float | None, float | None]
    facing_body: Vector | None

    @field_validator("axis_body", "facing_body")
    @classmethod
    def _has_length_1(cls, axis: Vector | None) -> Vector | None:
        if axis is not None and abs(np.linalg.norm(axis) - 1) > _UNIT_LENGTH_ERROR:
            raise ValueError("should have length 1")
        return axis

    def joint(self) -> Joint:
        least, greatest = self.limits
        return Joint(
            name=self.name,
            kind=self.kind,
            origin_body_m=np.array(self.origin_body_m),
            axis_body=np.array(self.axis_body),
            parent=self.parent,
            limits=(-np.inf if least is None else least, np.inf if greatest is None else greatest),
            facing_body=None if self.facing_body is None else np.array(self.facing_body),
        )


class _SpacecraftFile(FileRecord):
    """The keys of ``NAME.json``; see :class:`SpacecraftInfo`."""

    name: str
    parts: tuple[str, ...]
    keypoints: dict[str, Vector]
    skeleton: tuple[tuple[str, str], ...]
    symmetries: tuple[tuple[Vector, Vector, Vector], ...]
    joints: tuple[_JointFile, ...] = ()
    part_joints: dict[str, str] = Field(default_factory=dict)
    keypoint_joints: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _joints_are_known(self) -> _SpacecraftFile:
        known: set[str] = set()
        for joint in self.joints:
            if joint.name in known:
                raise ValueError(f"two joints are named {joint.name!r}")
            if joint.parent is not None and joint.parent not in known:
                raise ValueError(
                    f"joint {joint.name!r}: no joint before it is its parent {joint.parent!r}"
                )
            known.add(joint.name)
        for kind, carried, things in (
            ("part", self.part_joints, self.parts),
            ("keypoint", self.keypoint_joints, self.keypoints),
        ):
            for name, joint_name in carried.items():
                if name not in things:
                    raise ValueError(f"{kind}_joints: there is no {kind} {name!r}")
                if joint_name not in known:
                    raise ValueError(f"{kind}_joints: there is no joint {joint_name!r}")
        return self
