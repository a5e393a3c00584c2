"""The key ``joints`` of a package and of a mesh target: users' own joints."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from pydantic import Field, field_validator, model_validator

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._frames import unit
from posse_core._model.joints import Joint, JointKind
from posse_core._model.spacecraft import Part
from posse_core._plugins.options import Options, nearest

Triple = tuple[float, float, float]
Range = tuple[float, float]
_NAME = re.compile(r"\w[\w-]*")


class JointKeys(Options):
    """A joint, in body axes, metres from the centre of mass (in a package, from ``measured_from_m``), as
    the parts are in the mesh file."""

    kind: JointKind = Field(
        description="revolute turns about the axis, prismatic slides along it, fixed does neither"
    )
    parts: tuple[str, ...] = Field(
        (), description="names of the parts that it carries, or patterns of names such as 'wing_*'"
    )
    origin_m: Triple | None = Field(None, description="a point on the axis; a revolute joint needs it")
    axis: Triple | None = Field(
        None,
        description="direction of the axis, of any length; positive angles turn by the right-hand rule",
    )
    parent: str | None = Field(None, description="the joint that carries this one; null is the body")
    limits_deg: Range | None = Field(None, description="least and greatest angle; null is none")
    limits_m: Range | None = Field(None, description="least and greatest displacement; null is none")
    facing: Triple | None = Field(
        None, description="direction that follows the Sun by the law sun-tracking, as cells face"
    )

    @field_validator("axis", "facing")
    @classmethod
    def _has_direction(cls, vector: Triple | None) -> Triple | None:
        if vector is not None and not any(vector):
            raise ValueError("all zero; give it a direction")
        return vector

    @field_validator("limits_deg", "limits_m")
    @classmethod
    def _in_order(cls, limits: Range | None) -> Range | None:
        if limits is not None and limits[0] > limits[1]:
            raise ValueError("the first limit is above the second; exchange them")
        return limits

    @model_validator(mode="after")
    def _fits_its_kind(self) -> JointKeys:
        needs = {"revolute": ("origin_m", "axis"), "prismatic": ("axis",), "fixed": ()}[self.kind]
        for key in needs:
            if getattr(self, key) is None:
                raise ValueError(f"a {self.kind} joint needs {key}; add it")
        for key, kind in (("limits_deg", "revolute"), ("limits_m", "prismatic")):
            if getattr(self, key) is not None and self.kind != kind:
                raise ValueError(
                    f"{key} is for {kind} joints, and this one is {self.kind}; leave it out"
                )
        return self

    def shifted(self, by_m: FloatArray) -> JointKeys:
        """The joint at another place; ``by_m``: (3,)."""
        if self.origin_m is None:
            return self
        x, y, z = np.array(self.origin_m) + by_m
        return self.model_copy(update={"origin_m": (x, y, z)})

    def record(self, name: str) -> Joint:
        """The joint."""
        limits = (-np.inf, np.inf)
        if self.limits_deg is not None:
            limits = (float(np.radians(self.limits_deg[0])), float(np.radians(self.limits_deg[1])))
        if self.limits_m is not None:
            limits = self.limits_m
        return Joint(
            name,
            self.kind,
            np.array(self.origin_m or (0.0, 0.0, 0.0)),
            unit(np.array(self.axis or (0.0, 0.0, 1.0))),
            self.parent,
            limits,
            None if self.facing is None else unit(np.array(self.facing)),
        )


def joints_of(keys: Mapping[str, JointKeys], where: Callable[[str], str]) -> tuple[Joint, ...]:
    """The joints, each after the one that carries it.

    Args:
        keys: by name.
        where: gives the place of a key for messages, such as ``spacecraft.yaml: joints.wing.parent``.

    Raises:
        InputError: a name cannot be a scenario's key, a parent does not exist, or joints carry each
            other in a circle.
    """
    sorted_names: list[str] = []
    for name in keys:
        if not _NAME.fullmatch(name):
            raise InputError(f"{where(name)}: a joint's name has letters, digits, _ and - only")
        chain: list[str] = []
        above: str | None = name
        while above is not None and above not in sorted_names:
            if above in chain:
                circle = " → ".join((*chain[chain.index(above) :], above))
                raise InputError(f"{where(f'{name}.parent')}: a circle of joints, {circle}; break it")
            chain.append(above)
            parent = keys[above].parent
            if parent is not None and parent not in keys:
                raise InputError(
                    f"{where(f'{above}.parent')}: no joint is named {parent!r}{nearest(parent, keys)}"
                )
            above = parent
        sorted_names += reversed(chain)
    return tuple(keys[name].record(name) for name in sorted_names)


def carriers(
    keys: Mapping[str, JointKeys], parts: Sequence[str], where: Callable[[str], str]
) -> dict[str, str]:
    """Name of a part → name of the joint that carries it, of those that the body does not carry.

    Args:
        keys: by name.
        parts: the names of all parts.
        where: as in :func:`joints_of`.

    Raises:
        InputError: there is no such part, or two joints carry it.
    """
    found: dict[str, str] = {}
    for name, joint in keys.items():
        for pattern in joint.parts:
            members = [part for part in parts if fnmatchcase(part, pattern)]
            if not members:
                raise InputError(
                    f"{where(f'{name}.parts')}: no part is named {pattern!r}{nearest(pattern, parts)}"
                )
            for part in members:
                other = found.setdefault(part, name)
                if other != name:
                    raise InputError(
                        f"{where(f'{name}.parts')}: the part {part!r} is carried by the joint {other!r}"
                        " too; name it once"
                    )
    return found


def written(joint: Joint, parts: Sequence[Part]) -> dict[str, Any]:
    """The keys of a joint, as they are written to a package; positions and directions to 1e-9."""
    keys: dict[str, Any] = {
        "kind": joint.kind,
        "parts": [part.name for part in parts if part.joint == joint.name],
        "origin_m": rounded(joint.origin_body_m),
        "axis": rounded(joint.axis_body),
    }
    if joint.parent is not None:
        keys["parent"] = joint.parent
    if np.isfinite(joint.limits).all():
        turns = joint.kind == "revolute"
        low, high = np.degrees(joint.limits) if turns else joint.limits
        # Outward, so that an animation stays within its own range.
        keys["limits_deg" if turns else "limits_m"] = [
            float(np.floor(low * 1e6) / 1e6),
            float(np.ceil(high * 1e6) / 1e6),
        ]
    if joint.facing_body is not None:
        keys["facing"] = rounded(joint.facing_body)
    return keys


def rounded(vector: FloatArray) -> list[float]:
    """A vector as it is written to a file."""
    return [round(float(x), 9) + 0.0 for x in vector]
