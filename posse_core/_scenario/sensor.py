"""Scenario keys of the sensor: from light on the lens to digital numbers."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from posse_core._plugins.options import Options

Share = Annotated[float, Field(ge=0, le=1)]


class NoiseConfig(Options):
    """What makes two exposures of the same scene differ."""

    shot: bool = Field(True, description="photons and dark electrons arrive at random (Poisson)")
    read_e: float = Field(25.0, ge=0, description="standard deviation of reading, electrons")
    dark_e_s: float = Field(100.0, ge=0, description="dark current, electrons per second and pixel")
    hot_pixels: Share = Field(0.0, description="share of pixels that are hot, the same all run")
    hot_e_s: float = Field(
        1e5, ge=0, description="mean dark current of hot pixels (exponential), electrons per second"
    )
    gaussian_dn: float = Field(
        0.0,
        ge=0,
        description="standard deviation of noise added to the finished image, DN: the thesis' Gaussian"
        " noise; not physical",
    )


class PsfConfig(Options):
    """How a point of light spreads."""

    shape: Literal["gaussian", "airy", "defocus"] = Field(
        "gaussian",
        description="gaussian; airy is the diffraction of f_number's aperture at 550 nm; defocus is an"
        " even disc",
    )
    sigma_px: float = Field(0.7, gt=0, le=15, description="gaussian: standard deviation, pixels")
    diameter_px: float = Field(3.0, gt=0, le=60, description="defocus: diameter of the disc, pixels")


class AutoExposureConfig(Options):
    """The exposure that brings the brighter pixels of a frame to a share of white.

    Metered on the pixels that the spacecraft covers by more than half, and on the whole image where
    there are none. Electrons of light alone count, by the brightest channel.
    """

    percentile: float = Field(95.0, ge=0, le=100, description="of the metered pixels, by brightness")
    level: float = Field(
        0.6, gt=0, le=1, description="where that pixel is put: share of white, the largest linear value"
    )
    shortest_s: float = Field(1e-5, gt=0, description="least exposure, s")
    longest_s: float = Field(1.0, gt=0, description="largest exposure, s; that of a dark image too")

    @model_validator(mode="after")
    def _in_order(self) -> AutoExposureConfig:
        if self.shortest_s > self.longest_s:
            raise ValueError("shortest_s is larger than longest_s")
        return self


class MotionBlurConfig(Options):
    """Motion while the shutter is open; labels are those of the middle of the exposure."""

    instants: int = Field(
        8,
        ge=2,
        le=1024,
        description="at which the scene is rendered and drawn, at most; fewer where nothing moves by"
        " more than 0.2 pixels between them",
    )


class SensorConfig(Options):
    """From light on the lens to digital numbers.

    By default the camera of the thesis (28.1 µm pixels) exposes a white plate that faces the Sun at
    1 au to 96 % of its range.
    """

    exposure_s: float = Field(0.002, gt=0, description="exposure time, s")
    auto_exposure: AutoExposureConfig | None = Field(
        None, description="choose the exposure frame by frame, in place of exposure_s; null for not"
    )
    motion_blur: MotionBlurConfig | None = Field(
        None, description="average the picture over the exposure; null for that of one instant"
    )
    f_number: float = Field(16.0, gt=0, description="focal length over the aperture's diameter")
    color: Literal["mono", "rgb"] = Field(
        "mono",
        description="mono adds the bands; rgb has a channel for each, balanced so that a white plate in"
        " sunlight has the same DN in all three and in mono",
    )
    quantum_efficiency: tuple[Share, Share, Share] = Field(
        (0.45, 0.50, 0.40), description="electrons per photon in the red, green and blue band"
    )
    full_well_e: float | None = Field(
        None,
        gt=0,
        description="electrons that a pixel holds; null goes with its area, 1264 per square micrometre:"
        " 1e6 for the thesis' pixels, so that exposure does not depend on the image's size",
    )
    blooming: bool = Field(
        False, description="electrons over the full well run along the column, half up and half down"
    )
    vignetting: Literal["none", "cos4"] = Field(
        "none", description="none is an evenly lit image plane; cos4 is a thin lens without baffles"
    )
    bit_depth: Literal[8, 16] = Field(8, description="bits per value; values are DN")
    gain_e_dn: float | None = Field(
        None,
        gt=0,
        description="electrons per DN; null is full_well_e / (2^bits - 1), so a full well is white",
    )
    response: Literal["linear", "srgb"] = Field(
        "linear",
        description="linear: DN follow the light; srgb: by the curve of IEC 61966-2-1, as in pictures"
        " made to be looked at, which shows shadow and cloud at once",
    )
    offset_dn: float = Field(0.0, ge=0, description="DN of no light")
    noise: NoiseConfig = Field(NoiseConfig(), description="what makes exposures differ")
    psf: PsfConfig | None = Field(PsfConfig(), description="how a point spreads; null for not at all")
