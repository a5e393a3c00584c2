"""The files that a mesh consists of, for copies of it."""

from __future__ import annotations

import os
import posixpath
from pathlib import Path

from posse_core._errors import InputError
from posse_core._spacecraft.gltf_file import beside, gltf_side_files
from posse_core._spacecraft.reader import obj_side_files


def mesh_files(mesh: Path) -> dict[str, Path]:
    """The mesh file and its buffers, pictures and material libraries: path from its folder → file.

    What is named but does not exist is left out: a mesh that can be read does not need it.

    Raises:
        InputError: a file is outside the mesh's folder, or is named by a path that a copy of the folder
            lacks.
    """
    match mesh.suffix.lower():
        case ".gltf" | ".glb":
            names = gltf_side_files(mesh)
        case ".obj":
            names = obj_side_files(mesh)
        case _:
            names = []
    files = {mesh.name: mesh}
    for name in names:
        if not os.path.isfile(mesh.parent / name):
            continue
        plain = posixpath.normpath(name)
        if plain.startswith(("/", "../")):
            raise InputError(
                f"{mesh}: refers to {name!r}, which would not be found beside a copy of it; export it"
                " with paths relative to its folder"
            )
        files[plain] = beside(mesh, name)
    return files
