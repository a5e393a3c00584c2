"""Triangle meshes of simple solids, with exact normals and texture coordinates.

Every solid is closed, and its triangles are counter-clockwise seen from outside. Edges between its faces
are hard: the faces share positions there, but no vertices. Texture coordinates are metres along the
surface, so that a repeating texture has the same scale on every part.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import Float32Array, FloatArray, IntArray
from posse_core._frames import R_from_z, R_least, unit


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices_m: (V, 3) float64.
        faces: (T, 3) int32, counter-clockwise seen from outside.
        normals: (V, 3) float32 unit vectors.
        uv: (V, 2) float32 texture coordinates, v pointing up.
    """

    vertices_m: FloatArray
    faces: IntArray
    normals: Float32Array
    uv: Float32Array

    def at(self, position_m: ArrayLike, R: FloatArray | None = None) -> Mesh:
        """The mesh rotated by R (3, 3) and then moved by ``position_m`` (3,)."""
        rotation = np.eye(3) if R is None else R
        return replace(
            self,
            vertices_m=self.vertices_m @ rotation.T + np.asarray(position_m, dtype=np.float64),
            normals=(self.normals @ rotation.T).astype(np.float32),
        )

    def textured(self, scale: ArrayLike, offset: ArrayLike = (0.0, 0.0)) -> Mesh:
        """The mesh with the texture coordinates uv · scale + offset; both are (2,)."""
        return replace(self, uv=(self.uv * np.asarray(scale) + np.asarray(offset)).astype(np.float32))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]).astype(
            np.int32
        ),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.uv for mesh in meshes]),
    )


def _mesh(vertices: ArrayLike, faces: ArrayLike, normals: ArrayLike, uv: ArrayLike) -> Mesh:
    return Mesh(
        np.asarray(vertices, dtype=np.float64),
        np.asarray(faces, dtype=np.int32).reshape(-1, 3),
        np.asarray(normals, dtype=np.float32),
        np.asarray(uv, dtype=np.float32),
    )


def quad(corners_m: ArrayLike) -> Mesh:
    """A flat quadrilateral with the corners (4, 3), counter-clockwise.

    The texture coordinates start at the first corner; for a rectangle they are in metres.
    """
    corners = np.asarray(corners_m, dtype=np.float64)
    across, up = corners[1] - corners[0], corners[3] - corners[0]
    width, height = np.linalg.norm(across), np.linalg.norm(up)
    normal = unit(np.cross(across, up))
    uv = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]) * (width, height)
    return _mesh(corners, [(0, 1, 2), (0, 2, 3)], np.tile(normal, (4, 1)), uv)


def prism(outline_m: ArrayLike, height_m: float) -> Mesh:
    """A prism with the convex outline (N, 2) in x and y, counter-clockwise, from z = −height/2 to
    height/2."""
    outline = np.asarray(outline_m, dtype=np.float64)
    count, half = len(outline), height_m / 2.0
    fan = np.array([(0, i, i + 1) for i in range(1, count - 1)])
    top = np.column_stack([outline, np.full(count, half)])
    bottom = np.column_stack([outline, np.full(count, -half)])
    caps = [
        _mesh(top, fan, np.tile((0.0, 0.0, 1.0), (count, 1)), outline),
        _mesh(bottom, fan[:, ::-1], np.tile((0.0, 0.0, -1.0), (count, 1)), outline * (-1.0, 1.0)),
    ]
    after = np.roll(np.arange(count), -1)
    sides = [quad([bottom[i], bottom[j], top[j], top[i]]) for i, j in enumerate(after)]
    return joined([*caps, *sides])


def box(size_m: ArrayLike) -> Mesh:
    """A cuboid of the size (3,), centred on the origin."""
    x, y, z = np.asarray(size_m, dtype=np.float64)
    outline = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (x / 2.0, y / 2.0)
    return prism(outline, z)


def panel(width_m: float, height_m: float, thickness_m: float) -> Mesh:
    """A flat panel centred on the origin, with its front at +z.

    Its front shows the lower half of a texture once and its back the upper half, for
    :func:`posse_core._spacecraft.textures.solar_panel`. Its edges show the rim of the front.
    """
    x, y, z = width_m / 2.0, height_m / 2.0, thickness_m / 2.0
    front = quad([(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)])
    back = quad([(x, -y, -z), (-x, -y, -z), (-x, y, -z), (x, y, -z)])
    whole = (1.0 / width_m, 0.5 / height_m)
    meshes = [front.textured(whole), back.textured(whole, (0.0, 0.5))]
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        edge = quad([(ax, ay, -z), (bx, by, -z), (bx, by, z), (ax, ay, z)])
        meshes.append(edge.textured((0.4 / max(width_m, height_m), 0.008 / thickness_m), (0.05, 0.001)))
    return joined(meshes)


