"""Scenario keys of the camera's geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, field_validator, model_validator

from posse_core._errors import InputError
from posse_core._model.camera import MOST_SIDE_PX, Camera
from posse_core._model.distortion import BrownConrady
from posse_core._plugins.options import Options, nearest
from posse_core._scenario.presets import PRESETS

Positive = Annotated[float, Field(gt=0)]


class CameraConfig(Options):
    """Intrinsics. The defaults are the thesis' Table 3.5: square pixels, central principal point."""

    preset: str | None = Field(
        None,
        description=f"a published camera by name ({', '.join(PRESETS)}): it sets every key of camera and"
        " sensor that the scenario does not; 'posse describe camera NAME' shows them",
    )
    width_px: int = Field(
        1280,
        ge=1,
        le=MOST_SIDE_PX,
        description="image width, pixels; a width other than the preset's changes the size of its"
        " pixels",
    )
    height_px: int = Field(960, ge=1, le=MOST_SIDE_PX, description="image height, pixels")
    hfov_deg: float | None = Field(
        None,
        gt=0,
        lt=180,
        description="horizontal field of view without distortion, degrees; 90 if focal_px is not given",
    )
    focal_px: tuple[Positive, Positive] | None = Field(
        None, description="focal lengths along x and y, pixels; instead of hfov_deg"
    )
    centre_px: tuple[float, float] | None = Field(
        None,
        description="principal point, pixels, with the first pixel's centre at (0, 0); null is the"
        " image's middle",
    )
    sensor_width_mm: float = Field(36.0, gt=0, description="width of the sensor, mm")
    line_time_s: float = Field(
        0.0,
        ge=0,
        description="time from the exposure of one row to that of the next, top row first, of a rolling"
        " shutter; 0 for a global shutter",
    )
    distortion: tuple[float, float, float, float, float] | None = Field(
        None,
        description="k1, k2, p1, p2, k3 of Brown and Conrady's model in OpenCV's order; null for a"
        " pinhole",
    )

    @model_validator(mode="before")
    @classmethod
    def _default_field(cls, raw: Any) -> Any:
        if isinstance(raw, Mapping) and raw.get("hfov_deg") is None and raw.get("focal_px") is None:
            return {**raw, "hfov_deg": 90.0}
        return raw

    @field_validator("preset")
    @classmethod
    def _known(cls, name: str | None) -> str | None:
        if name is not None and name not in PRESETS:
            raise ValueError(
                f"there is no camera of this name{nearest(name, PRESETS)} ({', '.join(PRESETS)})"
            )
        return name

    @field_validator("focal_px")
    @classmethod
    def _one_focal_length(cls, focal_px: Any, info: ValidationInfo) -> Any:
        if focal_px is not None and info.data.get("hfov_deg") is not None:
            raise ValueError("give focal_px or hfov_deg, not both")
        return focal_px

    @field_validator("distortion")
    @classmethod
    def _one_to_one(cls, distortion: Any, info: ValidationInfo) -> Any:
        """Check that the distortion is one-to-one; ``info`` has the keys above if they are valid."""
        if distortion is not None and len(info.data) == len(cls.model_fields) - 1:
            cls.model_construct(**info.data, distortion=distortion).camera()
        return distortion

    def camera(self) -> Camera:
        """The camera that these keys describe.

        Raises:
            ValueError: the distortion maps two directions to one pixel inside the image.
        """
        if self.focal_px is not None:
            fx_px, fy_px = self.focal_px
        else:
            fx_px = fy_px = self.width_px / (2 * math.tan(math.radians(self.hfov_deg or 90.0) / 2))
        cx_px, cy_px = self.centre_px or ((self.width_px - 1) / 2, (self.height_px - 1) / 2)
        coefficients = self.distortion or ()
        return Camera(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=fx_px,
            fy_px=fy_px,
            cx_px=cx_px,
            cy_px=cy_px,
            sensor_width_m=self.sensor_width_mm * 1e-3,
            line_time_s=self.line_time_s,
            distortion=BrownConrady(*coefficients) if any(coefficients) else None,
        )


def preset_camera(name: str) -> Camera:
    """A published camera by name, such as ``speed`` or ``speed-plus``.

    ``posse describe camera NAME`` prints its keys and their source.

    Raises:
        InputError: there is no camera of this name.
    """
    if name not in PRESETS:
        raise InputError(f"no camera named {name!r}{nearest(name, PRESETS)} ({', '.join(PRESETS)})")
    return CameraConfig.model_validate(PRESETS[name].camera).camera()
