"""Scenario keys of the camera's geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, get_args

from pydantic import Field, ValidationInfo, field_validator, model_validator

from posse_core._errors import InputError
from posse_core._model.camera import MOST_SIDE_PX, Camera
from posse_core._model.distortion import DistortionModel, distortion_of
from posse_core._plugins.options import Options, nearest
from posse_core._scenario.calibration import read_calibration
from posse_core._scenario.presets import PRESETS

Positive = Annotated[float, Field(gt=0)]
FAR_SHARE: Final = 0.1
"""How far outside the image a principal point is unless ``off_axis``, in widths or heights of it."""
_WHOLE_PX: Final = 0.01
"""Rounding of ``scale``, in pixels of the image's width or height."""


class CameraConfig(Options):
    """Intrinsics. The defaults are the thesis' Table 3.5: square pixels, central principal point."""

    preset: str | None = Field(
        None,
        examples=list(PRESETS),
        description=f"a published camera by name ({', '.join(PRESETS)}): it sets every key of camera and"
        " sensor that the scenario does not; 'posse describe camera NAME' shows them",
    )
    calibration: str | None = Field(
        None,
        description="a calibration's file, which gives the keys that the scenario does not: OpenCV's"
        " YAML, XML or JSON, ROS's camera_info, Kalibr's camchain, COLMAP's cameras.txt, or camera.json;"
        " FILE#NAME is one of several cameras",
    )
    width_px: int = Field(
        1280,
        ge=1,
        le=MOST_SIDE_PX,
        description="image width, pixels; scale is the key for the same camera with fewer pixels",
    )
    height_px: int = Field(960, ge=1, le=MOST_SIDE_PX, description="image height, pixels")
    hfov_deg: float | None = Field(
        None,
        gt=0,
        lt=180,
        description="horizontal field of view, degrees, of a pinhole or, with a fisheye, of an"
        " equidistant lens; 90 if focal_px is not given",
    )
    focal_px: tuple[Positive, Positive] | None = Field(
        None, description="focal lengths along x and y, pixels; instead of hfov_deg"
    )
    off_axis: bool = Field(
        False,
        description="whether the image may be far from the lens's axis, as a part cut from a larger one:"
        " allows a centre_px farther outside the image than a tenth of its width or height",
    )
    centre_px: tuple[float, float] | None = Field(
        None,
        description="principal point, pixels, with the first pixel's centre at (0, 0); null is the"
        " image's middle",
    )
    sensor_width_mm: float = Field(36.0, gt=0, description="width of the sensor, mm")
    scale: float = Field(
        1.0,
        gt=0,
        description="divides the same sensor behind the same lens into so many times as many columns and"
        " rows: width_px, height_px, focal_px, centre_px, line_time_s, and the sensor's full_well_e and"
        " gain_e_dn are those of scale 1",
    )
    line_time_s: float = Field(
        0.0,
        ge=0,
        description="time from the exposure of one row to that of the next, top row first, of a rolling"
        " shutter; 0 for a global shutter",
    )
    distortion_model: DistortionModel = Field(
        "brown-conrady",
        description="brown-conrady: k1, k2, p1, p2, then k3, then k4, k5, k6 of OpenCV's rational model;"
        " fisheye: k1, k2, k3, k4 of OpenCV's fisheye, Kalibr's equidistant",
    )
    distortion: tuple[float, ...] | None = Field(
        None,
        description="the lens's coefficients in OpenCV's order, 4, 5 or 8 of them; null for a pinhole",
        validate_default=True,
    )

    @model_validator(mode="before")
    @classmethod
    def _completed(cls, raw: Any) -> Any:
        if isinstance(raw, Mapping) and isinstance(raw.get("calibration"), str):
            raw = _with_calibration(raw)
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

    @field_validator("centre_px")
    @classmethod
    def _near_the_image(
        cls, centre_px: tuple[float, float] | None, info: ValidationInfo
    ) -> tuple[float, float] | None:
        known = {"width_px", "height_px", "off_axis"} <= info.data.keys()  # the others are wrong
        if centre_px is None or not known or info.data["off_axis"]:
            return centre_px
        for position, side in zip(centre_px, ("width", "height"), strict=True):
            size = info.data[f"{side}_px"]
            outside_px = max(-0.5 - position, position - (size - 0.5))
            if outside_px > FAR_SHARE * size:
                raise ValueError(
                    f"is {outside_px:.6g} px outside the image, farther than a tenth of its {side} of"
                    f" {size} px; use scale for the same camera with fewer pixels, or off_axis: true for"
                    " a part of a larger image"
                )
        return centre_px

    @field_validator("scale")
    @classmethod
    def _to_whole_pixels(cls, scale: float, info: ValidationInfo) -> float:
        if {"width_px", "height_px"} <= info.data.keys():
            _scaled_size(info.data["width_px"], info.data["height_px"], scale)
        return scale

    @field_validator("distortion")
    @classmethod
    def _one_to_one(cls, distortion: Any, info: ValidationInfo) -> Any:
        """Check that the distortion is its model's and one-to-one; ``info`` has the keys above if they
        are valid."""
        model = info.data.get("distortion_model")
        if distortion is None and model == "fisheye":
            raise ValueError(
                "a fisheye has 4 coefficients; [0, 0, 0, 0] is the equidistant one, and"
                " distortion_model: brown-conrady goes with a pinhole"
            )
        if distortion is not None and len(info.data) == len(cls.model_fields) - 1:
            cls.model_construct(**info.data, distortion=distortion).camera()
        return distortion

    def scaled(self) -> CameraConfig:
        """The keys of the same camera with ``scale`` 1."""
        if self.scale == 1:
            return self
        width_px, height_px = _scaled_size(self.width_px, self.height_px, self.scale)
        x, y = width_px / self.width_px, height_px / self.height_px
        changed: dict[str, Any] = {
            "width_px": width_px,
            "height_px": height_px,
            "line_time_s": self.line_time_s / y,
            "scale": 1.0,
        }
        if self.focal_px is not None:
            changed["focal_px"] = (x * self.focal_px[0], y * self.focal_px[1])
        if self.centre_px is not None:  # the corner of the first pixel, at -0.5, stays in its place
            cx_px, cy_px = self.centre_px
            changed["centre_px"] = (x * (cx_px + 0.5) - 0.5, y * (cy_px + 0.5) - 0.5)
        return self.model_copy(update=changed)

    def camera(self) -> Camera:
        """The camera that these keys describe.

        Raises:
            ValueError: the distortion maps two directions to one pixel inside the image.
        """
        if self.scale != 1:
            return self.scaled().camera()
        if self.focal_px is not None:
            fx_px, fy_px = self.focal_px
        else:
            half = math.radians(self.hfov_deg or 90.0) / 2
            half_width = half if self.distortion_model == "fisheye" else math.tan(half)
            fx_px = fy_px = self.width_px / (2 * half_width)
        cx_px, cy_px = self.centre_px or ((self.width_px - 1) / 2, (self.height_px - 1) / 2)
        return Camera(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=fx_px,
            fy_px=fy_px,
            cx_px=cx_px,
            cy_px=cy_px,
            sensor_width_m=self.sensor_width_mm * 1e-3,
            line_time_s=self.line_time_s,
            distortion=distortion_of(self.distortion_model, self.distortion or ()),
        )


