"""The contents of a mesh file, before units and axes are known."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.sparse import coo_matrix

from posse_core._arrays import AnyArray, Float32Array, FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._files.pictures import decoded_image
from posse_core._model.joint_curve import JointCurve
from posse_core._model.joints import JointKind
from posse_core._model.spacecraft import Material
from posse_core._model.srgb import linear_from_srgb
from posse_core._spacecraft.corners import shared

CREASE_RAD = np.radians(40.0)
"""Adjoining faces of a mesh without normals are shaded as one smooth surface if the angle between their
normals is below this."""


@dataclass(frozen=True)
class RawPart:
    """A part in the file's own units and axes.

    Attributes:
        name: name of the part.
        vertices: (V, 3) float64.
        faces: (T, 3) int32.
        normals: (V, 3) float32 unit vectors.
        uv: (V, 2) float32, v pointing up.
        material: name of its material.
        joint: name of the joint that carries it; None if the body does.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    normals: Float32Array
    uv: Float32Array
    material: str
    joint: str | None = None


@dataclass(frozen=True)
class RawJoint:
    """A joint in the file's own units and axes.

    Attributes:
        name, kind, parent: as in :class:`Joint`.
        origin: (3,) a point on its axis, with every joint at zero.
        axis: (3,) unit vector.
        limits: least and greatest value, rad or units.
        animations: name of an animation of the file → the joint's value over time, rad or units.
    """

    name: str
    kind: JointKind
    origin: FloatArray
    axis: FloatArray
    parent: str | None
    limits: tuple[float, float]
    animations: Mapping[str, JointCurve]


@dataclass(frozen=True)
class RawMesh:
    """All parts of a file, their materials by name, and the joints, each after the one that carries it.

    Parts are where they are with every joint at zero.
    """

    parts: tuple[RawPart, ...]
    materials: Mapping[str, Material]
    joints: tuple[RawJoint, ...] = ()

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lower and upper corner, in the file's units."""
        low = np.min([part.vertices.min(axis=0) for part in self.parts], axis=0)
        high = np.max([part.vertices.max(axis=0) for part in self.parts], axis=0)
        return np.stack([low, high])

    @property
    def surface_centre(self) -> FloatArray:
        """(3,) centroid of the surface, which the thesis' Table 3.2 calls the centre of mass."""
        area_sum, moment = 0.0, np.zeros(3)
        for part in self.parts:
            a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
            area_sum += float(area.sum())
            moment += area @ (a + b + c) / 3.0
        return np.asarray(moment / area_sum)


def raw_part(
    name: str,
    vertices: AnyArray,
    faces: AnyArray,
    normals: AnyArray | None,
    uv: AnyArray | None,
    material: str,
) -> RawPart:
    """Make a part; if the file has no normals, they are computed with :func:`creased_normals`.

    Raises:
        ValueError: the arrays do not fit together, or have numbers that are not finite.
    """
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"{name!r} does not consist of triangles in three dimensions")
    bad = int((~np.isfinite(vertices)).any(axis=1).sum())
    if bad:
        raise ValueError(f"{bad} of {len(vertices)} vertices of {name!r} are NaN or infinite")
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ValueError(f"triangles of {name!r} refer to vertices that do not exist")
    if uv is not None and (np.shape(uv) != (len(vertices), 2) or not np.isfinite(uv).all()):
        raise ValueError(f"the texture coordinates of {name!r} are not one finite pair per vertex")
    if normals is not None and np.shape(normals) != vertices.shape:
        raise ValueError(f"the normals of {name!r} are not one per vertex")
    if normals is None or not np.isfinite(normals).all():
        corners = vertices[faces]
        pairs = np.zeros((len(vertices), 2)) if uv is None else np.asarray(uv)
        uv, normals = pairs[faces].reshape(-1, 2), creased_normals(corners)
        kept, faces = shared(corners.reshape(-1, 3), normals, uv)
        vertices, normals, uv = corners.reshape(-1, 3)[kept], normals[kept], uv[kept]
    else:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.where(length > 0.0, normals, (0.0, 0.0, 1.0)) / np.where(length > 0.0, length, 1.0)
    flat = np.zeros((len(vertices), 2)) if uv is None else uv
    return RawPart(
        name,
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int32),
        np.ascontiguousarray(normals, dtype=np.float32),
        np.ascontiguousarray(flat, dtype=np.float32),
        material,
    )


