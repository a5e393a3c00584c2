"""Animated glTF 2.0 files made from nothing, and where the specification puts their nodes."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

IDENTITY = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@dataclass(frozen=True)
class Channel:
    """Keys of one property of a node; the values of a CUBICSPLINE are (K, 3, N): in-tangent, value,
    out-tangent."""

    animation: str
    node: int
    path: str
    times_s: np.ndarray
    values: np.ndarray
    interpolation: str


@dataclass
class AnimatedScene:
    """A scene graph with animations. Numbers are rounded to single precision, as the file has them."""

    nodes: list[dict] = field(default_factory=list)
    parents: list[int | None] = field(default_factory=list)
    meshes: list[trimesh.Trimesh] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)

    def add(
        self,
        name: str,
        parent: int | None = None,
        mesh: trimesh.Trimesh | None = None,
        **local: Sequence[float],
    ) -> int:
        """Add a node, with its translation, rotation (scalar last) and scale; returns its index."""
        node: dict = {"name": name, **{key: [float(x) for x in value] for key, value in local.items()}}
        if mesh is not None:
            node["mesh"] = len(self.meshes)
            self.meshes.append(mesh)
        self.nodes.append(node)
        self.parents.append(parent)
        index = len(self.nodes) - 1
        if parent is not None:
            self.nodes[parent].setdefault("children", []).append(index)
        return index

    def animate(
        self, node: int, path: str, times_s, values, interpolation="LINEAR", animation="move"
    ) -> None:
        """Add a channel."""
        keys = np.asarray(values, dtype="<f4").astype(float)
        times = np.asarray(times_s, dtype="<f4").astype(float)
        self.channels.append(Channel(animation, node, path, times, keys, interpolation))

    def matrix(self, node: int, t_s: float | None, animation="move") -> np.ndarray:
        """(4, 4) from the node's axes to the scene's at a time of an animation; at rest for None."""
        own = {**IDENTITY, **self.nodes[node]}
        for channel in self.channels:
            if t_s is not None and (channel.animation, channel.node) == (animation, node):
                own[channel.path] = value_at(channel, t_s)
        local = np.eye(4)
        local[:3, :3] = Rotation.from_quat(own["rotation"]).as_matrix() @ np.diag(own["scale"])
        local[:3, 3] = own["translation"]
        parent = self.parents[node]
        return local if parent is None else self.matrix(parent, t_s, animation) @ local

    def vertices(self, node: int, t_s: float | None, animation="move") -> np.ndarray:
        """(V, 3) the node's mesh in the scene's axes."""
        points = np.asarray(self.meshes[self.nodes[node]["mesh"]].vertices).astype("<f4").astype(float)
        matrix = self.matrix(node, t_s, animation)
        return points @ matrix[:3, :3].T + matrix[:3, 3]

    def write(self, path: Path, change: Callable[[dict], object] = lambda header: None) -> Path:
        """Write a .glb file, with a change of its JSON."""
        chunk, views, accessors = bytearray(), [], []

        def store(values: np.ndarray, dtype: str, kind: str) -> int:
            data = np.ascontiguousarray(values, dtype=dtype)
            views.append({"buffer": 0, "byteOffset": len(chunk), "byteLength": data.nbytes})
            record = {"bufferView": len(views) - 1, "count": len(data), "type": kind}
            record["componentType"] = {"<f4": 5126, "<u4": 5125}[dtype]
            if kind in ("VEC3", "SCALAR") and dtype == "<f4":
                record["min"] = np.atleast_1d(data.min(axis=0)).tolist()
                record["max"] = np.atleast_1d(data.max(axis=0)).tolist()
            accessors.append(record)
            chunk.extend(data.tobytes())
            return len(accessors) - 1

        meshes = [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": store(mesh.vertices, "<f4", "VEC3")},
                        "indices": store(mesh.faces.reshape(-1), "<u4", "SCALAR"),
                    }
                ]
            }
            for mesh in self.meshes
        ]
        animations: dict[str, dict] = {}
        for channel in self.channels:
            record = animations.setdefault(
                channel.animation, {"name": channel.animation, "samplers": [], "channels": []}
            )
            width = channel.values.shape[-1]
            record["channels"].append(
                {
                    "sampler": len(record["samplers"]),
                    "target": {"node": channel.node, "path": channel.path},
                }
            )
            record["samplers"].append(
                {
                    "input": store(channel.times_s, "<f4", "SCALAR"),
                    "output": store(channel.values.reshape(-1, width), "<f4", f"VEC{width}"),
                    "interpolation": channel.interpolation,
                }
            )
        header = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [k for k, parent in enumerate(self.parents) if parent is None]}],
            "nodes": self.nodes,
            "meshes": meshes,
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{"byteLength": len(chunk)}],
            **({"animations": list(animations.values())} if animations else {}),
        }
        change(header)
        text = json.dumps(header).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text
        body += struct.pack("<II", len(chunk), 0x004E4942) + chunk
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
        return path


def value_at(channel: Channel, t_s: float) -> np.ndarray:
    """The value of a channel at a time; glTF 2.0 specification, appendix C."""
    times_s, is_spline = channel.times_s, channel.interpolation == "CUBICSPLINE"
    values = channel.values[:, 1] if is_spline else channel.values
    if t_s < times_s[0] or t_s >= times_s[-1]:
        found = values[0 if t_s < times_s[0] else -1]
    else:
        k = max(i for i, time_s in enumerate(times_s) if time_s <= t_s)
        step_s = times_s[k + 1] - times_s[k]
        s = (t_s - times_s[k]) / step_s
        if channel.interpolation == "STEP":
            found = values[k]
        elif is_spline:
            found = (
                (2 * s**3 - 3 * s**2 + 1) * values[k]
                + step_s * (s**3 - 2 * s**2 + s) * channel.values[k, 2]
                + (-2 * s**3 + 3 * s**2) * values[k + 1]
                + step_s * (s**3 - s**2) * channel.values[k + 1, 0]
            )
        elif channel.path == "rotation":
            cosine = values[k] @ values[k + 1]
            angle = np.arccos(min(abs(cosine), 1.0))
            if angle < 1e-9:
                found = values[k]
            else:
                found = (
                    np.sin(angle * (1 - s)) * values[k]
                    + np.copysign(np.sin(angle * s), cosine) * values[k + 1]
                ) / np.sin(angle)
        else:
            found = (1 - s) * values[k] + s * values[k + 1]
    return found / np.linalg.norm(found) if channel.path == "rotation" else found


def quaternion(axis: Sequence[float], angle_deg: float) -> np.ndarray:
    """(4,) scalar last."""
    axis = np.asarray(axis, dtype=float)
    return Rotation.from_rotvec(np.radians(angle_deg) * axis / np.linalg.norm(axis)).as_quat()


def turning(
    axis: Sequence[float], angles_deg: Sequence[float], rest: Sequence[float] = (0, 0, 0, 1)
) -> np.ndarray:
    """(K, 4) rotations, scalar last, about an axis of the node's parent, each from the rest pose."""
    turns = [Rotation.from_quat(quaternion(axis, angle)) for angle in angles_deg]
    return np.array([(turn * Rotation.from_quat(rest)).as_quat() for turn in turns])