def _with_calibration(raw: Mapping[str, Any]) -> dict[str, Any]:
    """A camera's raw keys, completed by those of the file ``calibration``, which is no longer named.

    Raises:
        InputError: the file is not a calibration.
        ValueError: the keys do not go together.
    """
    for key in ("preset", "hfov_deg"):
        if raw.get(key) is not None:
            raise ValueError(f"give calibration or {key}, not both")
    file = read_calibration(raw["calibration"])
    model = raw.get("distortion_model")
    keys = file.keys(model if model in get_args(DistortionModel) else None, "distortion" not in raw)
    completed = {**keys, **{key: value for key, value in raw.items() if key != "calibration"}}
    if not {"width_px", "height_px"} <= completed.keys():
        raise ValueError(
            f"{file.name} does not tell the size of the image; give width_px and height_px beside"
            " calibration, or add image_width and image_height to the file"
        )
    return completed


def _scaled_size(width_px: int, height_px: int, scale: float) -> tuple[int, int]:
    """The size of an image with so many times as many columns and rows.

    Raises:
        ValueError: it is not of whole pixels, or too large.
    """
    exact = width_px * scale, height_px * scale
    width, height = (round(side) for side in exact)
    if max(exact) > MOST_SIDE_PX:
        raise ValueError(
            f"would make {exact[0]:.6g} x {exact[1]:.6g} px, and a side has at most {MOST_SIDE_PX}"
        )
    if min(width, height) < 1 or max(abs(width - exact[0]), abs(height - exact[1])) > _WHOLE_PX:
        steps = math.gcd(width_px, height_px)
        near = max(1, round(scale * steps)) / steps
        raise ValueError(
            f"would make {exact[0]:.6g} x {exact[1]:.6g} px of {width_px} x {height_px}, not whole ones;"
            f" {near:.8g} makes {round(near * width_px)} x {round(near * height_px)}"
        )
    return width, height


def preset_camera(name: str) -> Camera:
    """A published camera by name, such as ``speed`` or ``speed-plus``.

    ``posse describe camera NAME`` prints its keys and their source.

    Raises:
        InputError: there is no camera of this name.
    """
    if name not in PRESETS:
        raise InputError(f"no camera named {name!r}{nearest(name, PRESETS)} ({', '.join(PRESETS)})")
    return CameraConfig.model_validate(PRESETS[name].camera).camera()
