"""What a label line holds. An annotator that a scenario left out leaves its labels out."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0)]


class _Record(BaseModel):
    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class RunLengths(_Record):
    """A mask in COCO's compressed run lengths."""

    size: list[Count] = Field(min_length=2, max_length=2)
    counts: str


class FrameLabels(_Record):
    """One line of a shard; labels of other annotators may stand beside these."""

    index: Count
    t_s: float
    epoch_utc: str
    sequence: int
    spacecraft: str
    image: str
    truth: str | None
    sun_fraction_target: Fraction
    sun_fraction_camera: Fraction
    solar_flux_w_m2: float = Field(ge=0)
    exposure_s: float | None = Field(None, gt=0)
    box_visible_px: list[int] | None = Field(None, min_length=4, max_length=4)
    box_whole_px: list[float] | None = Field(None, min_length=4, max_length=4)
    mask_rle: RunLengths | None = None
    mask_area_px: Count | None = None
    fraction_visible: Fraction | None = None
    fraction_lit: Fraction | None = None
    part_area_px: dict[str, Count] | None = None
    keypoints: dict[str, tuple[float | None, float | None, Literal[0, 1, 2]]] | None = None
    q_cam_from_body: list[float] | None = Field(None, min_length=4, max_length=4)
    t_body_cam_m: list[float] | None = Field(None, min_length=3, max_length=3)
    range_m: float | None = Field(None, gt=0)
    phase_angle_rad: float | None = Field(None, ge=0, le=3.1415926535897936)
    sun_direction_body: list[float] | None = Field(None, min_length=3, max_length=3)
    v_body_cam_m_s: list[float] | None = Field(None, min_length=3, max_length=3)
    omega_body_rad_s: list[float] | None = Field(None, min_length=3, max_length=3)
    omega_camera_rad_s: list[float] | None = Field(None, min_length=3, max_length=3)


def schema_fault(labels: dict[str, Any]) -> str | None:
    """The first thing that is wrong with a label line, or None."""
    values = dict(labels)
    if isinstance(values.get("keypoints"), dict):
        # JSON has lists only, and a strict tuple refuses one.
        values["keypoints"] = {
            k: tuple(p) if isinstance(p, list) else p for k, p in values["keypoints"].items()
        }
    try:
        FrameLabels.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        path = ".".join(str(step) for step in first["loc"])
        return f"{path}: {first['msg'].lower()}"
    return None
