"""SPEED and SPEED+: image names and poses in one ``speed.json`` (Kisantal 2020; Park 2022).

With R the matrix of the scalar-first quaternion, x_cam = R x_body + r.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import AliasChoices, Field, RootModel

from posse_core._dataset.dataset import Dataset
from posse_core._files.reading import FileRecord, read_record
from posse_core._files.text import text_file, write_items
from posse_core._formats.needs import labels_with
from posse_core._interfaces.writer import Writer
from posse_core._model.poses import NamedPose

NEEDS = ("q_cam_from_body", "t_body_cam_m")


class SpeedWriter(Writer):
    """Writes ``speed.json`` with the keys of SPEED+; the dataset's ``camera.json`` complements it."""

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write ``speed.json``."""
        path = folder / "speed.json"
        with text_file(path) as text:
            poses = (
                speed_record(labels.image, labels.q_cam_from_body, labels.t_body_cam_m)
                for labels in labels_with(dataset, "SPEED", NEEDS)
            )
            write_items(text, poses)
            text.write("\n")
        return [path]


def speed_record(
    image: str, q_cam_from_body: Sequence[float], t_body_cam_m: Sequence[float]
) -> dict[str, Any]:
    """The entry of an image, with the keys of SPEED+."""
    return {
        "filename": image,
        "q_vbs2tango_true": q_cam_from_body,
        "r_Vo2To_vbs_true": t_body_cam_m,
    }


def read_speed(path: Path) -> Iterator[NamedPose]:
    """Read the image name and pose of every entry of SPEED or SPEED+."""
    for entry in read_record(path, _SpeedFile, "poses of SPEED, SPEED+ or URSO").root:
        yield NamedPose(entry.filename, entry.q_vbs2tango, entry.r_Vo2To_vbs_true)


class _SpeedEntry(FileRecord):
    """A pose; SPEED+ has added ``_true`` to the quaternion's key."""

    filename: str
    q_vbs2tango: tuple[float, float, float, float] = Field(
        validation_alias=AliasChoices("q_vbs2tango_true", "q_vbs2tango")
    )
    r_Vo2To_vbs_true: tuple[float, float, float]


class _SpeedFile(RootModel[list[_SpeedEntry]]):
    """The labels of a dataset."""
