"""How the animations of a glTF 2.0 file move a node, where that is what joints do.

A node that slides along a line moves as by a prismatic joint, one that turns about an axis as by a
revolute one, and one that does both as by a prismatic joint that carries a revolute one.

Source: Khronos glTF 2.0 specification, section 3.11 and appendix C.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._frames import unit
from posse_core._model.joint_curve import JointCurve
from posse_core._model.joints import JointKind
from posse_core._spacecraft.gltf_file import GltfFile, accessed
from posse_core._spacecraft.raw import unique_names

_OFF_AXIS = 1e-4
"""A motion is about one axis (along one line) if it leaves it by no more than this, half the angle in
radians (in shares of the way)."""
_STILL = 1e-6
"""What moves by less than this, likewise in half the angle (in shares of the position), is at rest."""
_REST: Mapping[str, tuple[float, ...]] = {
    "translation": (0.0, 0.0, 0.0),
    "rotation": (0.0, 0.0, 0.0, 1.0),
    "scale": (1.0, 1.0, 1.0),
}
"""What a node's properties are where the file does not say."""


@dataclass(frozen=True)
class _Channel:
    """The keys of one property of a node in one animation.

    Attributes:
        times_s: (K,).
        values: (K, N); quaternions have the scalar last, as in the file.
        rates: (2, K, N) derivatives before and after each key; None unless the interpolation is
            CUBICSPLINE.
        is_step: the interpolation is STEP.
        end_s: end of the animation.
    """

    times_s: FloatArray
    values: FloatArray
    rates: FloatArray | None
    is_step: bool
    end_s: float

    @property
    def reaches(self) -> FloatArray:
        """(M, N) how far the derivatives at the ends of each piece would lead within it."""
        if self.rates is None:
            return np.zeros((0, self.values.shape[1]))
        step_s = np.diff(self.times_s)[:, None]
        return np.concatenate([step_s * self.rates[0, 1:], step_s * self.rates[1, :-1]])

    def curve(self, values: FloatArray, points: AnyArray, rates: AnyArray) -> JointCurve:
        """The joint's curve; ``points`` (K,) and ``rates`` (2, K) are those of a spline."""
        if self.is_step:
            return JointCurve.steps(self.times_s, values, self.end_s)
        if self.rates is None:
            return JointCurve.lines(self.times_s, values, self.end_s)
        return JointCurve.spline(self.times_s, points, rates[0], rates[1], values, self.end_s)


@dataclass(frozen=True)
class NodeAnimations:
    """The channels that move a node: property → name of the animation → its keys.

    Attributes:
        channels: for ``translation``, ``rotation`` and ``scale``.
        unknown: other properties that are animated, such as ``weights``.
    """

    channels: dict[str, dict[str, _Channel]] = field(default_factory=dict)
    unknown: set[str] = field(default_factory=set)


class JointMotion(NamedTuple):
    """How a joint moves a node, in the axes of the node's parent.

    Attributes:
        path: the node's property that the joint changes, ``translation`` or ``rotation``.
        axis: (3,) unit vector.
        zero: (3,) the translation, or (4,) the rotation, scalar last, with the joint at zero.
        animations: name → the joint's value over time, rad or units of the file.
    """

    path: Literal["translation", "rotation"]
    axis: FloatArray
    zero: FloatArray
    animations: Mapping[str, JointCurve]

    @property
    def kind(self) -> JointKind:
        """Sliding or turning."""
        return "prismatic" if self.path == "translation" else "revolute"


class NotAJoint(Exception):
    """A node moves as no joint does; the message names what moves so."""


def node_animations(file: GltfFile) -> dict[int, NodeAnimations]:
    """The animations of a file, by the index of the node that they move."""
    records = file.header.get("animations", [])
    names = unique_names([r.get("name") or f"animation_{k}" for k, r in enumerate(records)])
    nodes: dict[int, NodeAnimations] = {}
    for name, record in zip(names, records, strict=True):
        samplers = record["samplers"]
        times_s = [_times_s(file, sampler["input"]) for sampler in samplers]
        end_s = max((float(times[-1]) for times in times_s), default=0.0)
        for channel in record["channels"]:
            target, number = channel["target"], channel["sampler"]
            if "node" not in target:  # an extension says what is animated
                continue
            node = nodes.setdefault(target["node"], NodeAnimations())
            path = target["path"]
            if path in _REST:
                keys = _channel(file, samplers[number], path, times_s[number], end_s)
                node.channels.setdefault(path, {})[name] = keys
            else:
                node.unknown.add(path)
    return nodes


def _times_s(file: GltfFile, accessor: int) -> FloatArray:
    times_s = accessed(file, accessor)
    if times_s.shape[1] != 1 or not len(times_s) or not (np.diff(times_s[:, 0]) > 0).all():
        raise ValueError("the times of an animation do not increase")
    return times_s[:, 0]


