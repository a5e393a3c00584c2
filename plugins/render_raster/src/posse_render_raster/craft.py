"""The spacecraft in OpenGL: its vertices, its textures and the programs that draw it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import moderngl
import numpy as np

from posse_core import AnyArray, Material, Spacecraft, linear_from_srgb

TEXTURES = ("base_color_texture", "metallic_roughness_texture", "normal_texture")
"""Texture samplers of the program; the index is that of the texture unit."""
FREE_UNIT = len(TEXTURES)


def program(context: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
    """Compile ``shaders/VERTEX.vert`` with ``shaders/FRAGMENT.frag``."""
    folder = Path(__file__).parent / "shaders"
    return context.program(
        vertex_shader=(folder / f"{vertex}.vert").read_text(),
        fragment_shader=(folder / f"{fragment}.frag").read_text(),
    )


@dataclass(frozen=True)
class _LoadedPart:
    """One part of the spacecraft, loaded into OpenGL."""

    material: Material
    textures: Sequence[moderngl.Texture]
    radiance: moderngl.VertexArray
    depth: moderngl.VertexArray
    shadow: moderngl.VertexArray


class Craft:
    """All parts of a spacecraft, with the programs that draw their radiance, depth and shadow map."""

    def __init__(self, context: moderngl.Context, spacecraft: Spacecraft) -> None:
        self.radiance = program(context, "craft", "craft")
        self.depth = program(context, "craft", "nothing")
        self.shadow = program(context, "shadow", "nothing")
        for unit, key in enumerate(TEXTURES):
            self.radiance[key] = unit
        white = context.texture((1, 1), 3, np.full(3, 255, dtype=np.uint8).tobytes())
        textures = {
            name: [_texture(context, material, key) or white for key in TEXTURES]
            for name, material in spacecraft.materials.items()
        }
        self._parts = []
        for part in spacecraft.parts:
            columns = (part.vertices_body_m.astype(np.float32), part.normals_body, part.uv)
            vertices = context.buffer(np.hstack(columns).astype(np.float32).tobytes())
            faces = context.buffer(part.faces.astype(np.int32).tobytes())
            attributes = ("position_body_m", "normal_body", "uv")
            self._parts.append(
                _LoadedPart(
                    material=spacecraft.materials[part.material],
                    textures=textures[part.material],
                    radiance=context.vertex_array(
                        self.radiance, [(vertices, "3f 3f 2f", *attributes)], index_buffer=faces
                    ),
                    depth=context.vertex_array(
                        self.depth, [(vertices, "3f 5x4", attributes[0])], index_buffer=faces
                    ),
                    shadow=context.vertex_array(
                        self.shadow, [(vertices, "3f 5x4", attributes[0])], index_buffer=faces
                    ),
                )
            )

    def draw_depth(self) -> None:
        """Draw the depth of all parts with the program :attr:`depth`."""
        for part in self._parts:
            part.depth.render()

    def draw_shadow(self) -> None:
        """Draw the depth of all parts, as the Sun sees them, with the program :attr:`shadow`."""
        for part in self._parts:
            part.shadow.render()

    def draw_radiance(self) -> None:
        """Draw all parts with the program :attr:`radiance`, each with its own material."""
        for part in self._parts:
            material = part.material
            self.radiance["base_color"] = material.base_color
            self.radiance["metallic"] = material.metallic
            self.radiance["roughness"] = material.roughness
            self.radiance["specular"] = material.specular
            self.radiance["has_normal_map"] = material.normal_texture is not None
            for unit, texture in enumerate(part.textures):
                texture.use(unit)
            part.radiance.render()


def _texture(context: moderngl.Context, material: Material, key: str) -> moderngl.Texture | None:
    pixels: AnyArray | None = getattr(material, key)
    if pixels is None:
        return None
    height, width, channels = pixels.shape
    if key == "base_color_texture":
        # Decoded before the mipmaps are made, because mipmaps must average linear values, not sRGB
        # codes.
        linear = _linear_from_srgb()[pixels]
        texture = context.texture((width, height), channels, linear.tobytes(), dtype="f2", alignment=1)
    elif key == "normal_texture":
        # Normalised here, so that a shorter vector in a mipmap means that the normals below it differ.
        normals = 2 * (pixels / np.float32(255)) - 1
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        texture = context.texture((width, height), channels, normals.tobytes(), dtype="f4")
    else:
        data = np.ascontiguousarray(pixels).tobytes()
        texture = context.texture((width, height), channels, data, alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture


@cache
def _linear_from_srgb() -> AnyArray:
    """(256,) float16, the linear value of each sRGB code."""
    return linear_from_srgb(np.arange(256) / 255).astype(np.float16)
