"""The mesh of a spacecraft in a dataset, stored as a binary PLY file with fixed properties."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.distance import pdist

from posse_core._arrays import FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes

_VERTEX = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8")])
_FACE = np.dtype([("count", "u1"), ("vertices", "<i4", (3,)), ("part_id", "<i2")])
_PLY_HEADER = """ply
format binary_little_endian 1.0
comment body frame, metres, origin at the centre of mass
element vertex {vertices}
property double x
property double y
property double z
element face {faces}
property list uchar int vertex_indices
property short part_id
end_header
"""


@dataclass(frozen=True)
class Mesh:
    """All triangles of a spacecraft, in body axes.

    Attributes:
        vertices_body_m: (V, 3) float64.
        faces: (T, 3) int32 indices of vertices.
        part_id: (T,) int16 index into :attr:`posse_core.SpacecraftInfo.parts`.
    """

    vertices_body_m: FloatArray
    faces: IntArray
    part_id: IntArray

    @cached_property
    def diameter_m(self) -> float:
        """Largest distance between two vertices. ("QJ" makes the hull of a flat mesh possible.)"""
        hull = ConvexHull(self.vertices_body_m, qhull_options="QJ")
        return float(pdist(self.vertices_body_m[hull.vertices]).max())


def write_mesh(mesh: Mesh, path: Path) -> None:
    """Write a mesh as binary PLY with float64 vertices and a ``part_id`` for each face."""
    faces = np.empty(len(mesh.faces), _FACE)
    faces["count"], faces["vertices"], faces["part_id"] = 3, mesh.faces, mesh.part_id
    vertices = np.ascontiguousarray(mesh.vertices_body_m, dtype="<f8")
    header = _PLY_HEADER.format(vertices=len(vertices), faces=len(faces))
    write_bytes(path, header.encode() + vertices.tobytes() + faces.tobytes())


def read_mesh(path: Path) -> Mesh:
    """Read a file that :func:`write_mesh` wrote.

    Raises:
        InputError: The file is missing, incomplete, or written by another program.
    """
    if not path.exists():
        raise InputError(f"{path}: missing; the dataset is incomplete")
    header, mark, body = path.read_bytes().partition(b"end_header\n")
    counts = [int(row.split()[2]) for row in header.splitlines() if row.startswith(b"element ")]
    if (
        len(counts) != 2
        or _PLY_HEADER.format(vertices=counts[0], faces=counts[1]).encode() != header + mark
    ):
        raise InputError(f"{path}: not a mesh file of POSSE")
    split = counts[0] * _VERTEX.itemsize
    if len(body) != split + counts[1] * _FACE.itemsize:
        raise InputError(f"{path}: incomplete")
    faces = np.frombuffer(body[split:], _FACE)
    return Mesh(
        vertices_body_m=np.frombuffer(body[:split], "<f8").reshape(-1, 3).copy(),
        faces=faces["vertices"].astype(np.int32),
        part_id=faces["part_id"].astype(np.int16),
    )
