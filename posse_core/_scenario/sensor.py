"""Scenario keys of the sensor: from radiance at the lens to digital numbers."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from posse_core._plugins.options import Options

Share = Annotated[float, Field(ge=0, le=1)]


class NoiseConfig(Options):
    """Sensor noise."""

    shot: bool = Field(True, description="Poisson noise of photons and of dark current")
    read_e: float = Field(25.0, ge=0, description="standard deviation of the read noise, electrons")
    dark_e_s: float = Field(100.0, ge=0, description="dark current, electrons per second per pixel")
    hot_pixels: Share = Field(
        0.0, description="share of pixels that are hot; they stay the same throughout a run"
    )
    hot_e_s: float = Field(
        1e5, ge=0, description="mean dark current of hot pixels (exponential), electrons per second"
    )
    gaussian_dn: float = Field(
        0.0,
        ge=0,
        description="standard deviation of the noise added to the finished image, DN: the Gaussian"
        " noise of the thesis, which is not physical",
    )


class PsfConfig(Options):
    """Point spread function of the lens."""

    shape: Literal["gaussian", "airy", "defocus"] = Field(
        "gaussian",
        description="gaussian; airy: the diffraction of f_number's aperture at 550 nm; defocus: a"
        " uniform disc",
    )
    sigma_px: float = Field(0.7, gt=0, le=15, description="standard deviation of the gaussian, pixels")
    diameter_px: float = Field(3.0, gt=0, le=60, description="diameter of the disc of defocus, pixels")
    glare: Share = Field(
        0.0,
        description="share of the light that the lens scatters into a wide halo, which shows around what"
        " is many times too bright",
    )
    glare_px: float = Field(
        50.0, gt=0, le=1000, description="radius within which half of the scattered light falls, pixels"
    )


class AutoExposureConfig(Options):
    """The exposure that brings the brighter pixels of a frame to a given share of white.

    It is metered on the pixels that the spacecraft covers by more than half, or on the whole image if
    there are none. Only electrons from light count, in the brightest channel.
    """

    percentile: float = Field(
        95.0, ge=0, le=100, description="percentile of the metered pixels by brightness"
    )
    level: float = Field(
        0.6,
        gt=0,
        le=1,
        description="value of the pixel at that percentile, as a share of white, the largest linear"
        " value",
    )
    shortest_s: float = Field(1e-5, gt=0, description="shortest exposure, s")
    longest_s: float = Field(
        1.0, gt=0, description="longest exposure, s; also the exposure of a dark image"
    )

    @model_validator(mode="after")
    def _in_order(self) -> AutoExposureConfig:
        if self.shortest_s > self.longest_s:
            raise ValueError("shortest_s is larger than longest_s")
        return self


class MotionBlurConfig(Options):
    """Motion while the shutter is open. Labels hold for the middle of the exposure."""

    instants: int = Field(
        8,
        ge=2,
        le=1024,
        description="most instants at which the scene is rendered; fewer are used where nothing moves"
        " by more than 0.2 pixels between them",
    )


class SensorConfig(Options):
    """From radiance at the lens to digital numbers.

    By default the camera of the thesis (28.1 µm pixels) exposes a white plate that faces the Sun at
    1 au to 96 % of its range.
    """

    exposure_s: float = Field(0.002, gt=0, description="exposure time, s")
    auto_exposure: AutoExposureConfig | None = Field(
        None, description="choose the exposure of each frame, instead of exposure_s; null for off"
    )
    exposure_stops: tuple[float, float] = Field(
        (0.0, 0.0),
        description="least and greatest random change of each frame's exposure, in stops (a stop doubles"
        " it), after auto_exposure",
    )
    motion_blur: MotionBlurConfig | None = Field(
        None, description="average the image over the exposure; null for the image of one instant"
    )
    f_number: float = Field(16.0, gt=0, description="focal length over the aperture's diameter")
    color: Literal["mono", "rgb"] = Field(
        "mono",
        description="mono sums the bands; rgb has a channel for each, balanced so that a white plate in"
        " sunlight has the same DN in all three as in mono",
    )
    quantum_efficiency: tuple[Share, Share, Share] = Field(
        (0.45, 0.50, 0.40), description="electrons per photon in the red, green and blue band"
    )
    full_well_e: float | None = Field(
        None,
        gt=0,
        description="most electrons that a pixel holds; null is 1327 per square micrometre of pixel"
        " area (1.05e6 for the thesis' pixels), so that exposure does not depend on the image's size",
    )
    blooming: bool = Field(
        False, description="electrons above the full well spill along the column, half up and half down"
    )
    vignetting: Literal["none", "cos4"] = Field(
        "none", description="none: a uniformly lit image plane; cos4: a thin lens without baffles"
    )
    bit_depth: Literal[8, 16] = Field(8, description="bits per value (DN)")
    gain_e_dn: float | None = Field(
        None,
        gt=0,
        description="electrons per DN; null is full_well_e / (2^bits - 1), so that a full well is white",
    )
    response: Literal["linear", "srgb"] = Field(
        "linear",
        description="linear: DN are proportional to the light; srgb: DN follow the curve of IEC"
        " 61966-2-1, as in images for viewing, which shows both shadows and clouds",
    )
    offset_dn: float = Field(0.0, ge=0, description="DN without any light")
    noise: NoiseConfig = Field(NoiseConfig(), description="noise of the sensor")
    psf: PsfConfig | None = Field(
        PsfConfig(), description="point spread function of the lens; null for none"
    )

    @field_validator("exposure_stops")
    @classmethod
    def _stops_in_order(cls, stops: tuple[float, float]) -> tuple[float, float]:
        if not -20 <= stops[0] <= stops[1] <= 20:
            raise ValueError("give the least change and then the greatest, from -20 to 20")
        return stops

    def with_pixels_of(self, area: float) -> SensorConfig:
        """The keys of the same sensor divided into pixels of ``area`` times the size, whose images are
        as bright."""
        wells = {"full_well_e": self.full_well_e, "gain_e_dn": self.gain_e_dn}
        return self.model_copy(update={k: e * area for k, e in wells.items() if e is not None})