def creased_normals(corners: FloatArray) -> FloatArray:
    """Shading normals at the corners (T, 3, 3) of triangles → (3 T, 3) unit vectors.

    At each corner the normals of the faces that share its position are averaged, weighted by area. Only
    faces whose normal is within :data:`CREASE_RAD` of the corner's own face are included.
    """
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    own = cross / np.where(area > 0.0, area, 1.0)[:, None]
    own[area == 0.0] = (0.0, 0.0, 1.0)
    _, position = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    position = position.reshape(-1)
    face = np.repeat(np.arange(len(corners)), 3)
    # The pairs (corner, face) that share a position are the entries of a product of incidence matrices.
    at = coo_matrix((np.ones(len(position)), (np.arange(len(position)), position))).tocsr()
    meets = (at @ at.T).tocoo()
    corner, other = meets.row, face[meets.col]
    near = (own[face[corner]] * own[other]).sum(axis=1) > np.cos(CREASE_RAD)
    total = np.zeros((len(position), 3))
    np.add.at(total, corner[near], cross[other[near]])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0.0, total / np.where(length > 0.0, length, 1.0), own[face])


def untextured(material: Material) -> Material:
    """The material with its textures replaced by their mean values, for a part without texture
    coordinates."""
    textures = (
        material.base_color_texture,
        material.metallic_roughness_texture,
        material.normal_texture,
    )
    if all(texture is None for texture in textures):
        return material
    color = np.array(material.base_color)
    metallic, roughness = material.metallic, material.roughness
    if material.base_color_texture is not None:
        color = color * linear_from_srgb(material.base_color_texture / 255.0).mean(axis=(0, 1))
    if material.metallic_roughness_texture is not None:
        mean = material.metallic_roughness_texture.mean(axis=(0, 1)) / 255.0
        metallic, roughness = metallic * float(mean[0]), roughness * float(mean[1])
    red, green, blue = (float(c) for c in color)
    return Material(f"{material.name}_plain", (red, green, blue), metallic, roughness)


def painted(part: RawPart, colors: AnyArray) -> tuple[RawPart, Material]:
    """Colour the faces of a part, with a texture as palette.

    Args:
        part: the part.
        colors: (T, 3) sRGB-coded colours of the faces, 0 … 255.
    """
    each: AnyArray = np.rint(colors).astype(np.uint8)
    if len(np.unique(each, axis=0)) > 4096:
        each = (each & 0xF0) | 8
    palette, index = np.unique(each, axis=0, return_inverse=True)
    side = int(np.ceil(np.sqrt(len(palette))))
    texture = np.zeros((side, side, 3), dtype=np.uint8)
    texture.reshape(-1, 3)[: len(palette)] = palette
    row, column = np.divmod(index.reshape(-1), side)
    center = np.column_stack([(column + 0.5) / side, 1.0 - (row + 0.5) / side])
    corner = part.faces.reshape(-1)
    bare = replace(
        part,
        vertices=part.vertices[corner],
        faces=np.arange(len(corner), dtype=np.int32).reshape(-1, 3),
        normals=part.normals[corner],
        uv=np.repeat(center, 3, axis=0).astype(np.float32),
        material=f"{part.name}_colors",
    )
    return bare, Material(bare.material, roughness=0.6, base_color_texture=texture)


def decoded(data: bytes, path: Path, what: str) -> AnyArray:
    """Decode an image file (PNG, JPEG, WebP, ...) → (H, W, 3) uint8 red, green, blue.

    Raises:
        InputError: the image cannot be decoded.
    """
    image = decoded_image(data, cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: {what} cannot be decoded; re-export it as PNG or JPEG")
    return np.ascontiguousarray(image[..., ::-1])


def decoded_alpha(data: bytes, path: Path, what: str) -> AnyArray | None:
    """Decode the alpha channel of an image file → (H, W) uint8; None if it has none.

    Raises:
        InputError: the image cannot be decoded.
    """
    image = decoded_image(data, cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError(f"{path}: {what} cannot be decoded; re-export it as PNG or JPEG")
    if image.ndim < 3 or image.shape[2] != 4:
        return None
    alpha = image[..., 3]
    return np.ascontiguousarray(alpha if alpha.dtype == np.uint8 else alpha >> 8).astype(np.uint8)


def unique_names(names: Sequence[str]) -> list[str]:
    """Make names of letters, digits and ``_ . -`` that are all different. Other characters become ``_``,
    and a name of which nothing is left becomes ``part_N``."""
    taken: set[str] = set()
    result = []
    for number, name in enumerate(names):
        clean = "".join(c if c.isalnum() or c in "_.-" else "_" for c in name)
        clean = "_".join(word for word in clean.split("_") if word) or f"part_{number}"
        free = itertools.chain([clean], (f"{clean}_{k}" for k in itertools.count(2)))
        chosen = next(candidate for candidate in free if candidate not in taken)
        taken.add(chosen)
        result.append(chosen)
    return result