def hood(size_m: ArrayLike, wall_m: float) -> Mesh:
    """An open box of the size (3,), centred on the origin, with thick walls and without a face at +z."""
    x, y, z = np.asarray(size_m, dtype=np.float64) / 2.0
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    outer, inner = corners * (x, y), corners * (x - wall_m, y - wall_m)

    def ring(points: FloatArray, height: float) -> FloatArray:
        return np.column_stack([points, np.full(4, height)])

    low, high = ring(outer, -z), ring(outer, z)
    floor, edge = ring(inner, -z + wall_m), ring(inner, z)
    faces = [quad(low[[1, 0, 3, 2]]), quad(floor)]
    for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)):
        faces.append(quad([low[i], low[j], high[j], high[i]]))
        faces.append(quad([high[i], high[j], edge[j], edge[i]]))
        faces.append(quad([edge[i], edge[j], floor[j], floor[i]]))
    return joined(faces)


def revolved(profile_m: ArrayLike, segments: int, arc_rad: float = 2.0 * np.pi) -> Mesh:
    """A surface of revolution: the profile (K, 2) of (radius, z) rotated about z, starting at x.

    The outside is to the right of the profile's direction, so a profile that goes up gives a wall that
    faces outward. Each segment of the profile gives a smooth face (a cylinder, a cone or a disc), and
    edges between segments are hard. The solid is closed if the arc is a full turn and the profile is a
    closed loop or begins and ends on the axis.
    """
    profile = np.asarray(profile_m, dtype=np.float64)
    angle = np.linspace(0.0, arc_rad, segments + 1)
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    if arc_rad == 2.0 * np.pi:
        ray[-1] = ray[0]  # so that the seam is closed to the bit
    return joined(
        [
            _leg(start, end, angle, ray)
            for start, end in itertools.pairwise(profile)
            if start[0] > 0.0 or end[0] > 0.0
        ]
    )


def _leg(start: FloatArray, end: FloatArray, angle: FloatArray, ray: FloatArray) -> Mesh:
    """A truncated cone between two points (radius, z), with its normal to the right of start → end."""
    count = len(angle)
    along = end - start
    normal_r, normal_z = unit(np.array([along[1], -along[0]]))
    rings = [np.column_stack([radius * ray, np.full(count, z)]) for radius, z in (start, end)]
    normals = np.column_stack([normal_r * ray, np.full(count, normal_z)])
    if abs(normal_z) == 1.0:  # a disc has a planar texture
        uv = np.concatenate([ring[:, :2] * (normal_z, 1.0) for ring in rings])
    else:
        around = angle * max(start[0], end[0])
        length = np.linalg.norm(along)
        uv = np.concatenate([np.column_stack([around, np.full(count, v)]) for v in (0.0, length)])
    i = np.arange(count - 1)
    faces = []
    if start[0] > 0.0:
        faces.append(np.column_stack([i, i + 1, i + count]))
    if end[0] > 0.0:
        faces.append(np.column_stack([i + 1, i + 1 + count, i + count]))
    return _mesh(np.concatenate(rings), np.concatenate(faces), np.tile(normals, (2, 1)), uv)


def cylinder(radius_m: float, height_m: float, segments: int = 32) -> Mesh:
    """A cylinder about z, from z = 0 to the height."""
    return frustum(radius_m, radius_m, height_m, segments)


def frustum(bottom_m: float, top_m: float, height_m: float, segments: int = 32) -> Mesh:
    """A truncated cone about z, from radius ``bottom_m`` at z = 0 to ``top_m`` at the height."""
    return revolved([(0, 0), (bottom_m, 0), (top_m, height_m), (0, height_m)], segments)


def ring(inner_m: float, outer_m: float, height_m: float, segments: int = 32) -> Mesh:
    """A tube wall about z, from z = 0 to the height."""
    loop = [(inner_m, 0), (outer_m, 0), (outer_m, height_m), (inner_m, height_m), (inner_m, 0)]
    return revolved(loop, segments)


def nozzle(throat_m: float, exit_m: float, length_m: float, wall_m: float, segments: int = 32) -> Mesh:
    """A bell nozzle that opens towards +z, with its closed throat at z = 0."""
    bore = np.array([(exit_m - wall_m, length_m), (throat_m - wall_m, wall_m), (0.0, wall_m)])
    skin = [(0.0, 0.0), (throat_m, 0.0), (exit_m, length_m)]
    return revolved([*skin, *bore], segments)


