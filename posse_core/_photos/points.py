"""The photographs of a folder, and the file of the points that a person clicked on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.files import read_image
from posse_core._errors import InputError
from posse_core._files.pictures import decoded_image
from posse_core._files.reading import FileRecord, read_bytes, read_record
from posse_core._model.camera import Camera
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.options import nearest

SHOWN = (".png", ".jpg", ".jpeg", ".bmp", ".webp")
"""Photographs that browsers show."""
_HIDDEN = (".tif", ".tiff")

PhotoPoints = Mapping[str, FloatArray]
"""Name of a keypoint → (2,) where it was clicked: u, v, px; the top-left pixel's centre is at (0, 0)."""


class PointsFile(FileRecord):
    """The file that the page of ``posse annotate`` saves.

    Attributes:
        spacecraft: name of the spacecraft.
        photos: name of a photograph → name of a keypoint → u, v, px.
    """

    spacecraft: str
    photos: dict[str, dict[str, tuple[float, float]]]


def photos_in(folder: Path) -> list[str]:
    """Names of the photographs in a folder, sorted.

    Raises:
        InputError: there is no such folder, it has none, or one that browsers do not show.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of photographs")
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    hidden = [name for name in names if Path(name).suffix.lower() in _HIDDEN]
    if hidden:
        raise InputError(f"{folder / hidden[0]}: browsers do not show TIFF; save it as PNG")
    photos = [name for name in names if Path(name).suffix.lower() in SHOWN]
    if not photos:
        raise InputError(f"{folder}: has no photographs ({', '.join(SHOWN)})")
    return photos


def check_photo(path: Path, camera: Camera) -> None:
    """Check that a photograph is of the camera's size, and that every program shows it alike.

    Raises:
        InputError: it cannot be read, is of another size, or its EXIF data turn it.
    """
    height_px, width_px = read_image(path).shape[:2]
    if (width_px, height_px) != (camera.width_px, camera.height_px):
        raise InputError(
            f"{path}: is {width_px} × {height_px} pixels, but the camera {camera.width_px} ×"
            f" {camera.height_px}; photographs must be as the calibration's, neither turned nor scaled"
        )
    data = read_bytes(path)
    small = cv2.IMREAD_REDUCED_GRAYSCALE_8
    shown = decoded_image(data, small)
    stored = decoded_image(data, small | cv2.IMREAD_IGNORE_ORIENTATION)
    if shown is None or stored is None or not np.array_equal(shown, stored):
        raise InputError(
            f"{path}: its EXIF orientation turns it, so programs disagree on where a pixel is; save it"
            " without that tag, as the calibration's pictures are"
        )


def read_points(
    path: Path, craft: Spacecraft, camera: Camera, photos: Sequence[str]
) -> dict[str, PhotoPoints]:
    """Read a file of points: name of a photograph → its points; without photographs that have none.

    Raises:
        InputError: it is not such a file, is of another spacecraft, or names a photograph or a keypoint
            that is not there, or a point is outside its photograph.
    """
    record = read_record(path, PointsFile, "points of 'posse annotate'")
    if record.spacecraft != craft.name:
        raise InputError(
            f"{path}: its points are of {record.spacecraft!r}, but --target is {craft.name!r}"
        )
    points: dict[str, PhotoPoints] = {}
    for photo, clicked in sorted(record.photos.items()):
        if photo not in photos:
            raise InputError(f"{path}: there is no photograph {photo!r}{nearest(photo, photos)}")
        for name, (u, v) in clicked.items():
            if name not in craft.keypoints_body_m:
                known = list(craft.keypoints_body_m)
                raise InputError(
                    f"{path}: {photo}: {craft.name} has no keypoint {name!r}{nearest(name, known)}"
                )
            if not (-0.5 <= u <= camera.width_px - 0.5 and -0.5 <= v <= camera.height_px - 0.5):
                raise InputError(f"{path}: {photo}: {name} at ({u:g}, {v:g}) is outside the photograph")
        if clicked:
            points[photo] = {name: np.array(place) for name, place in clicked.items()}
    return points
