"""Reading and writing ``camera.json``, the camera's intrinsics with the keys of SPEED+."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, field_validator, model_validator

from posse_core._files.atomic import write_json
from posse_core._files.reading import FileRecord, read_record
from posse_core._model.camera import MOST_SIDE_PX, Camera
from posse_core._model.distortion import DistortionModel, distortion_of


def write_camera(camera: Camera, path: Path) -> None:
    """Write a camera's intrinsics."""
    write_json(path, camera_record(camera))


def camera_record(camera: Camera) -> dict[str, Any]:
    """The intrinsics with the keys of SPEED+'s ``camera.json``.

    ``ppx`` and ``ppy`` are the width and height of a pixel and ``fx`` and ``fy`` the focal lengths, in
    metres. ``cameraMatrix`` is in pixels, with the centre of the top-left pixel at (0, 0).
    ``distCoeffs`` are the lens's coefficients in OpenCV's order, five zeros for a pinhole. POSSE's own
    keys are ``distModel``, which names their model, and ``lineTime_s``.
    """
    pitch_m = camera.pixel_pitch_m
    return {
        "Nu": camera.width_px,
        "Nv": camera.height_px,
        "ppx": pitch_m,
        "ppy": pitch_m,
        "fx": camera.fx_px * pitch_m,
        "fy": camera.fy_px * pitch_m,
        "cameraMatrix": camera.matrix.tolist(),
        "lineTime_s": camera.line_time_s,
        "distModel": "brown-conrady" if camera.distortion is None else camera.distortion.model,
        "distCoeffs": camera.distortion_coefficients.tolist(),
    }


def read_camera(path: Path) -> Camera:
    """Read a file that :func:`write_camera` wrote, or the ``camera.json`` of SPEED+.

    Raises:
        InputError: The file is missing or of another kind.
    """
    return read_record(path, CameraFile, "a camera file").camera()


Size = Annotated[int, Field(ge=1, le=MOST_SIDE_PX)]
Positive = Annotated[float, Field(gt=0)]


class CameraFile(FileRecord):
    """The keys of ``camera.json``; see :func:`camera_record`."""

    Nu: Size
    Nv: Size
    ppx: Positive
    cameraMatrix: tuple[tuple[Positive, float, float], tuple[float, Positive, float], tuple[float, ...]]
    distModel: DistortionModel = "brown-conrady"
    distCoeffs: Annotated[tuple[float, ...], Field(validate_default=True)] = ()
    lineTime_s: Annotated[float, Field(ge=0)] = 0.0

    @field_validator("distCoeffs")
    @classmethod
    def _of_its_model(cls, coefficients: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if "distModel" in info.data:
            distortion_of(info.data["distModel"], coefficients)
        return coefficients

    @model_validator(mode="after")
    def _is_a_camera(self) -> CameraFile:
        self.camera()  # raises ValueError where the distortion folds over
        return self

    def camera(self) -> Camera:
        (fx_px, _, cx_px), (_, fy_px, cy_px), _ = self.cameraMatrix
        return Camera(
            width_px=self.Nu,
            height_px=self.Nv,
            fx_px=fx_px,
            fy_px=fy_px,
            cx_px=cx_px,
            cy_px=cy_px,
            sensor_width_m=self.ppx * self.Nu,
            line_time_s=self.lineTime_s,
            distortion=distortion_of(self.distModel, self.distCoeffs),
        )
