"""Reading and writing ``camera.json``, the camera's intrinsics with the keys of SPEED+."""

from __future__ import annotations

from pathlib import Path

from posse_core._dataset.files import read_json
from posse_core._errors import InputError
from posse_core._files.atomic import write_json
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady


def write_camera(camera: Camera, path: Path) -> None:
    """Write the intrinsics with the keys of SPEED+'s ``camera.json``.

    ``ppx`` and ``ppy`` are the width and height of a pixel and ``fx`` and ``fy`` the focal lengths, in
    metres. ``cameraMatrix`` is in pixels, with the centre of the top-left pixel at (0, 0).
    ``distCoeffs`` are k₁, k₂, p₁, p₂, k₃. ``lineTime_s`` is POSSE's own key.
    """
    pitch_m = camera.pixel_pitch_m
    value = {
        "Nu": camera.width_px,
        "Nv": camera.height_px,
        "ppx": pitch_m,
        "ppy": pitch_m,
        "fx": camera.fx_px * pitch_m,
        "fy": camera.fy_px * pitch_m,
        "cameraMatrix": camera.matrix.tolist(),
        "lineTime_s": camera.line_time_s,
        "distCoeffs": camera.distortion_coefficients.tolist(),
    }
    write_json(path, value)


def read_camera(path: Path) -> Camera:
    """Read a file that :func:`write_camera` wrote.

    Raises:
        InputError: The file is missing or of another kind.
    """
    value = read_json(path)
    try:
        K, coefficients = value["cameraMatrix"], [float(x) for x in value.get("distCoeffs", [])]
        if any(coefficients[5:]):
            raise ValueError("distCoeffs has more than the five coefficients of Brown and Conrady")
        return Camera(
            width_px=int(value["Nu"]),
            height_px=int(value["Nv"]),
            fx_px=float(K[0][0]),
            fy_px=float(K[1][1]),
            cx_px=float(K[0][2]),
            cy_px=float(K[1][2]),
            sensor_width_m=float(value["ppx"] * value["Nu"]),
            line_time_s=float(value.get("lineTime_s", 0)),
            distortion=BrownConrady(*coefficients[:5]) if any(coefficients) else None,
        )
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a camera file: {type(error).__name__}: {error}") from None
