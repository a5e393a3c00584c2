"""The node tree of a glTF 2.0 file: where its meshes are, and on which joints they hang."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._frames import matrix_from_quaternion, unit
from posse_core._spacecraft.gltf_animation import (
    JointMotion,
    NodeAnimations,
    NotAJoint,
    joint_motions,
    node_animations,
)
from posse_core._spacecraft.gltf_file import GltfFile
from posse_core._spacecraft.raw import RawJoint, unique_names

_UNEVEN = 1e-4
"""A node scales evenly if its largest and its smallest factor differ by no more than this share."""


@dataclass(frozen=True)
class Node:
    """A node of the scene.

    Attributes:
        name: may be empty.
        mesh: index of its mesh; None without one.
        matrix: (4, 4) from its axes to the scene's, with every joint at zero.
        above: index of its parent; None at a root.
        joint: name of the joint that carries it; None if it does not move.
        fault: its name, and what the animations do to it that no joint does; empty if nothing.
    """

    name: str
    mesh: int | None
    matrix: FloatArray
    above: int | None
    joint: str | None
    fault: str


class Tree(NamedTuple):
    """The nodes of the scene that have a mesh, in order, and the joints, each after its carrier."""

    nodes: tuple[Node, ...]
    joints: tuple[RawJoint, ...]


def read_tree(file: GltfFile) -> Tree:
    """Read the node tree of a file's scene.

    A node that the animations move as no joint does stays where it is without them, with a warning.
    Joints that carry no mesh are left out.
    """
    animations = node_animations(file)
    records = file.header.get("nodes", [])
    # A joint's name is a key of scenarios, where dots separate keys.
    plain = [str(node.get("name", "")).replace(".", "_").lstrip("-") for node in records]
    plain = [name or f"node_{k}" for k, name in enumerate(plain)]
    labels = unique_names([*plain, *(f"{name}_slide" for name in plain)])
    nodes: dict[int, Node] = {}
    joints: dict[str, RawJoint] = {}
    stack: list[tuple[int, int | None]] = [(index, None) for index in reversed(_roots(file))]
    while stack:
        index, above = stack.pop()
        if index in nodes:
            raise InputError(f"{file.path}: the nodes form a loop or share children; export it again")
        record = records[index]
        matrix, carrier = np.eye(4), None
        if above is not None:
            matrix, carrier = nodes[above].matrix, nodes[above].joint
        fault = f"{labels[index]} (skin)" if _is_bent(file, record, animations) else ""
        try:
            motions = _motions(record, animations.get(index), matrix)
            record = {**record, **{motion.path: motion.zero for motion in motions}}
            for motion in motions:
                name = labels[index if motion is motions[-1] else len(records) + index]
                joints[name] = _in_scene(name, motion, matrix, record, carrier)
                carrier = name
        except NotAJoint as error:
            fault = f"{labels[index]} ({error})"
        name, mesh = record.get("name", ""), record.get("mesh")
        nodes[index] = Node(name, mesh, matrix @ _local(record), above, carrier, fault)
        stack.extend((child, index) for child in reversed(record.get("children", [])))
    drawn = tuple(node for node in nodes.values() if node.mesh is not None)
    _warn_of_faults(file, nodes, drawn)
    return Tree(drawn, _carrying(joints, drawn))


def _roots(file: GltfFile) -> list[int]:
    scenes = file.header.get("scenes")
    if not scenes:
        return list(range(len(file.header.get("nodes", []))))
    return list(scenes[file.header.get("scene", 0)].get("nodes", []))


def _local(node: Mapping[str, Any]) -> FloatArray:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix[:3, :3] = matrix_from_quaternion(np.array([w, x, y, z])) * node.get("scale", (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _is_bent(file: GltfFile, node: Mapping[str, Any], animations: Mapping[int, NodeAnimations]) -> bool:
    """Whether the node's mesh hangs on a skin whose bones are animated."""
    if "skin" not in node:
        return False
    return any(bone in animations for bone in file.header["skins"][node["skin"]]["joints"])


def _motions(
    node: Mapping[str, Any], animations: NodeAnimations | None, above: FloatArray
) -> list[JointMotion]:
    """The joints that move a node, the outer one first, in the axes of its parent.

    above: (4, 4) from those axes to the scene's.
    """
    if animations is None:
        return []
    motions = joint_motions(node, animations)
    factors = np.linalg.svd(above[:3, :3], compute_uv=False)
    if motions and not factors[0] <= (1 + _UNEVEN) * factors[2]:
        raise NotAJoint("a motion within a node of uneven scale")
    return motions


def _in_scene(
    name: str, motion: JointMotion, above: FloatArray, node: Mapping[str, Any], carrier: str | None
) -> RawJoint:
    """The joint in the scene's axes and units."""
    turn = above[:3, :3]
    origin = turn @ np.array(node.get("translation", (0.0, 0.0, 0.0))) + above[:3, 3]
    along = turn @ motion.axis
    curves = motion.animations
    if motion.path == "translation":
        factor = float(np.linalg.norm(along))
        curves = {name: curve.scaled(factor) for name, curve in curves.items()}
    elif np.linalg.det(turn) < 0.0:  # a mirror image turns the other way
        along = -along
    extremes = np.array([curve.extremes for curve in curves.values()])
    limits = (float(extremes[:, 0].min()), float(extremes[:, 1].max()))
    if not np.isfinite([*origin, *limits]).all():
        raise ValueError(f"the animations of {name} have numbers that are too large")
    return RawJoint(name, motion.kind, origin, unit(along), carrier, limits, curves)


def _warn_of_faults(file: GltfFile, nodes: Mapping[int, Node], drawn: tuple[Node, ...]) -> None:
    """Warn of the nodes with a fault that carry a mesh."""
    faults: dict[str, None] = {}
    for node in drawn:
        each: Node | None = node
        while each is not None:
            if each.fault:
                faults[each.fault] = None
            each = None if each.above is None else nodes[each.above]
    if faults:
        warnings.warn(
            f"{file.path}: the animations of some nodes are not those of joints, so they stay at rest:"
            f" {', '.join(faults)}",
            stacklevel=2,
        )


def _carrying(joints: Mapping[str, RawJoint], drawn: tuple[Node, ...]) -> tuple[RawJoint, ...]:
    """The joints that carry a mesh, themselves or by other joints."""
    used: set[str] = set()
    for node in drawn:
        name = node.joint
        while name is not None and name not in used:
            used.add(name)
            name = joints[name].parent
    return tuple(joint for name, joint in joints.items() if name in used)
