"""Reads mesh files of all supported formats, or refuses them with a one-line message."""

from __future__ import annotations

import io
import os
import re
import warnings
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from posse_core._errors import InputError
from posse_core._files.reading import read_bytes
from posse_core._model.spacecraft import PLAIN, Material
from posse_core._spacecraft.gltf import read_gltf
from posse_core._spacecraft.gltf_file import beside, within
from posse_core._spacecraft.raw import (
    RawMesh,
    RawPart,
    decoded,
    painted,
    raw_part,
    unique_names,
    untextured,
)

FORMATS = (".glb", ".gltf", ".obj", ".ply", ".stl")
_STL_HEADER, _STL_TRIANGLE = 84, 50
"""Bytes before the triangles of a binary STL file, and of each of them."""


@np.errstate(all="ignore")  # what overflows is refused where the results are checked
def read_mesh(path: Path) -> RawMesh:
    """Read all parts of a mesh file, in its own units and axes.

    Raises:
        InputError: the file does not exist, has an unknown format, no triangles or numbers that are not
            finite, or is damaged.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        known = ", ".join(FORMATS)
        raise InputError(f"{path}: {suffix or 'no extension'} is not a mesh format; use one of {known}")
    if path.is_dir():
        raise InputError(f"{path}: a folder, not a mesh file; for a package use the key 'package'")
    if not read_bytes(path, missing="no such mesh file"):
        raise InputError(f"{path}: the file is empty; export it again")
    try:
        raw = read_gltf(path) if suffix in (".glb", ".gltf") else _read_other(path, suffix[1:])
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: {reason}; repair the mesh and export it again") from None
    except KeyError as error:
        raise InputError(
            f"{path}: not a valid {suffix} file: {error} is missing; export it again"
        ) from None
    except (IndexError, TypeError, AttributeError):
        raise InputError(
            f"{path}: not a valid {suffix} file: a number leads nowhere, or a value is of another type"
            " than the format asks; export it again"
        ) from None
    parts = tuple(_without_degenerate(part) for part in raw.parts)
    parts = tuple(part for part in parts if len(part.faces))
    if not parts:
        raise InputError(f"{path}: there are no triangles in the file; export it with its faces")
    used = {part.material for part in parts}
    return replace(
        raw, parts=parts, materials={name: m for name, m in raw.materials.items() if name in used}
    )


def _without_degenerate(part: RawPart) -> RawPart:
    """The part without its triangles of zero area."""
    a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
    solid = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0
    if solid.all():
        return part
    return replace(part, faces=part.faces[solid])


def _read_other(path: Path, kind: str) -> RawMesh:
    """Read OBJ, PLY or STL."""
    import trimesh  # slow to import, and seldom needed

    data = read_bytes(path)
    if kind == "stl":
        _check_stl(data, path)
    library = _material_libraries(path, data) if kind == "obj" else {}
    # trimesh only gets the names of materials, because it would need another library for pictures.
    names = "".join(f"newmtl {name}\n" for materials in library.values() for name in materials)
    options: dict[str, Any] = {"resolver": {name: names.encode() for name in library}}
    if kind == "obj":
        options |= {"split_objects": True, "split_groups": True}
    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, **options)
    except Exception:  # trimesh raises many kinds of exceptions for broken files
        raise InputError(f"{path}: cannot be read as {kind.upper()}; export it again") from None
    known = {name: m for materials in library.values() for name, m in materials.items()}
    shaded = re.search(rb"^(vn\s|property \w+ nx\s)", data, re.MULTILINE) is not None
    geometries: dict[str, Any] = scene.geometry
    found = sorted((n, g) for n, g in geometries.items() if isinstance(g, trimesh.Trimesh))
    parts, used = [], {}
    labels = unique_names([name if kind == "obj" and len(found) > 1 else "" for name, _ in found])
    for label, (_, geometry) in zip(labels, found, strict=True):
        visual: Any = geometry.visual
        uv = getattr(visual, "uv", None)
        material = known.get(getattr(getattr(visual, "material", None), "name", ""), PLAIN)
        material = untextured(material) if uv is None else material
        normals = geometry.vertex_normals if shaded and kind != "stl" else None
        part = raw_part(label, geometry.vertices, geometry.faces, normals, uv, material.name)
        if visual.kind in ("vertex", "face"):
            part, material = painted(part, visual.face_colors[:, :3])
        parts.append(part)
        used[material.name] = material
    return RawMesh(tuple(parts), used)


def _check_stl(data: bytes, path: Path) -> None:
    """Check that a binary STL file is as long as its header says."""
    size = _STL_HEADER + _STL_TRIANGLE * int.from_bytes(data[80:_STL_HEADER], "little")
    if not data.lstrip().startswith(b"solid") and len(data) != size:
        raise InputError(
            f"{path}: has {len(data)} bytes, but its header says {size}; it is cut short, or has"
            " left-over bytes; export it again"
        )


def _material_libraries(path: Path, data: bytes) -> dict[str, dict[str, Material]]:
    """The materials of an OBJ file: name of the material library → name of the material → material.

    Without a library the model's parts are grey, since many models are passed on without it.
    """
    there = _libraries(path, data)
    for name in _named_by(data, "mtllib"):
        if name not in there:
            warnings.warn(
                f"{path}: its material library {name!r} is missing, so parts are plain grey; put it into"
                " the model's folder to have its colours",
                stacklevel=2,
            )
    return {name: _materials(beside(path, name)) for name in there}


def _libraries(path: Path, data: bytes) -> list[str]:
    """The material libraries of an OBJ file that are there; a link that leads nowhere is."""
    names = _named_by(data, "mtllib")
    for name in names:
        within(path, name)  # refuses what is outside, whether or not it exists
    return [name for name in names if os.path.lexists(path.parent / name)]


def obj_side_files(path: Path) -> list[str]:
    """The material libraries of an OBJ file that exist and their pictures, by their paths from its
    folder."""
    libraries = _libraries(path, read_bytes(path))
    folders = {name: PurePosixPath(name).parent for name in libraries}
    pictures = [
        str(folders[library] / name)
        for library in libraries
        for name in _named_by(read_bytes(beside(path, library)), "map_Kd")
    ]
    return [*libraries, *pictures]


def _named_by(data: bytes, key: str) -> list[str]:
    """What those lines of an OBJ file or a material library name that begin with a word."""
    words = (line.strip().partition(" ") for line in data.decode(errors="replace").splitlines())
    return [name.strip() for word, _, name in words if word == key]


def _materials(path: Path) -> dict[str, Material]:
    """Read a Wavefront material library: Kd, Ns, map_Kd, and Pm and Pr of its physically based
    extension.

    A Phong exponent is converted to the roughness that gives a highlight of the same width,
    alpha² = 2 / (Ns + 2) (Walter et al. 2007).
    """
    materials: dict[str, Material] = {}
    name = ""
    for number, line in enumerate(read_bytes(path).decode(errors="replace").splitlines(), start=1):
        key, _, value = line.strip().partition(" ")
        value = value.strip()
        try:
            if key == "newmtl":
                name = value
                materials[name] = replace(PLAIN, name=value)
            elif key == "Kd":
                red, green, blue = (_share(word) for word in value.split())
                materials[name] = replace(materials[name], base_color=(red, green, blue))
            elif key == "Ns":
                alpha = (2.0 / (max(_number(value), 0.0) + 2.0)) ** 0.5
                materials[name] = replace(materials[name], roughness=alpha**0.5)
            elif key == "Pr":
                materials[name] = replace(materials[name], roughness=_share(value))
            elif key == "Pm":
                materials[name] = replace(materials[name], metallic=_share(value))
            elif key == "map_Kd":
                picture = beside(path, value)
                texture = decoded(read_bytes(picture), path, picture.name)
                materials[name] = replace(materials[name], base_color_texture=texture)
        except (ValueError, KeyError):
            raise InputError(f"{path}, line {number}: {line.strip()!r} is not understood") from None
    return materials


def _share(word: str) -> float:
    """A number within 0 … 1, or the end that it is beyond."""
    return min(max(_number(word), 0.0), 1.0)


def _number(word: str) -> float:
    number = float(word)
    if np.isnan(number):
        raise ValueError(f"{word} is no number")
    return number