def tube(path_m: ArrayLike, radius_m: float, segments: int = 10) -> Mesh:
    """A round rod along a path (K, 3), with mitred corners and flat ends.

    From leg to leg the cross-section is rotated by the smallest rotation, so that the rod does not
    twist.
    """
    path = np.asarray(path_m, dtype=np.float64)
    legs = unit(np.diff(path, axis=0))
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    frame = R_from_z(legs[0])
    meshes: list[Mesh] = []
    travelled = 0.0
    end_cut = legs[0]
    for k, leg in enumerate(legs):
        if k:
            frame = R_least(legs[k - 1], leg) @ frame
        start_cut = end_cut
        end_cut = unit(leg + legs[k + 1]) if k + 1 < len(legs) else leg
        spokes = np.outer(np.cos(angle), frame[:, 0]) + np.outer(np.sin(angle), frame[:, 1])
        spokes[-1] = spokes[0]
        ends = []
        for point, cut in ((path[k], start_cut), (path[k + 1], end_cut)):
            slide = -(spokes @ cut) / (leg @ cut)  # along the leg, onto the cutting plane
            ends.append(point + radius_m * (spokes + np.outer(slide, leg)))
        length = float(np.linalg.norm(path[k + 1] - path[k]))
        i, n = np.arange(segments), segments + 1
        faces = np.concatenate(
            [np.column_stack([i, i + 1, i + n]), np.column_stack([i + 1, i + 1 + n, i + n])]
        )
        uv = [(a * radius_m, travelled + v) for v in (0.0, length) for a in angle]
        meshes.append(_mesh(np.concatenate(ends), faces, np.tile(spokes, (2, 1)), uv))
        travelled += length
        if k == 0:
            meshes.append(_cap(ends[0][:-1][::-1], -leg, radius_m))
        if k == len(legs) - 1:
            meshes.append(_cap(ends[1][:-1], leg, radius_m))
    return joined(meshes)


def _cap(rim_m: FloatArray, normal: FloatArray, radius_m: float) -> Mesh:
    count = len(rim_m)
    fan = [(0, i, i + 1) for i in range(1, count - 1)]
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    uv = radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    return _mesh(rim_m, fan, np.tile(normal, (count, 1)), uv)


def dish(
    diameter_m: float,
    focal_m: float,
    offset_m: float = 0.0,
    thickness_m: float = 0.02,
    rings: int = 8,
    segments: int = 48,
) -> Mesh:
    """A paraboloid reflector whose concave side faces +z and whose aperture is a circle seen along z.

    The parent paraboloid z = ((x + offset)² + y²) / (4 focal) − offset² / (4 focal) has its axis at
    x = −offset, so the centre of the aperture is at x = y = z = 0. The back is the same surface,
    ``thickness_m`` lower.
    """
    radius = np.linspace(0.0, diameter_m / 2.0, rings + 1)[1:]
    angle = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    xy = np.concatenate(
        [np.zeros((1, 2)), *(r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in radius)]
    )
    x, y = xy[:, 0] + offset_m, xy[:, 1]
    z = (x**2 + y**2 - offset_m**2) / (4.0 * focal_m)
    normals = unit(np.column_stack([-x, -y, np.full(len(x), 2.0 * focal_m)]))
    i = np.arange(segments)
    j = (i + 1) % segments
    fan = [np.column_stack([np.zeros_like(i), 1 + i, 1 + j])]
    for k in range(rings - 1):
        inner, outer = 1 + k * segments, 1 + (k + 1) * segments
        fan.append(np.column_stack([inner + i, outer + i, outer + j]))
        fan.append(np.column_stack([inner + i, outer + j, inner + j]))
    faces = np.concatenate(fan)
    front = _mesh(np.column_stack([xy, z]), faces, normals, xy)
    back = _mesh(np.column_stack([xy, z - thickness_m]), faces[:, ::-1], -normals, xy * (-1.0, 1.0))
    rim = front.vertices_m[-segments:]
    rim = np.concatenate([rim, rim[:1]])
    turn = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    outward = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(segments + 1)])
    around = turn * diameter_m / 2.0
    n = segments + 1
    wall = _mesh(
        np.concatenate([rim - (0.0, 0.0, thickness_m), rim]),
        np.concatenate([np.column_stack([i, i + 1, i + n]), np.column_stack([i + 1, i + 1 + n, i + n])]),
        np.tile(outward, (2, 1)),
        [(a, v) for v in (0.0, thickness_m) for a in around],
    )
    return joined([front, back, wall])


def curved_panel(
    radius_m: float, height_m: float, arc_rad: float, thickness_m: float, segments: int
) -> Mesh:
    """A panel curved about z, with its outside at the radius, from x through ``arc_rad`` and z = ±
    height/2.

    The texture coordinates of its outer face are metres from its lower corner, with u along the arc.
    """
    inner, half = radius_m - thickness_m, height_m / 2.0
    loop = [(radius_m, -half), (radius_m, half), (inner, half), (inner, -half), (radius_m, -half)]
    ends = []
    for angle, order in ((0.0, (3, 0, 1, 2)), (arc_rad, (0, 3, 2, 1))):
        corners = [(r * np.cos(angle), r * np.sin(angle), z) for r, z in (loop[k] for k in order)]
        ends.append(quad(corners))
    return joined([revolved(loop, segments, arc_rad), *ends])
