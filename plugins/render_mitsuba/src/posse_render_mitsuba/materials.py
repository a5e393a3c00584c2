"""The materials of a scene for the compiled variants, one of which must be set before this module is
imported: tables from which each ray gathers what its surface is like.

Mitsuba's own BSDFs are called one after another, while the rays of a packet that hit other materials
wait, and a kernel with all of their code takes long to compile. What the tables hold are inputs of the
kernel: materials that vary from frame to frame need no other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import mitsuba as mi
import numpy as np

from posse_core import AnyArray, CraftState, IntArray, Material, Scene, linear_from_srgb
from posse_render_mitsuba.craft import Shapes
from posse_render_mitsuba.surfaces import Surface

LEAST_ALPHA = 1e-4
"""The least α = roughness² of a surface."""
FACTORS = 8
"""Numbers per material: base colour, specular, metallic, roughness, and two that are not used."""
FULL = 65535
"""The code of 1 in a texel. Each has three values of 16 bits in two integers."""

_Kind = Literal["base colour", "metallic and roughness", "normals"]
_NONE: dict[_Kind, tuple[float, ...]] = {
    "base colour": (1.0, 1.0, 1.0),
    "metallic and roughness": (1.0, 1.0),
    "normals": (0.5, 0.5, 1.0),
}
"""The kinds of textures, and what one that is not there is everywhere."""


@dataclass
class Table:
    """What the kernel reads of the materials.

    Attributes:
        of_shape: index of the material of each shape, by the shape's number in Mitsuba's registry.
        factors: :data:`FACTORS` numbers per material.
        textures: per material and kind of texture four numbers: first texel, height, width, 0.
        texels: two numbers per texel; the first row of a texture is at v = 0.
    """

    of_shape: mi.UInt32
    factors: mi.Float
    textures: mi.UInt32
    texels: mi.UInt32

    def surface(self, hit: Any, active: Any) -> Surface:
        """What the surface is like that rays hit."""
        shape: Any = dr.reinterpret_array(mi.UInt32, hit.shape)
        index: Any = dr.gather(mi.UInt32, self.of_shape, shape, active)
        red, green, blue, specular = dr.gather(mi.Vector4f, self.factors, 2 * index, active)
        metallic, roughness, _, _ = dr.gather(mi.Vector4f, self.factors, 2 * index + 1, active)
        color, shares, normal = (self._looked_up(index, k, hit.uv, active) for k in range(len(_NONE)))
        return Surface(
            wi=hit.wi,
            color=mi.Color3f(red, green, blue) * mi.Color3f(color),
            specular=specular,
            metallic=metallic * shares.x,
            alpha=dr.maximum(dr.square(roughness * shares.y), LEAST_ALPHA),
            normal=2 * normal - 1,
        )

    def _looked_up(self, index: Any, kind: int, uv: Any, active: Any) -> Any:
        """(3,) values of one of the textures of material ``index``, which repeats, between four
        texels."""
        start, height, width, _ = dr.gather(
            mi.Vector4u, self.textures, len(_NONE) * index + kind, active
        )
        x, left, right = _between(uv.x, width)
        y, low, high = _between(uv.y, height)

        def texel(row: Any, column: Any) -> Any:
            codes = dr.gather(mi.Vector2u, self.texels, start + row * width + column, active)
            return mi.Vector3f(codes.x & FULL, codes.x >> 16, codes.y)

        lower, upper = (dr.lerp(texel(row, left), texel(row, right), x) for row in (low, high))
        return dr.lerp(lower, upper, y) * (1 / FULL)


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
        self._blocks: dict[tuple[int, _Kind], tuple[AnyArray | None, tuple[int, int, int]]] = {}
        self._texels: list[IntArray] = []
        materials = [scene.pieces[index].material for index in self._pieces]
        for material in materials:
            for pattern in material.patterns:
                self._block(pattern, "base colour")
        pointers: Any = [dr.reinterpret_array(mi.UInt32, mi.ShapePtr(mesh)) for mesh, _ in shapes.meshes]
        numbers = [int(pointer[0]) for pointer in pointers]
        of_shape = np.zeros(max(numbers, default=0) + 1, dtype=np.uint32)
        of_shape[numbers] = np.arange(len(numbers))
        factors, textures = self._rows(materials)
        texels = mi.UInt32(np.concatenate(self._texels).ravel())
        self.table = Table(mi.UInt32(of_shape), factors, textures, texels)
        dr.make_opaque(self.table)

    def set(self, craft: CraftState) -> None:
        """Give the materials that vary the factors and patterns of a frame."""
        materials = self._scene.materials(craft)
        self.table.factors, self.table.textures = self._rows([materials[i] for i in self._pieces])
        dr.make_opaque(self.table)

    def _rows(self, materials: Sequence[Material]) -> tuple[mi.Float, mi.UInt32]:
        """Factors and textures of the table; all textures but patterns are stored by the first call."""
        factors = np.zeros((len(materials), FACTORS), dtype=np.float32)
        textures = np.zeros((len(materials), len(_NONE), 4), dtype=np.uint32)
        for i, material in enumerate(materials):
            own = (*material.base_color, material.specular, material.metallic, material.roughness)
            factors[i, :6] = own
            of_kinds = (
                material.base_color_texture,
                material.metallic_roughness_texture,
                material.normal_texture,
            )
            for k, (texture, kind) in enumerate(zip(of_kinds, _NONE, strict=True)):
                textures[i, k, :3] = self._block(texture, kind)
        return mi.Float(factors.ravel()), mi.UInt32(textures.ravel())

    def _block(self, texture: AnyArray | None, kind: _Kind) -> tuple[int, int, int]:
        """First texel, height and width of a texture, which is stored if it is not yet."""
        key = id(texture), kind
        if key not in self._blocks:
            values = np.array([[_NONE[kind]]]) if texture is None else _decoded(texture, kind)
            height, width, channels = values.shape
            codes = np.zeros((height * width, 3), dtype=np.uint32)
            codes[:, :channels] = np.rint(FULL * values[::-1].reshape(-1, channels))
            start = sum(len(block) for block in self._texels)
            self._texels.append(np.stack([codes[:, 0] | codes[:, 1] << 16, codes[:, 2]], axis=-1))
            self._blocks[key] = texture, (start, height, width)
        return self._blocks[key][1]


def _decoded(texture: AnyArray, kind: _Kind) -> AnyArray:
    """(h, w, channels) what the codes of a texture stand for; of normals (n + 1)/2."""
    shares = np.arange(256) / 255
    return np.asarray((linear_from_srgb(shares) if kind == "base colour" else shares)[texture])
