"""The materials of a scene for the compiled variants, one of which must be set before this module is
imported: tables from which each ray gathers what its surface is like.

Mitsuba's own BSDFs are called one after another, while the rays of a packet that hit other materials
wait, and a kernel with all of their code takes long to compile. What the tables hold are inputs of the
kernel: materials that vary from frame to frame need no other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from posse_core import AnyArray, CraftState, Material, Scene, linear_from_srgb
from posse_render_mitsuba.craft import Shapes
from posse_render_mitsuba.surfaces import Surface

LEAST_ALPHA = 1e-4
"""The least α = roughness² of a surface."""
FACTORS = 8
"""Numbers per material: base colour, specular, metallic, roughness, 1 if it has a normal map or else 0,
and one that is not used."""
CODES = (slice(0, 3), slice(3, 5), slice(5, 8))
"""Which of the eight bytes of a texel are the codes of the base colour, of metallic and roughness, and
of the normal. They are 255 where there is no such texture."""


@dataclass
class Table:
    """What the kernel reads of the materials.

    Attributes:
        of_shape: index of the material of each shape, by the shape's number in Mitsuba's registry.
        factors: :data:`FACTORS` numbers per material.
        textures: per material and one of :data:`CODES` four numbers: first texel, height, width, 0.
        texels: two integers per texel: its eight bytes, the lowest first. The first row of a texture is
            at v = 0.
        is_of_one_size: whether the textures of each material are of one size, so that their codes are in
            the same texels.
        linear: the 256 shares of white for which the codes of the base colour stand.
    """

    of_shape: mi.UInt32
    factors: mi.Float
    textures: mi.UInt32
    texels: mi.UInt32
    is_of_one_size: bool
    linear: mi.Float

    def surface(self, hit: Any, active: Any) -> Surface:
        """What the surface is like that rays hit."""
        shape: Any = dr.reinterpret_array(mi.UInt32, hit.shape)
        index: Any = dr.gather(mi.UInt32, self.of_shape, shape, active)
        red, green, blue, specular = dr.gather(mi.Vector4f, self.factors, 2 * index, active)
        metallic, roughness, has_normals, _ = dr.gather(mi.Vector4f, self.factors, 2 * index + 1, active)
        color, shares, normal = self._looked_up(index, 0, hit.uv, active)
        if not self.is_of_one_size:
            _, shares, _ = self._looked_up(index, 1, hit.uv, active)
            _, _, normal = self._looked_up(index, 2, hit.uv, active)
        return Surface(
            wi=hit.wi,
            color=mi.Color3f(red, green, blue) * color,
            specular=specular,
            metallic=metallic * shares.x,
            alpha=dr.maximum(dr.square(roughness * shares.y), LEAST_ALPHA),
            normal=dr.lerp(mi.Vector3f(0, 0, 1), 2 * normal - 1, has_normals),
        )

    def _looked_up(self, index: Any, kind: int, uv: Any, active: Any) -> tuple[Any, Any, Any]:
        """The base colour, the shares of metallic and roughness, and (n + 1)/2 of the normal n, by the
        texels in which one of :data:`CODES` of material ``index`` is. A texture repeats, and is linear
        between four texels."""
        start, height, width, _ = dr.gather(
            mi.Vector4u, self.textures, len(CODES) * index + kind, active
        )
        x, left, right = _between(uv.x, width)
        y, low, high = _between(uv.y, height)

        def texel(row: Any, column: Any) -> list[Any]:
            words = dr.gather(mi.Vector2u, self.texels, start + row * width + column, active)
            codes = [(word >> shift) & 255 for word in words for shift in (0, 8, 16, 24)]
            color = [dr.gather(mi.Float, self.linear, code, active) for code in codes[CODES[0]]]
            return color + [mi.Float(code) * (1 / 255) for code in codes[CODES[0].stop :]]

        lower, upper = (
            [dr.lerp(*pair, x) for pair in zip(texel(row, left), texel(row, right), strict=True)]
            for row in (low, high)
        )
        found = [dr.lerp(*pair, y) for pair in zip(lower, upper, strict=True)]
        color, shares, normal = (found[codes] for codes in CODES)
        return mi.Color3f(*color), mi.Vector2f(*shares), mi.Vector3f(*normal)


def _between(coordinate: Any, count: Any) -> tuple[Any, Any, Any]:
    """Between which two of ``count`` texels a texture coordinate is: the share of the second, and the
    numbers of both."""
    place = (coordinate - dr.floor(coordinate)) * mi.Float(count) - 0.5
    first = mi.Int32(dr.floor(place))
    last = mi.Int32(count) - 1
    second = dr.select(first >= last, 0, first + 1)
    share = place - mi.Float(first)
    return share, mi.UInt32(dr.select(first < 0, last, first)), mi.UInt32(second)


class Materials:
    """The materials of a scene.

    Attributes:
        table: what the kernel reads.
    """

    def __init__(self, scene: Scene, shapes: Shapes) -> None:
        """The shapes are those of the scene's pieces."""
        self._scene = scene
        self._pieces = [index for _, index in shapes.meshes]
        self._blocks: dict[
            tuple[int, ...], tuple[tuple[AnyArray | None, ...], tuple[int, int, int]]
        ] = {}
        self._texels: list[AnyArray] = []
        materials = [scene.pieces[index].material for index in self._pieces]
        looks = [
            replace(material, base_color_texture=texture)
            for material in materials
            for texture in (material.base_color_texture, *material.patterns)
        ]
        self._is_of_one_size = all(_is_of_one_size(_textures(look)) for look in looks)
        # The textures of all patterns are stored now, since the kernel's texels stay as they are.
        self._rows(looks)
        pointers: Any = [dr.reinterpret_array(mi.UInt32, mi.ShapePtr(mesh)) for mesh, _ in shapes.meshes]
        numbers = [int(pointer[0]) for pointer in pointers]
        of_shape = np.zeros(max(numbers, default=0) + 1, dtype=np.uint32)
        of_shape[numbers] = np.arange(len(numbers))
        factors, textures = self._rows(materials)
        texels = mi.UInt32(np.concatenate(self._texels).view("<u4").ravel())
        linear = mi.Float(linear_from_srgb(np.arange(256) / 255))
        self.table = Table(mi.UInt32(of_shape), factors, textures, texels, self._is_of_one_size, linear)
        dr.make_opaque(self.table)

    def set(self, craft: CraftState) -> None:
        """Give the materials that vary the factors and patterns of a frame."""
        materials = self._scene.materials(craft)
        self.table.factors, self.table.textures = self._rows([materials[i] for i in self._pieces])
        dr.make_opaque(self.table)

    def _rows(self, materials: Sequence[Material]) -> tuple[mi.Float, mi.UInt32]:
        """Factors and textures of the table. Textures that are not stored yet are stored."""
        factors = np.zeros((len(materials), FACTORS), dtype=np.float32)
        textures = np.zeros((len(materials), len(CODES), 4), dtype=np.uint32)
        for i, material in enumerate(materials):
            own = (*material.base_color, material.specular, material.metallic, material.roughness)
            factors[i, :7] = (*own, float(material.normal_texture is not None))
            kinds = _textures(material)
            for k in range(len(CODES)):
                together = kinds if self._is_of_one_size else _alone(kinds, k)
                textures[i, k, :3] = self._block(together)
        return mi.Float(factors.ravel()), mi.UInt32(textures.ravel())

    def _block(self, textures: tuple[AnyArray | None, ...]) -> tuple[int, int, int]:
        """First texel, height and width of textures of one size; they are stored if they are not yet."""
        key = tuple(id(texture) for texture in textures)
        if key not in self._blocks:
            height, width = next((t.shape[:2] for t in textures if t is not None), (1, 1))
            codes = np.full((height, width, CODES[-1].stop), 255, dtype=np.uint8)
            for texture, places in zip(textures, CODES, strict=True):
                if texture is not None:
                    codes[..., places] = texture[::-1]
            start = sum(len(block) for block in self._texels)
            self._texels.append(codes.reshape(-1, CODES[-1].stop))
            self._blocks[key] = textures, (start, height, width)
        return self._blocks[key][1]


def _textures(material: Material) -> tuple[AnyArray | None, ...]:
    """Those of each of :data:`CODES`."""
    return (
        material.base_color_texture,
        material.metallic_roughness_texture,
        material.normal_texture,
    )


def _alone(textures: tuple[AnyArray | None, ...], kind: int) -> tuple[AnyArray | None, ...]:
    """One of several textures, without the others."""
    return tuple(texture if k == kind else None for k, texture in enumerate(textures))


def _is_of_one_size(textures: tuple[AnyArray | None, ...]) -> bool:
    return len({texture.shape[:2] for texture in textures if texture is not None}) < 2
