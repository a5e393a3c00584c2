"""The bodies of a scene in OpenGL: their vertices, their textures and the programs that draw them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import moderngl
import numpy as np

from posse_core import AnyArray, FloatArray, LinkPoses, Material, Piece, Scene, linear_from_srgb

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
class _LoadedPiece:
    """A part of a body, loaded into OpenGL."""

    textures: Sequence[moderngl.Texture]
    radiance: moderngl.VertexArray


@dataclass(frozen=True)
class _Shape:
    """All parts of a link as one, loaded into OpenGL: for depth alone, one call draws them all."""

    depth: moderngl.VertexArray
    shadow: moderngl.VertexArray


@dataclass(frozen=True)
class Link:
    """What moves as one, loaded into OpenGL.

    Attributes:
        number: in :class:`posse_core.LinkPoses`.
        body: number of its body.
        vertices_m: (3, V) of all its parts, in its axes.
        radius_m: of a sphere about the origin of its axes that contains them.
        pieces: its parts.
        indices: of its parts among the scene's pieces.
        shape: of all of them.
    """

    number: int
    body: int
    vertices_m: FloatArray
    radius_m: float
    pieces: Sequence[_LoadedPiece]
    indices: Sequence[int]
    shape: _Shape


class Craft:
    """All links of a scene that have parts, with the programs that draw their radiance, depth and shadow
    maps. Bodies that are the same spacecraft share its buffers and textures.

    Attributes:
        links: in the order of their numbers, so that those of one body are together.
    """

    def __init__(self, context: moderngl.Context, scene: Scene) -> None:
        self.radiance = program(context, "craft", "craft")
        self.depth = program(context, "craft", "nothing")
        self.shadow = program(context, "shadow", "nothing")
        for unit, key in enumerate(TEXTURES):
            self.radiance[key] = unit
        self._context = context
        self._white = context.texture((1, 1), 3, np.full(3, 255, dtype=np.uint8).tobytes())
        textures: dict[int, Sequence[moderngl.Texture]] = {}
        loaded: dict[tuple[int, int], _LoadedPiece] = {}
        shapes: dict[tuple[tuple[int, int], ...], _Shape] = {}
        links: dict[int, list[int]] = {}
        for index, piece in enumerate(scene.pieces):
            links.setdefault(piece.link, []).append(index)
            if id(piece.material) not in textures:
                textures[id(piece.material)] = self._textures(piece.material)
            if _key(piece) not in loaded:
                loaded[_key(piece)] = self._loaded(piece, textures[id(piece.material)])
        made = []
        for number, own in sorted(links.items()):
            pieces = [scene.pieces[i] for i in own]
            vertices_m = np.concatenate([piece.part.vertices_body_m for piece in pieces])
            keys = tuple(map(_key, pieces))
            if keys not in shapes:
                shapes[keys] = self._shape(pieces, vertices_m)
            made.append(
                Link(
                    number=number,
                    body=int(scene.body_of_part[own[0]]),
                    vertices_m=vertices_m.T,
                    radius_m=float(scene.link_radii_m[number]),
                    pieces=[loaded[key] for key in keys],
                    indices=own,
                    shape=shapes[keys],
                )
            )
        self.links = tuple(made)

    def draw_depth(self, links: Sequence[Link], poses: LinkPoses) -> None:
        """Draw the depth of links with the program :attr:`depth`."""
        for link in links:
            _place(self.depth, link, poses)
            link.shape.depth.render()

    def draw_shadow(self, link: Link, shadow_from_link: FloatArray) -> None:
        """Draw the depth of a link, as the Sun sees it, with the program :attr:`shadow`."""
        set_matrix(self.shadow, "shadow_from_link", shadow_from_link)
        link.shape.shadow.render()

    def draw_radiance(self, link: Link, poses: LinkPoses, materials: Sequence[Material]) -> None:
        """Draw a link with the program :attr:`radiance`, each part with the material that its piece has
        in this frame."""
        _place(self.radiance, link, poses)
        for piece, index in zip(link.pieces, link.indices, strict=True):
            material = materials[index]
            self.radiance["base_color"] = material.base_color
            self.radiance["metallic"] = material.metallic
            self.radiance["roughness"] = material.roughness
            self.radiance["specular"] = material.specular
            self.radiance["has_normal_map"] = material.normal_texture is not None
            for unit, texture in enumerate(piece.textures):
                texture.use(unit)
            piece.radiance.render()

    def _textures(self, material: Material) -> Sequence[moderngl.Texture]:
        return [_texture(self._context, material, key) or self._white for key in TEXTURES]

    def _loaded(self, piece: Piece, textures: Sequence[moderngl.Texture]) -> _LoadedPiece:
        part, context = piece.part, self._context
        columns = (part.vertices_body_m.astype(np.float32), part.normals_body, part.uv)
        vertices = context.buffer(np.hstack(columns).astype(np.float32).tobytes())
        faces = context.buffer(part.faces.astype(np.int32).tobytes())
        attributes = ("position_link_m", "normal_link", "uv")
        return _LoadedPiece(
            textures=textures,
            radiance=context.vertex_array(
                self.radiance, [(vertices, "3f 3f 2f", *attributes)], index_buffer=faces
            ),
        )

    def _shape(self, pieces: Sequence[Piece], vertices_m: FloatArray) -> _Shape:
        """The parts of pieces, of which (V, 3) are the vertices, one part's after another's."""
        parts, context = [piece.part for piece in pieces], self._context
        firsts = np.cumsum([0, *(len(part.vertices_body_m) for part in parts)])[:-1]
        faces = np.concatenate([part.faces + first for part, first in zip(parts, firsts, strict=True)])
        vertices = context.buffer(vertices_m.astype(np.float32).tobytes())
        indices = context.buffer(faces.astype(np.int32).tobytes())
        of_depth, of_shadow = (
            context.vertex_array(target, [(vertices, "3f", "position_link_m")], index_buffer=indices)
            for target in (self.depth, self.shadow)
        )
        return _Shape(of_depth, of_shadow)


def _key(piece: Piece) -> tuple[int, int]:
    """What two pieces that are loaded once have in common."""
    return id(piece.part), id(piece.material)


def set_matrix(target: moderngl.Program, name: str, matrix: FloatArray) -> None:
    """Set a matrix uniform; OpenGL stores matrices by columns."""
    uniform = target[name]
    assert isinstance(uniform, moderngl.Uniform)
    uniform.write(np.ascontiguousarray(matrix.T, dtype=np.float32).tobytes())


def _place(target: moderngl.Program, link: Link, poses: LinkPoses) -> None:
    """Set the uniforms of a link's pose."""
    set_matrix(target, "R_cam_from_link", poses.R_cam_from_link[link.number])
    target["t_link_cam_m"] = tuple(poses.t_link_cam_m[link.number])


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
