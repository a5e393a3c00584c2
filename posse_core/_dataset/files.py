"""Reading the images, arrays and JSON objects of a dataset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._errors import InputError


def read_image(path: Path) -> AnyArray:
    """Read an image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.

    Raises:
        InputError: The file is missing, or is not an image.
    """
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.exists() else None
    if image is None:
        raise InputError(f"{path}: {'not an image' if path.exists() else 'missing'}")
    return np.asarray(image if image.ndim == 2 else image[..., 2::-1])


def read_arrays(path: Path) -> dict[str, AnyArray]:
    """Read the arrays of an ``.npz`` file by name.

    Raises:
        InputError: The file is missing or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return dict(arrays)
    except Exception as error:  # zipfile, zlib and numpy raise various errors for a damaged file
        raise InputError(f"{path}: cannot be read: {error}") from None


def read_json(path: Path) -> dict[str, Any]:
    """Read the JSON object in a file.

    Raises:
        InputError: The file is missing, or does not contain a JSON object.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if not isinstance(value, dict):
        raise InputError(f"{path}: does not contain a JSON object")
    return value
