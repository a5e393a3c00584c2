"""Options of the thermal camera."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, model_validator

from posse_core._model.camera import MOST_SIDE_PX
from posse_core._plugins.options import Options
from posse_core._scenario.camera import CameraConfig
from posse_core._sensors.thermal.planck import Band

Positive = Annotated[float, Field(gt=0)]


class ThermalCameraConfig(CameraConfig):
    """Intrinsics of the thermal camera: a bolometer array of 640 × 512 pixels of 17 µm."""

    preset: None = Field(None, description="no published camera is thermal; leave it null")
    width_px: int = Field(640, ge=1, le=MOST_SIDE_PX, description="image width, pixels")
    height_px: int = Field(512, ge=1, le=MOST_SIDE_PX, description="image height, pixels")
    sensor_width_mm: float = Field(10.88, gt=0, description="width of the sensor, mm")


class SurfaceOptions(Options):
    """Thermal properties of a surface; what is null stays as the material gives it."""

    solar_absorptance: float | None = Field(
        None, ge=0, le=1, description="share of sunlight that turns into heat"
    )
    emissivity: float | None = Field(
        None,
        ge=0.01,
        le=1,
        description="share of a black body's heat that it emits, and of infrared that it absorbs",
    )
    heat_capacity_j_m2_k: float | None = Field(
        None, gt=0, description="heat capacity per area of the surface, J m⁻² K⁻¹; 5000 if not given"
    )
    internal_power_w_m2: float | None = Field(
        None, ge=0, description="heat that reaches the surface from inside, W/m²; 0 if not given"
    )


class ThermalOptions(Options):
    """Surface temperatures, their radiation in a band, and the detector."""

    camera: ThermalCameraConfig = Field(
        ThermalCameraConfig.model_validate({}), description="the thermal camera's geometry"
    )
    mode: Literal["transient", "steady"] = Field(
        "transient",
        description="transient: heat is stored, and temperatures follow the illumination of the time"
        " before the frame; steady: each facet emits at once what it absorbs",
    )
    lead_s: float | None = Field(
        None,
        gt=0,
        description="transient: time before the frame that is followed, as if it had repeated itself"
        " ever before, s; null for one orbital period",
    )
    steps: int = Field(
        90, ge=8, le=5000, description="transient: equal steps of that time; sunrise is found besides"
    )
    facet_m: float | None = Field(
        None,
        gt=0,
        description="longest edge of a facet, which has one temperature, m (slivers may be longer); null"
        " for a length whose square is a thousandth of the spacecraft's surface",
    )
    thin_m: float = Field(
        0.05,
        ge=0,
        description="walls of a part up to this thickness have one temperature on both sides, m; others"
        " are insulated from the inside",
    )
    materials: Mapping[str, SurfaceOptions] = Field(
        {}, description="properties of materials, by their names"
    )
    parts: Mapping[str, SurfaceOptions] = Field(
        {}, description="properties of parts, by their names; they override those of the material"
    )
    band_um: tuple[Positive, Positive] = Field(
        (8.0, 14.0), description="first and last wavelength of the even response, µm"
    )
    samples_per_axis: int = Field(
        2, ge=1, le=8, description="rays along each side of a pixel that its radiance is the mean of"
    )
    psf_sigma_px: float = Field(
        0.5, ge=0, le=15, description="standard deviation of the lens's Gaussian spot, pixels; 0: none"
    )
    f_number: float = Field(1.0, gt=0, description="focal length over the aperture's diameter")
    netd_k: float = Field(
        0.05,
        ge=0,
        description="noise-equivalent temperature difference at 300 K with netd_f_number, K",
    )
    netd_f_number: float = Field(1.0, gt=0, description="f-number that netd_k was measured with")
    fixed_pattern_k: float = Field(
        0.03,
        ge=0,
        description="standard deviation of the pixels' offsets, which stay the same throughout a run, as"
        " a temperature difference at 300 K, K",
    )
    range_k: tuple[Positive, Positive] = Field(
        (150.0, 420.0),
        description="black bodies of these temperatures have the smallest and the largest digital"
        " number, K",
    )
    bit_depth: Literal[8, 14, 16] = Field(14, description="bits per digital number")

    @property
    def band(self) -> Band:
        """The band of the response."""
        return Band(*(1e-6 * edge_um for edge_um in self.band_um))

    @model_validator(mode="after")
    def _in_order(self) -> ThermalOptions:
        if self.band_um[0] >= self.band_um[1]:
            raise ValueError("band_um: the first wavelength must be shorter than the last")
        if self.range_k[0] >= self.range_k[1]:
            raise ValueError("range_k: the first temperature must be lower than the last")
        return self
