"""Options of the sensor ``lidar``, separate from its code so that importing them is quick."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field, field_validator, model_validator

from posse_core._plugins.options import Options

MOST_RAYS: Final = 4_000_000
"""The most rays of one reading, for beams of several rays each."""
Share = Annotated[float, Field(ge=0, le=1)]
ScanTime = Annotated[
    float,
    Field(ge=0, le=1e4, description="from the first beam to the one that would follow the last, s"),
]
Format = Literal["ply", "las", "pcd"]
Echo = Literal["first", "strongest", "centroid"]


class _Scan(Options):
    """A narrow beam that is pointed in one direction after the other."""

    shape: Literal["raster", "spiral", "given"]
    pulse_energy_j: float = Field(
        2e-6, gt=0, le=100, description="energy of each pulse that leaves the instrument, J"
    )
    divergence_rad: float = Field(
        5e-4,
        ge=0,
        le=0.2,
        description="full angle of the beam, in which its Gaussian intensity falls to 1/e² of the axis'",
    )
    field_of_view_rad: float | None = Field(
        None,
        gt=0,
        le=0.2,
        description="full angle from which the receiver collects sunlight; null is divergence_rad",
    )
    rays: int = Field(
        19,
        ge=1,
        le=10_000,
        description="rays that stand for the beam's cross-section, each for an equal share of its"
        " energy; 1 is its axis alone",
    )


class RasterOptions(_Scan):
    """Rows from the top to the bottom, each from the left to the right."""

    shape: Literal["raster"] = "raster"
    width_deg: float = Field(
        20.0, gt=0, lt=180, description="angle between the first and the last column"
    )
    height_deg: float = Field(20.0, gt=0, lt=180, description="angle between the first and the last row")
    columns: int = Field(100, ge=1, le=16384, description="beams in a row, equally spaced in azimuth")
    rows: int = Field(100, ge=1, le=16384, description="rows, equally spaced in elevation")
    duration_s: ScanTime = 0.1

    @property
    def beams(self) -> int:
        """Number of beams."""
        return self.columns * self.rows


class SpiralOptions(_Scan):
    """An Archimedean spiral from the axis outwards, with beams at equal distances along it."""

    shape: Literal["spiral"]
    radius_deg: float = Field(10.0, gt=0, lt=90, description="angle between the axis and the last beam")
    turns: float = Field(50.0, gt=0, le=1e5, description="number of turns")
    beams: int = Field(10_000, ge=1, le=MOST_RAYS, description="number of beams")
    duration_s: ScanTime = 0.1


class GivenOptions(_Scan):
    """Beams of a table."""

    shape: Literal["given"]
    path: Path = Field(
        description="an .npz or .csv file with t_s, seconds after the reading's instant, and r_beam,"
        " directions of any length in sensor axes (in CSV r_beam_x, r_beam_y, r_beam_z)"
    )


class FlashOptions(Options):
    """One pulse that lights the whole field evenly, seen by an array of pixels at one instant."""

    shape: Literal["flash"]
    pulse_energy_j: float = Field(
        5e-3, gt=0, le=100, description="energy of the pulse that leaves the instrument, J"
    )
    width_px: int = Field(128, ge=1, le=4096, description="columns of the array")
    height_px: int = Field(128, ge=1, le=4096, description="rows of the array")
    hfov_deg: float = Field(20.0, gt=0, lt=170, description="horizontal field of view")
    rays_per_side: int = Field(
        3, ge=1, le=100, description="rays along each side of a pixel, which stand for equal parts of it"
    )

    @property
    def beams(self) -> int:
        """Number of pixels."""
        return self.width_px * self.height_px

    @property
    def rays(self) -> int:
        """Rays of a pixel."""
        return self.rays_per_side**2


class ReceiverOptions(Options):
    """From returning light to electrons."""

    aperture_m: float = Field(0.02, gt=0, le=10, description="diameter of the receiver's aperture, m")
    efficiency: Share = Field(0.7, description="transmission of the receiver's optics")
    quantum_efficiency: Share = Field(0.7, description="electrons per photon")
    bandwidth_m: float = Field(
        1e-8, ge=0, le=1e-6, description="width of the optical filter, which limits sunlight, m"
    )
    threshold_snr: float = Field(
        6.0,
        gt=0,
        le=1e6,
        description="least signal that is detected, in standard deviations of the noise without signal;"
        " never less than one electron",
    )
    saturation_e: float | None = Field(
        1e6, gt=0, le=1e18, description="largest signal that is measured, electrons; null for no limit"
    )


class RangingOptions(Options):
    """From electrons to a range."""

    echo: Echo = Field(
        "first",
        description="which echo of a beam is measured, if the pulse meets surfaces further apart than"
        " half its length: the first that exceeds the threshold or the strongest; or the centroid of"
        " all",
    )
    bias_m: float = Field(0.0, ge=-1e4, le=1e4, description="added to every range, m")
    resolution_m: float = Field(
        0.0, ge=0, le=1e3, description="ranges are rounded to multiples of it, m; 0 for none"
    )


class LidarNoise(Options):
    """Random errors."""

    shot: bool = Field(True, description="Poisson noise of the signal and of sunlight")
    receiver_e: float = Field(
        100.0,
        ge=0,
        le=1e9,
        description="standard deviation of the receiver's own noise in a pulse, electrons",
    )
    range_m: float = Field(
        0.01,
        ge=0,
        le=1e3,
        description="standard deviation of ranges whatever the signal, such as jitter of the clock, m",
    )


Pattern = Annotated[
    RasterOptions | SpiralOptions | GivenOptions | FlashOptions,
    Field(discriminator="shape"),
]


class LidarOptions(Options):
    """Options of the sensor ``lidar``."""

    pattern: Pattern = Field(
        RasterOptions(), description="where the beams point and when: raster, spiral, given or flash"
    )
    wavelength_m: float = Field(1.55e-6, ge=2e-7, le=2e-5, description="wavelength of the laser, m")
    pulse_width_s: float = Field(
        3e-9, gt=0, le=1e-6, description="full width of the Gaussian pulse at half its maximum, s"
    )
    receiver: ReceiverOptions = Field(ReceiverOptions(), description="the receiver")
    ranging: RangingOptions = Field(RangingOptions(), description="how ranges are measured")
    noise: LidarNoise = Field(LidarNoise(), description="random errors")
    formats: tuple[Format, ...] = Field(
        ("ply",), description="files of the points, beside the arrays: any of ply, las, pcd"
    )

    @field_validator("pattern", mode="before")
    @classmethod
    def _has_a_shape(cls, pattern: Any) -> Any:
        if isinstance(pattern, Mapping) and "shape" not in pattern:
            raise ValueError("give its shape, which is raster, spiral, given or flash")
        return pattern

    @model_validator(mode="after")
    def _fits_into_memory(self) -> LidarOptions:
        pattern = self.pattern
        if isinstance(pattern, GivenOptions):
            return self
        if pattern.beams * pattern.rays > MOST_RAYS:
            raise ValueError(
                f"{pattern.beams} beams of {pattern.rays} rays are more than the {MOST_RAYS} rays of a"
                " reading; use fewer beams, or fewer rays for each"
            )
        return self
