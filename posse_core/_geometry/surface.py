"""The material and the shading normal at points of the bodies' surfaces, with their textures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._frames import unit
from posse_core._geometry.triangles import cross, dot
from posse_core._model.scene import Piece
from posse_core._model.spacecraft import Material
from posse_core._model.srgb import linear_from_srgb

_LINEAR = np.arange(256) / 255
_LINEAR_FROM_SRGB = linear_from_srgb(_LINEAR)
_SIGNED = 2 * _LINEAR - 1


@dataclass(frozen=True)
class SurfaceMaterial:
    """The glTF metallic-roughness material at N points: factors times textures; NaN where there is no
    surface.

    Attributes:
        base_color: (N, 3) linear reflectance in red, green, blue, 0 … 1.
        metallic, roughness, specular: (N,) 0 … 1, as in :class:`posse_core.Material`.
    """

    base_color: FloatArray
    metallic: FloatArray
    roughness: FloatArray
    specular: FloatArray


class Surface:
    """The materials of the triangles of a scene's pieces."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        parts = [piece.part for piece in pieces]
        corners_m = np.concatenate([part.vertices_body_m[part.faces] for part in parts])
        self._a_m, b_m, c_m = (corners_m[:, corner].T.copy() for corner in range(3))
        self._ab_m, self._ac_m = b_m - self._a_m, c_m - self._a_m
        self._across_m2 = cross(self._ab_m, self._ac_m)
        self._uv = np.concatenate([part.uv[part.faces].astype(np.float64) for part in parts])
        self._normals = np.concatenate(
            [part.normals_body[part.faces].astype(np.float64) for part in parts]
        )
        self._materials = [piece.material for piece in pieces]
        self._piece = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])

    def at(
        self,
        triangle: IntArray,
        point_body_m: FloatArray,
        materials: Sequence[Material] | None = None,
    ) -> SurfaceMaterial:
        """The material at points.

        Textures are sampled as the renderers do: row 0 is at v = 1, they repeat, and values between the
        centres of texels are interpolated bilinearly, colours after their sRGB codes are decoded.

        Args:
            triangle: (N,) as in :class:`posse_core.RayHits`; −1 for no surface.
            point_body_m: (N, 3) point on each triangle, in the axes of its link.
            materials: of the pieces in a frame, by :meth:`posse_core.Scene.materials`; None for their
                own.
        """
        count = len(triangle)
        base_color = np.full((count, 3), np.nan)
        metallic, roughness, specular = np.full((3, count), np.nan)
        for material, rows, uv in self._by_material(triangle, point_body_m, materials):
            base_color[rows] = _base_color(material, uv)
            metallic[rows], roughness[rows] = _metallic_and_roughness(material, uv).T
            specular[rows] = material.specular
        return SurfaceMaterial(base_color, metallic, roughness, specular)

    def base_color(
        self, triangle: IntArray, point_body_m: FloatArray, materials: Sequence[Material]
    ) -> FloatArray:
        """(N, 3) the ``base_color`` of :meth:`at`, alone."""
        base_color = np.full((len(triangle), 3), np.nan)
        for material, rows, uv in self._by_material(triangle, point_body_m, materials):
            base_color[rows] = _base_color(material, uv)
        return base_color

    def _by_material(
        self, triangle: IntArray, point_body_m: FloatArray, materials: Sequence[Material] | None
    ) -> Iterator[tuple[Material, IntArray, FloatArray]]:
        """Each material, the (n,) indices of its points and their (n, 2) texture coordinates."""
        materials = self._materials if materials is None else materials
        on = np.flatnonzero(triangle >= 0)
        triangle = triangle[on]
        uv = _between(self._weights(triangle, point_body_m[on]), self._uv[triangle])
        # Pieces of one material are sampled together.
        alike = list({id(material): material for material in materials}.values())
        number = {id(material): k for k, material in enumerate(alike)}
        used = np.array([number[id(material)] for material in materials])[self._piece[triangle]]
        for index in np.unique(used):
            own = np.flatnonzero(used == index)
            yield alike[index], on[own], uv[own]

    def normals(self, triangle: IntArray, point_body_m: FloatArray) -> FloatArray:
        """(N, 3) unit shading normals in the axes of each point's link, on the side of the parts' own
        normals; NaN where there is no surface.

        They are interpolated between the corners, and follow the material's normal texture where the
        part has texture coordinates. The arguments are as in :meth:`at`.
        """
        normals = np.full((len(triangle), 3), np.nan)
        on = np.flatnonzero(triangle >= 0)
        weights = self._weights(triangle[on], point_body_m[on])
        smooth = unit(_between(weights, self._normals[triangle[on]]))
        uv = _between(weights, self._uv[triangle[on]])
        for index in np.unique(self._piece[triangle[on]]):
            texture = self._materials[index].normal_texture
            rows = np.flatnonzero(self._piece[triangle[on]] == index)
            if texture is not None:
                tilt = _sampled(texture, _SIGNED, uv[rows])
                along_u, along_v, known = self._tangents(triangle[on][rows], smooth[rows])
                mapped = tilt[:, :1] * along_u + tilt[:, 1:2] * along_v + tilt[:, 2:] * smooth[rows]
                smooth[rows[known]] = unit(mapped[known])
        normals[on] = smooth
        return normals

    def _weights(self, triangle: IntArray, point_body_m: FloatArray) -> FloatArray:
        """(n, 3) barycentric coordinates of points on triangles."""
        a_m, ab_m, ac_m, across_m2 = (
            np.take(of_all, triangle, axis=1)
            for of_all in (self._a_m, self._ab_m, self._ac_m, self._across_m2)
        )
        ap_m = point_body_m.T - a_m
        square_m4 = dot(across_m2, across_m2)
        weight_b = dot(cross(ap_m, ac_m), across_m2) / square_m4
        weight_c = dot(cross(ab_m, ap_m), across_m2) / square_m4
        return np.stack([1 - weight_b - weight_c, weight_b, weight_c], axis=-1)

    def _tangents(
        self, triangle: IntArray, normal: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Unit vectors (n, 3) across the normals along which u and v grow, and whether they are defined
        (n,)."""
        ab_m, ac_m = self._ab_m[:, triangle].T, self._ac_m[:, triangle].T
        from_b, from_c = np.moveaxis(self._uv[triangle][:, 1:] - self._uv[triangle][:, :1], 1, 0)
        det = from_b[:, 0] * from_c[:, 1] - from_b[:, 1] * from_c[:, 0]
        side = np.sign(det)[:, None]
        along_u = side * (ab_m * from_c[:, 1:] - ac_m * from_b[:, 1:])
        along_v = side * (ac_m * from_b[:, :1] - ab_m * from_c[:, :1])
        across = [d - normal * np.sum(d * normal, axis=-1, keepdims=True) for d in (along_u, along_v)]
        length = [np.linalg.norm(d, axis=-1, keepdims=True) for d in across]
        known = (det != 0) & (length[0] > 0)[:, 0] & (length[1] > 0)[:, 0]
        along_u, along_v = (d / np.where(s > 0, s, 1.0) for d, s in zip(across, length, strict=True))
        return along_u, along_v, known


def _between(weights: FloatArray, corners: FloatArray) -> FloatArray:
    """Interpolate values (n, 3 corners, c) by barycentric coordinates (n, 3) → (n, c)."""
    a, b, c = (weights[:, corner, None] * corners[:, corner] for corner in range(3))
    return np.asarray(a + b + c)


def _base_color(material: Material, uv: FloatArray) -> FloatArray:
    """(n, 3) at texture coordinates (n, 2)."""
    color = np.array([material.base_color])
    if material.base_color_texture is not None:
        color = color * _sampled(material.base_color_texture, _LINEAR_FROM_SRGB, uv)
    return np.broadcast_to(color, (len(uv), 3))


def _metallic_and_roughness(material: Material, uv: FloatArray) -> FloatArray:
    """(n, 2) at texture coordinates (n, 2)."""
    both = np.array([[material.metallic, material.roughness]])
    if material.metallic_roughness_texture is not None:
        both = both * _sampled(material.metallic_roughness_texture, _LINEAR, uv)
    return np.broadcast_to(both, (len(uv), 2))


def _sampled(texture: AnyArray, value: FloatArray, uv: FloatArray) -> FloatArray:
    """A texture (h, w, c) of codes with the given ``value`` (256,) each, at (n, 2) → (n, c)."""
    height, width, channels = texture.shape
    x, y = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    column, row = np.floor(x), np.floor(y)
    right, below = x - column, y - row
    columns = [(column.astype(np.int64) + across) % width for across in (0, 1)]
    rows = [(row.astype(np.int64) + down) % height * width for down in (0, 1)]
    texels = texture.reshape(-1, channels)
    # (c, n) arrays, along whose rows NumPy computes quickly.
    (a, b), (c, d) = (
        [np.take(value, np.take(texels, down + across, axis=0).T) for across in columns] for down in rows
    )
    above_mean = a * (1 - right) + b * right
    below_mean = c * (1 - right) + d * right
    return np.asarray((above_mean * (1 - below) + below_mean * below).T)
