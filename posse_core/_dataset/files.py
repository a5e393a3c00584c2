"""Reading the images, arrays and JSON objects of a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._errors import InputError
from posse_core._files.pictures import decoded_image
from posse_core._files.reading import parsed_json, read_bytes, read_npz


def read_image(path: Path) -> AnyArray:
    """Read an image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.

    Raises:
        InputError: The file is missing, or is not an image.
    """
    image = decoded_image(read_bytes(path, missing="missing"), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: not an image; save it again")
    return np.asarray(image if image.ndim == 2 else image[..., 2::-1])


def has_alpha(path: Path) -> bool:
    """Whether a PNG file has an alpha channel, which :func:`read_image` leaves out."""
    header = read_bytes(path, missing="missing")[:26]
    return header.startswith(b"\x89PNG") and header[25:] in (b"\x04", b"\x06")


def read_arrays(path: Path) -> dict[str, AnyArray]:
    """Read the arrays of an ``.npz`` file by name.

    Raises:
        InputError: The file is missing or damaged.
    """
    return read_npz(path, lambda name: True)


def read_json(path: Path) -> dict[str, Any]:
    """Read the JSON object in a file.

    Raises:
        InputError: The file is missing, or does not contain a JSON object.
    """
    value = parsed_json(read_bytes(path), str(path))
    if not isinstance(value, dict):
        raise InputError(f"{path}: does not contain a JSON object")
    return value
