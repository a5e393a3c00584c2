"""The mesh of a spacecraft in a dataset, stored as a binary PLY file with fixed properties."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.distance import pdist

from posse_core._arrays import FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._files.reading import read_bytes
from posse_core._model.hull import hull_points

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
_COUNT = r"([0-9]{1,9})"
_HEADER_PATTERN = re.compile(_PLY_HEADER.format(vertices=_COUNT, faces=_COUNT).encode())


@dataclass(frozen=True)
class Mesh:
    """All triangles of a spacecraft, in body axes.

    Attributes:
        vertices_body_m: (V, 3) float64.
        faces: (T, 3) int32 indices of vertices.
        part_id: (T,) int16 index into ``SpacecraftInfo.parts``.
    """

    vertices_body_m: FloatArray
    faces: IntArray
    part_id: IntArray

    @cached_property
    def diameter_m(self) -> float:
        """Largest distance between two vertices."""
        return float(pdist(hull_points(self.vertices_body_m)).max())


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
    header, mark, body = read_bytes(path, missing="missing; the dataset is incomplete").partition(
        b"end_header\n"
    )
    found = re.fullmatch(_HEADER_PATTERN, header + mark)
    if found is None:
        raise InputError(f"{path}: not a mesh file of POSSE")
    vertices, faces = int(found[1]), int(found[2])
    split = vertices * _VERTEX.itemsize
    if len(body) != split + faces * _FACE.itemsize:
        raise InputError(f"{path}: incomplete")
    rows = np.frombuffer(body[split:], _FACE)
    mesh = Mesh(
        vertices_body_m=np.frombuffer(body[:split], "<f8").reshape(-1, 3).copy(),
        faces=rows["vertices"].astype(np.int32),
        part_id=rows["part_id"].astype(np.int16),
    )
    if not np.isfinite(mesh.vertices_body_m).all():
        raise InputError(f"{path}: damaged: a vertex is not finite")
    if not faces or mesh.faces.min() < 0 or mesh.faces.max() >= vertices:
        raise InputError(f"{path}: damaged: a triangle refers to a vertex that does not exist")
    return mesh
