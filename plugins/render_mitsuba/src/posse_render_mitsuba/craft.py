"""The bodies of a scene as Mitsuba meshes. The variant must be set before this module is imported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mitsuba as mi
import numpy as np

from posse_core import Part, Piece, Scene


@dataclass(frozen=True)
class Shapes:
    """The shapes of a scene.

    Attributes:
        entries: of the scene's dictionary.
        meshes: all meshes, and of each the index in ``scene.pieces`` of a piece that it shows.
    """

    entries: dict[str, Any] = field(default_factory=dict)
    meshes: list[tuple[Any, int]] = field(default_factory=list)

    def mesh(self, part: Part, bsdf: Any, index: int) -> Any:
        """A new mesh of a part, which is that of piece ``index``."""
        made = _mesh(part, bsdf)
        self.meshes.append((made, index))
        return made


def fixed_shapes(scene: Scene, bsdf: Callable[[Piece], Any]) -> Shapes:
    """All pieces, ``part_0`` and so on, where their vertices are."""
    shapes = Shapes()
    for i, piece in enumerate(scene.pieces):
        shapes.entries[f"part_{i}"] = shapes.mesh(piece.part, bsdf(piece), i)
    return shapes


def link_shapes(scene: Scene, bsdf: Callable[[Piece], Any]) -> Shapes:
    """All links with parts: the instance ``link_0`` and so on, of a group of meshes. Bodies that are the
    same spacecraft share the groups."""
    shapes = Shapes()
    links: dict[int, list[int]] = {}
    for i, piece in enumerate(scene.pieces):
        links.setdefault(piece.link, []).append(i)
    groups: dict[tuple[tuple[int, int], ...], str] = {}
    for number, indices in links.items():
        pieces = [scene.pieces[i] for i in indices]
        key = tuple((id(piece.part), id(piece.material)) for piece in pieces)
        if key not in groups:
            groups[key] = f"group_{len(groups)}"
            meshes = {
                f"part_{i}": shapes.mesh(piece.part, bsdf(piece), i)
                for i, piece in zip(indices, pieces, strict=True)
            }
            shapes.entries[groups[key]] = {"type": "shapegroup", **meshes}
        reference = {"type": "ref", "id": groups[key]}
        shapes.entries[f"link_{number}"] = {"type": "instance", "group": reference}
    return shapes


def _mesh(part: Part, bsdf: Any) -> Any:
    properties = mi.Properties()
    properties["mesh_bsdf"] = bsdf
    mesh = mi.Mesh(
        part.name,
        len(part.vertices_body_m),
        len(part.faces),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=properties,
    )
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"] = np.ravel(part.vertices_body_m).astype(np.float32)
    buffers["vertex_normals"] = np.ravel(part.normals_body).astype(np.float32)
    buffers["vertex_texcoords"] = np.ravel(part.uv).astype(np.float32)
    buffers["faces"] = np.ravel(part.faces).astype(np.uint32)
    buffers.update()
    return mesh
