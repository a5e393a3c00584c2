"""Reading and writing the files of a spacecraft, ``NAME.json`` and ``NAME.ply``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.mesh import Mesh, write_mesh
from posse_core._errors import InputError
from posse_core._files.atomic import write_json
from posse_core._files.reading import FileRecord, read_record
from posse_core._model.spacecraft import Spacecraft


@dataclass(frozen=True)
class SpacecraftInfo:
    """The names, keypoints and symmetries of a spacecraft; :meth:`posse_core.Dataset.mesh` has its mesh.

    Attributes:
        name: the class name.
        parts: names of the parts; the id of a part in the labels is its index here.
        keypoints_body_m: name → (3,) metres, body axes, in the order of the labels.
        skeleton: pairs of names of keypoints that drawings connect by lines.
        symmetries: rotations (3, 3) that leave the appearance unchanged, without the identity.
    """

    name: str
    parts: tuple[str, ...]
    keypoints_body_m: Mapping[str, FloatArray]
    skeleton: tuple[tuple[str, str], ...]
    symmetries: tuple[FloatArray, ...]


def write_spacecraft(spacecraft: Spacecraft, folder: Path) -> None:
    """Write ``NAME.json`` and ``NAME.ply`` (binary, body axes, metres, float64, a part id per face)."""
    value = {
        "name": spacecraft.name,
        "parts": [part.name for part in spacecraft.parts],
        "keypoints": {k: np.asarray(x).tolist() for k, x in spacecraft.keypoints_body_m.items()},
        "skeleton": [list(pair) for pair in spacecraft.skeleton],
        "symmetries": [np.asarray(R).tolist() for R in spacecraft.symmetries],
    }
    parts = spacecraft.parts
    first_vertex = np.cumsum([0, *(len(part.vertices_body_m) for part in parts)])
    mesh = Mesh(
        vertices_body_m=np.concatenate([part.vertices_body_m for part in parts]),
        faces=np.concatenate([part.faces + first_vertex[i] for i, part in enumerate(parts)]),
        part_id=np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts]),
    )
    write_mesh(mesh, folder / f"{spacecraft.name}.ply")
    write_json(folder / f"{spacecraft.name}.json", value)


def read_spacecraft(path: Path) -> SpacecraftInfo:
    """Read the ``NAME.json`` of :func:`write_spacecraft`.

    Raises:
        InputError: The file is missing or of another kind.
    """
    record = read_record(path, _SpacecraftFile, "a spacecraft file")
    if record.name != path.stem:
        raise InputError(f"{path}: name: is {record.name!r}, and the file is named {path.stem!r}")
    return SpacecraftInfo(
        name=record.name,
        parts=record.parts,
        keypoints_body_m={k: np.array(x) for k, x in record.keypoints.items()},
        skeleton=record.skeleton,
        symmetries=tuple(np.array(R) for R in record.symmetries),
    )


Vector = tuple[float, float, float]


class _SpacecraftFile(FileRecord):
    """The keys of ``NAME.json``; see :class:`SpacecraftInfo`."""

    name: str
    parts: tuple[str, ...]
    keypoints: dict[str, Vector]
    skeleton: tuple[tuple[str, str], ...]
    symmetries: tuple[tuple[Vector, Vector, Vector], ...]
