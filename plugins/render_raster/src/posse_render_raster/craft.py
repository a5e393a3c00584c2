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
_ATTRIBUTES = ("position_link_m", "normal_link", "uv")
"""Of a vertex, one after another in its buffer."""


def program(context: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
    """Compile ``shaders/VERTEX.vert`` with ``shaders/FRAGMENT.frag``."""
    folder = Path(__file__).parent / "shaders"
    return context.program(
        vertex_shader=(folder / f"{vertex}.vert").read_text(),
        fragment_shader=(folder / f"{fragment}.frag").read_text(),
    )


@dataclass(frozen=True)
class _Shape:
    """All parts of a link, loaded into OpenGL.

    Attributes:
        coats: for each material, those parts that have it: one call draws them.
        depth, shadow: all parts: one call draws their depth from the camera, or from the Sun.
    """

    coats: Sequence[moderngl.VertexArray]
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
        shape: of all of them.
        coated: for each of the shape's coats, the index of a part that has it among the scene's pieces.
    """

    number: int
    body: int
    vertices_m: FloatArray
    radius_m: float
    shape: _Shape
    coated: Sequence[int]


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
        self._textures: dict[int, moderngl.Texture] = {}
        shapes: dict[tuple[tuple[int, int], ...], _Shape] = {}
        links: dict[int, list[int]] = {}
        for index, piece in enumerate(scene.pieces):
            links.setdefault(piece.link, []).append(index)
        made = []
        for number, own in sorted(links.items()):
            pieces = [scene.pieces[i] for i in own]
            # Parts whose material has one name look the same in every frame.
            coats: dict[str, list[int]] = {}
            for i, piece in enumerate(pieces):
                coats.setdefault(piece.part.material, []).append(i)
            keys = tuple((id(piece.part), id(piece.material)) for piece in pieces)
            if keys not in shapes:
                shapes[keys] = self._shape(pieces, list(coats.values()))
            made.append(
                Link(
                    number=number,
                    body=int(scene.body_of_part[own[0]]),
                    vertices_m=np.concatenate([piece.part.vertices_body_m for piece in pieces]).T,
                    radius_m=float(scene.link_radii_m[number]),
                    shape=shapes[keys],
                    coated=[own[which[0]] for which in coats.values()],
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
        """Draw a link with the program :attr:`radiance`, each part with the material that it has in this
        frame: ``materials`` are of the scene's pieces."""
        _place(self.radiance, link, poses)
        for coat, index in zip(link.shape.coats, link.coated, strict=True):
            material = materials[index]
            self.radiance["base_color"] = material.base_color
            self.radiance["metallic"] = material.metallic
            self.radiance["roughness"] = material.roughness
            self.radiance["specular"] = material.specular
            self.radiance["has_normal_map"] = material.normal_texture is not None
            for unit, key in enumerate(TEXTURES):
                self._texture(key, getattr(material, key)).use(unit)
            coat.render()

    def _texture(self, key: str, pixels: AnyArray | None) -> moderngl.Texture:
        """A material's texture, loaded into OpenGL when it is first drawn; white if it has none."""
        if pixels is None:
            return self._white
        # The scene keeps the pixels, so that their identity stays theirs.
        if id(pixels) not in self._textures:
            self._textures[id(pixels)] = _loaded(self._context, key, pixels)
        return self._textures[id(pixels)]

    def _shape(self, pieces: Sequence[Piece], coats: Sequence[Sequence[int]]) -> _Shape:
        """Pieces of one link, of which each of the coats has some, by their indices in ``pieces``."""
        parts, context = [piece.part for piece in pieces], self._context
        columns = [np.hstack([part.vertices_body_m, part.normals_body, part.uv]) for part in parts]
        vertices = context.buffer(np.concatenate(columns).astype(np.float32).tobytes())
        firsts = np.cumsum([0, *(len(part.vertices_body_m) for part in parts)])[:-1]
        faces = [part.faces + first for part, first in zip(parts, firsts, strict=True)]

        def drawn(target: moderngl.Program, layout: str, which: Sequence[int]) -> moderngl.VertexArray:
            attributes = _ATTRIBUTES[: layout.count("f")]
            indices = np.concatenate([faces[i] for i in which]).astype(np.int32)
            return context.vertex_array(
                target,
                [(vertices, layout, *attributes)],
                index_buffer=context.buffer(indices.tobytes()),
            )

        every = range(len(parts))
        return _Shape(
            coats=[drawn(self.radiance, "3f 3f 2f", which) for which in coats],
            depth=drawn(self.depth, "3f 20x", every),
            shadow=drawn(self.shadow, "3f 20x", every),
        )


def set_matrix(target: moderngl.Program, name: str, matrix: FloatArray) -> None:
    """Set a matrix uniform; OpenGL stores matrices by columns."""
    uniform = target[name]
    assert isinstance(uniform, moderngl.Uniform)
    uniform.write(np.ascontiguousarray(matrix.T, dtype=np.float32).tobytes())


def _place(target: moderngl.Program, link: Link, poses: LinkPoses) -> None:
    """Set the uniforms of a link's pose."""
    set_matrix(target, "R_cam_from_link", poses.R_cam_from_link[link.number])
    target["t_link_cam_m"] = tuple(poses.t_link_cam_m[link.number])


def _loaded(context: moderngl.Context, key: str, pixels: AnyArray) -> moderngl.Texture:
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
