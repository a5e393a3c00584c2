"""A spacecraft from a mesh file, with units and axes as the user gives them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._interfaces.scene import SceneSource
from posse_core._model.joints import Joint
from posse_core._model.spacecraft import Part, Spacecraft
from posse_core._spacecraft.joint_keys import JointKeys, carriers, joints_of
from posse_core._spacecraft.keypoint_file import Keypoints, located, read_keypoints
from posse_core._spacecraft.options import MeshOptions, R_body_from_mesh
from posse_core._spacecraft.raw import RawJoint, RawMesh
from posse_core._spacecraft.reader import read_mesh

SMALLEST_M, LARGEST_M = 0.01, 1000.0
"""Limits of a spacecraft's size; outside them the scale must be wrong."""


class MeshFile(SceneSource[MeshOptions]):
    """The scene source ``mesh``."""

    def build(self) -> Spacecraft:
        options = self.options
        raw = read_mesh(options.mesh)
        keypoints = Keypoints() if options.keypoints is None else read_keypoints(options.keypoints)
        return spacecraft_from_raw(raw, options, options.mesh.stem, keypoints)


def spacecraft_from_raw(
    raw: RawMesh,
    options: MeshOptions,
    name: str,
    keypoints: Keypoints,
    joints_in: Path | None = None,
) -> Spacecraft:
    """Make a spacecraft from a file's mesh: in metres, body axes, with the origin at the centre of mass.

    Args:
        raw: the contents of the file.
        options: how it is scaled and turned, and its joints if they are not the file's.
        name: of the spacecraft.
        keypoints: its keypoints.
        joints_in: the file that gives the options' joints, for messages; None: the mesh file.

    Raises:
        InputError: the scale is missing or implausible, a keypoint is far from the mesh, or the joints
            do not fit one another or the parts.
    """
    scale = stated_scale(raw, options.mesh, options.scale_m_per_unit)
    R = R_body_from_mesh(options.body_axes)
    turn = scale * R
    origin = (
        turn @ raw.surface_centre
        if options.centre_of_mass_m is None
        else np.asarray(options.centre_of_mass_m)
    )
    joints = tuple(_placed(joint, scale, R, origin) for joint in raw.joints)
    part_joints: Mapping[str, str | None] = {part.name: part.joint for part in raw.parts}
    if options.joints is not None:
        joints, part_joints = _given(options.joints, raw, joints, joints_in or options.mesh)
    parts = tuple(
        Part(
            part.name,
            part.vertices @ turn.T - origin,
            part.faces,
            (part.normals @ R.T).astype(np.float32),
            part.uv,
            part.material,
            part_joints.get(part.name),
        )
        for part in raw.parts
    )
    points = keypoints.from_centre(origin)
    points_m, point_joints = located(points, parts, joints, options.keypoints or options.mesh)
    craft = Spacecraft(
        name=name,
        parts=parts,
        materials=raw.materials,
        keypoints_body_m=points_m,
        skeleton=keypoints.skeleton,
        symmetries=keypoints.symmetries,
        joints=joints,
        keypoint_joints=point_joints,
    )
    _check_keypoints(craft, options.keypoints or options.mesh)
    return craft


def _placed(joint: RawJoint, scale: float, R: FloatArray, origin_m: FloatArray) -> Joint:
    """The joint in metres and body axes."""
    factor = scale if joint.kind == "prismatic" else 1.0
    low, high = joint.limits
    curves = joint.animations
    if joint.kind == "prismatic":
        curves = {name: curve.scaled(scale) for name, curve in curves.items()}
    return Joint(
        joint.name,
        joint.kind,
        scale * R @ joint.origin - origin_m,
        R @ joint.axis,
        joint.parent,
        (factor * low, factor * high),
        animations=curves,
    )


def _given(
    keys: Mapping[str, JointKeys], raw: RawMesh, own: Sequence[Joint], path: Path
) -> tuple[tuple[Joint, ...], dict[str, str]]:
    """The joints that a user gives in place of the mesh file's own, and the parts that they carry.

    A joint keeps the animations of the file's joint of the same name and kind.
    """

    def where(key: str) -> str:
        return f"{path}: joints.{key}"

    animations = {(joint.name, joint.kind): joint.animations for joint in own}
    joints = tuple(
        replace(joint, animations=animations.get((joint.name, joint.kind), {}))
        for joint in joints_of(keys, where)
    )
    return joints, carriers(keys, [part.name for part in raw.parts], where)


def stated_scale(raw: RawMesh, path: Path, scale_m_per_unit: float | None) -> float:
    """The scale, after a check that it is given and plausible.

    Raises:
        InputError: it is missing, or gives a spacecraft below a centimetre or above a kilometre.
    """
    extent: FloatArray = np.diff(raw.bounds, axis=0)[0]
    longest = float(extent.max())
    size = " × ".join(f"{length:.4g}" for length in extent)
    if scale_m_per_unit is None:
        raise InputError(
            f"{path}: the unit of the mesh is not given; the mesh measures {size} units. Add"
            f" scale_m_per_unit: 1 if a unit is a metre (a length of {longest:.4g} m), 0.001 if it is a"
            f" millimetre ({longest / 1000.0:.4g} m), or the length in metres / {longest:.6g}"
        )
    if not SMALLEST_M <= longest * scale_m_per_unit <= LARGEST_M:
        raise InputError(
            f"{path}: scale_m_per_unit {scale_m_per_unit:g} gives a length of"
            f" {longest * scale_m_per_unit:.4g} m; the mesh measures {size} units, and a spacecraft is"
            f" {SMALLEST_M:g} … {LARGEST_M:g} m long"
        )
    return scale_m_per_unit


def _check_keypoints(craft: Spacecraft, path: Path) -> None:
    low, high = craft.bounds_body_m
    margin = 0.1 * craft.radius_m
    for name, point in craft.keypoints_body_m.items():
        if np.any(point < low - margin) or np.any(point > high + margin):
            position = ", ".join(f"{value:.4g}" for value in point)
            raise InputError(
                f"{path}: keypoint {name} at [{position}] m from the centre of mass is outside the"
                " spacecraft; keypoints are in metres, body axes, from the centre of mass, or from"
                " measured_from_m, if the file has that key"
            )
