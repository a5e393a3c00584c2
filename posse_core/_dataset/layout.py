"""Names of the files and folders of a dataset (docs/dataset.md)."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Final

from posse_core._errors import InputError

SCENARIO: Final = "scenario.yaml"
MANIFEST: Final = "manifest.json"
SOURCES: Final = "sources"
"""Folder with a folder for each dataset that was joined: its scenario, and its inputs."""
TRAJECTORY: Final = "trajectory.npz"
CAMERA: Final = "camera.json"
INPUTS: Final = "inputs"
"""Folder with copies of the files that the scenario names."""
LABELS: Final = "labels"
IMAGES: Final = "images"
TRUTH: Final = "truth"
SPACECRAFT: Final = "spacecraft"
BODIES: Final = "bodies"
"""Folder with a folder for each body beside the target, which holds the files of its spacecraft."""
SENSORS: Final = "sensors"
"""Folder with a file ``NAME.json`` and a folder ``NAME`` of readings for each sensor."""
FLIGHT: Final = "flight.npz"
READINGS: Final = "readings.jsonl"
FLIGHT_PAGE: Final = "flight.html"
"""Record, readings and page of a flight."""
TRACK: Final = "track.npz"
TRACK_PAGE: Final = "track.html"
"""Record and page of a sequence that was tracked."""
PARTITION_FILE: Final = "partition/partition.json"
PARTS: Final = ("train", "valid", "test")
"""Names of the parts that ``posse partition`` divides a dataset into."""


def spacecraft_file(folder: Path, name: str) -> Path:
    """Return the file of a spacecraft's parts, keypoints and symmetries."""
    return folder / SPACECRAFT / f"{name}.json"


def mesh_file(folder: Path, name: str) -> Path:
    """Return the file of a spacecraft's mesh."""
    return folder / SPACECRAFT / f"{name}.ply"


def reading_file(name: str, index: int, number: int, ending: str) -> str:
    """Return the file of a sensor's reading, relative to the dataset's folder.

    Args:
        name: of the sensor.
        index: of the frame.
        number: of the reading within the frame; the first, at the frame's instant, has no number in
            its name.
        ending: of the file, such as ``".npz"``.
    """
    which = f"_{number:04d}" if number else ""
    return f"{SENSORS}/{name}/{index:06d}{which}{ending}"


def sensor_file(folder: Path, name: str) -> Path:
    """Return the file that describes a sensor."""
    return folder / SENSORS / f"{name}.json"


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file that a label line or a manifest names.

    Raises:
        InputError: The name leads out of the folder.
    """
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\0" in name:
        raise InputError(f"{folder}: names the file {name!r}, which is outside the folder")
    return folder / name