def _channel(
    file: GltfFile, sampler: Mapping[str, Any], path: str, times_s: FloatArray, end_s: float
) -> _Channel:
    kind = sampler.get("interpolation", "LINEAR")
    if kind not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise ValueError(f"an animation has the unknown interpolation {kind!r}")
    output = accessed(file, sampler["output"])
    is_spline = kind == "CUBICSPLINE"
    if output.shape != ((3 if is_spline else 1) * len(times_s), len(_REST[path])):
        raise ValueError(f"an animation's keys of {path} do not fit its times")
    values, rates = output, None
    if is_spline:
        triplets = output.reshape(len(times_s), 3, -1)
        values, rates = triplets[:, 1], np.stack([triplets[:, 0], triplets[:, 2]])
    if path == "rotation" and not (np.linalg.norm(values, axis=1) > 0.5).all():
        raise ValueError("an animation has quaternions that are not of length 1")
    return _Channel(times_s, values, rates, kind == "STEP", end_s)


def joint_motions(node: Mapping[str, Any], moves: NodeAnimations) -> list[JointMotion]:
    """The joints that move a node as its animations do, the outer one first.

    With every joint at zero, a property is as the node itself has it, or, where that is not on the line
    or about the axis of the motion, as at the first key.

    Args:
        node: its record in the file.
        moves: its animations.

    Raises:
        NotAJoint: it moves in another way.
    """
    if moves.unknown:
        raise NotAJoint(min(moves.unknown))
    if "matrix" in node:
        raise NotAJoint("matrix")
    rest = {path: np.array(node.get(path, default)) for path, default in _REST.items()}
    for channel in moves.channels.get("scale", {}).values():
        still = np.allclose(channel.values, rest["scale"], rtol=_STILL, atol=0)
        if not still or np.any(np.abs(channel.reaches) > _STILL):
            raise NotAJoint("scale")
    found = []
    for path, follow in (("translation", _sliding), ("rotation", _turning)):
        channels = moves.channels.get(path)
        motion = None if channels is None else follow(channels, rest[path])
        if motion is not None:
            found.append(motion)
    return found


def _sliding(channels: Mapping[str, _Channel], rest: FloatArray) -> JointMotion | None:
    """The prismatic joint that makes a node's translations; None if they are its own all the time."""
    every = list(channels.values())
    size = max(float(np.abs(channel.values).max()) for channel in every) + float(np.abs(rest).max())
    for zero in (rest, every[0].values[0]):
        steps = np.concatenate([np.r_[channel.values - zero, channel.reaches] for channel in every])
        way = float(np.abs(steps).max())
        if zero is rest and way <= _STILL * size:
            return None
        axis = _axis(steps, _OFF_AXIS * way + _STILL * size)
        if axis is not None:
            break
    else:
        raise NotAJoint("translation along no straight line")
    curves = {}
    for name, channel in channels.items():
        values = (channel.values - zero) @ axis
        rates = values if channel.rates is None else channel.rates @ axis
        curves[name] = channel.curve(values, values, rates)
    return JointMotion("translation", axis, zero, curves)


def _turning(channels: Mapping[str, _Channel], rest: FloatArray) -> JointMotion | None:
    """The revolute joint that makes a node's rotations; None if they are its own all the time."""
    every = list(channels.values())
    for zero in (unit(rest), unit(every[0].values[0])):
        turns = np.concatenate(
            [_from(np.r_[channel.values, channel.reaches], zero) for channel in every]
        )
        if np.array_equal(zero, unit(rest)) and np.abs(turns[:, :3]).max() <= _STILL:
            return None
        axis = _axis(turns[:, :3], _OFF_AXIS)
        if axis is not None:
            break
    else:
        raise NotAJoint("rotation about a varying axis")
    curves = {}
    for name, channel in channels.items():
        points = _about(channel.values, zero, axis)
        rates = points if channel.rates is None else _about(channel.rates, zero, axis)
        curves[name] = channel.curve(_angles(points, channel.rates is None), points, rates)
    return JointMotion("rotation", axis, zero, curves)


def _axis(vectors: FloatArray, tolerance: float) -> FloatArray | None:
    """(3,) the line along which all vectors (M, 3) are, its largest component positive; None if a vector
    leaves it by more than the tolerance."""
    axis = np.linalg.svd(vectors, full_matrices=False)[2][0]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    across = vectors - (vectors @ axis)[:, None] * axis
    return axis if np.linalg.norm(across, axis=1).max() <= tolerance else None


def _from(q: FloatArray, zero: FloatArray) -> FloatArray:
    """(..., 4) the product of quaternions (..., 4) with the inverse of a unit one, scalar last: the
    turn from it to each of them, in the axes of the node's parent."""
    v, w, v0, w0 = q[..., :3], q[..., 3:], -zero[:3], zero[3]
    scalar = w * w0 - (v @ v0)[..., None]
    return np.concatenate([w * v0 + w0 * v + np.cross(v, v0), scalar], axis=-1)


def _about(q: FloatArray, zero: FloatArray, axis: FloatArray) -> AnyArray:
    """(...) complex: the turns from ``zero`` to quaternions (..., 4), whose argument is half the
    angle about the axis."""
    turns = _from(q, zero)
    return np.asarray(turns[..., 3] + 1j * (turns[..., :3] @ axis))


def _angles(points: AnyArray, shortest: bool) -> FloatArray:
    """(K,) angles, rad, of complex points; each is reached from the one before without a jump.

    shortest: on the shorter way, as spherical linear interpolation goes.
    """
    turns = points[1:] * points[:-1].conj()
    if shortest:
        turns = np.where(turns.real < 0, -turns, turns)
    start = points[:1] if points[0].real >= 0 else -points[:1]
    return np.asarray(np.cumsum(2 * np.angle(np.r_[start, turns])))
