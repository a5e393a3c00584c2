"""The beams of a reading: where each points, when, and the rays that stand for its cross-section."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._files.reading import check_file
from posse_core._files.tables import read_table
from posse_core._frames import R_with_z, unit
from posse_core._model.camera import Camera
from posse_core._sensors.lidar.options import (
    MOST_RAYS,
    FlashOptions,
    GivenOptions,
    RasterOptions,
    SpiralOptions,
)

_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
_PIXEL_PITCH_M = 20e-6


@dataclass(frozen=True)
class Beams:
    """N beams of K rays each, in sensor axes.

    A beam's axis is where it is aimed. Each ray stands for the same share of its energy.

    Attributes:
        axis: (N, 3) unit directions.
        after_s: (N,) seconds after the reading's instant.
        rays: (N, K, 3) unit directions.
        energy_j: of each beam's pulse.
        widening: of a mirror's lobe, added to alpha², because a ray stands for a cone of light.
        field_sr: solid angle from which the receiver collects sunlight.
        together: whether all beams have the same instant.
    """

    axis: FloatArray
    after_s: FloatArray
    rays: FloatArray
    energy_j: float
    widening: float
    field_sr: float
    together: bool = False

    def blocks(self, most_rays: int) -> Iterator[Beams]:
        """The beams in order, in blocks of at most so many rays, or of one beam."""
        step = max(1, most_rays // self.rays.shape[1])
        for start in range(0, len(self.axis), step):
            rows = slice(start, start + step)
            yield replace(self, axis=self.axis[rows], after_s=self.after_s[rows], rays=self.rays[rows])


Scan = RasterOptions | SpiralOptions | GivenOptions


def scanned(options: Scan) -> Beams:
    """The beams of a scanner.

    Raises:
        InputError: The table of a given pattern cannot be used.
    """
    match options:
        case RasterOptions():
            axis, after_s = _raster(options)
        case SpiralOptions():
            axis, after_s = _spiral(options)
        case GivenOptions():
            axis, after_s = _given(options)
        case _:
            assert_never(options)
    field_rad = (
        options.divergence_rad if options.field_of_view_rad is None else options.field_of_view_rad
    )
    return Beams(
        axis=axis,
        after_s=after_s,
        rays=gaussian_beam(axis, options.divergence_rad, options.rays),
        energy_j=options.pulse_energy_j,
        # The intensity on the axis is 2 P / (π w²), where w is half the divergence.
        widening=_widening(math.pi * (options.divergence_rad / 2) ** 2 / 2, options.rays),
        field_sr=math.pi * (field_rad / 2) ** 2,
    )


def flashed(options: FlashOptions, camera: Camera) -> Beams:
    """The pixels of an array, row by row, as beams of one instant."""
    side = options.rays_per_side
    v, u = np.mgrid[: options.height_px, : options.width_px].reshape(2, -1).astype(np.float64)
    uv_px = np.stack([u, v], axis=-1)
    within = (np.arange(side) + 0.5) / side - 0.5
    offsets_px = np.stack(np.meshgrid(within, within), axis=-1).reshape(-1, 2)
    pixel_sr = 1 / (camera.fx_px * camera.fy_px)
    return Beams(
        axis=unit(camera.rays(uv_px)),
        after_s=np.zeros(len(uv_px)),
        rays=unit(camera.rays(uv_px[:, None] + offsets_px)),
        energy_j=options.pulse_energy_j / options.beams,
        widening=_widening(pixel_sr, options.rays),
        field_sr=pixel_sr,
        together=True,
    )


def _widening(beam_sr: float, rays: int) -> float:
    """What is added to alpha² so that the rays together return from a mirror what the beam does.

    A lobe with alpha² = Ω/π has the value that it has on average over a cone of Ω, if it is narrow. Rays
    beside each other see the lobe's tails, too; twice the widening makes up for them, within 15 %.

    Args:
        beam_sr: solid angle over which the beam's energy would be even with the intensity on the axis.
        rays: that stand for it.
    """
    return (2 - 1 / rays) * beam_sr / rays / math.pi


def flash_camera(options: FlashOptions) -> Camera:
    """The camera whose pixels are those of the array. Their pitch is 20 µm, on which nothing depends."""
    focal_px = options.width_px / 2 / math.tan(math.radians(options.hfov_deg) / 2)
    return Camera(
        width_px=options.width_px,
        height_px=options.height_px,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=(options.width_px - 1) / 2,
        cy_px=(options.height_px - 1) / 2,
        sensor_width_m=options.width_px * _PIXEL_PITCH_M,
    )


def gaussian_beam(axis: FloatArray, divergence_rad: float, rays: int) -> FloatArray:
    """Rays of equal energy within Gaussian beams: (N, 3) unit axes → (N, rays, 3) unit directions.

    The beam's cross-section is divided into rings of equal energy, each of which has one ray, at the
    radius that halves its energy; successive rays are the golden angle apart (Vogel 1979, Math. Biosci.
    44, 179). The first ray is the axis, and the others are moved by so little that their mean is, too:
    a beam on a plane has the range of its axis.

    Args:
        axis: the beams' axes.
        divergence_rad: full angle at 1/e² of the intensity on the axis, four standard deviations.
        rays: number of rays.
    """
    ring = np.arange(rays)
    radius = divergence_rad / 4 * np.sqrt(-2 * np.log1p(-(ring + 0.5) / rays))
    radius[0] = 0.0
    across = radius * np.stack([np.cos(ring * _GOLDEN_ANGLE), np.sin(ring * _GOLDEN_ANGLE)])
    across[:, 1:] -= across.sum(axis=1, keepdims=True) / max(rays - 1, 1)
    x, y, _ = np.moveaxis(R_with_z(axis), -1, 0)
    return unit(axis[:, None] + across[0][:, None] * x[:, None] + across[1][:, None] * y[:, None])


def _raster(options: RasterOptions) -> tuple[FloatArray, FloatArray]:
    """Axes (N, 3) and times (N,). Azimuth is about y, elevation above the plane of x and z."""
    azimuth = np.radians(options.width_deg) * _centred(options.columns)
    elevation = -np.radians(options.height_deg) * _centred(options.rows)[:, None]
    axis = np.stack(
        np.broadcast_arrays(
            np.sin(azimuth) * np.cos(elevation), -np.sin(elevation), np.cos(azimuth) * np.cos(elevation)
        ),
        axis=-1,
    ).reshape(-1, 3)
    return axis, _spread(options.duration_s, len(axis))


def _centred(count: int) -> FloatArray:
    """(count,) equally spaced from −½ to ½; 0 if there is one."""
    return np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)


def _spread(duration_s: float, count: int) -> FloatArray:
    """(count,) instants, equally spaced from 0."""
    return np.asarray(np.arange(count, dtype=np.float64) * (duration_s / count))


def _spiral(options: SpiralOptions) -> tuple[FloatArray, FloatArray]:
    # The length of the spiral grows with the square of its angle.
    share = np.sqrt(np.arange(options.beams) / max(options.beams - 1, 1))
    off_axis = np.radians(options.radius_deg) * share
    around = 2 * np.pi * options.turns * share
    axis = np.stack(
        [np.sin(off_axis) * np.cos(around), np.sin(off_axis) * np.sin(around), np.cos(off_axis)], axis=-1
    )
    return axis, _spread(options.duration_s, options.beams)


def _given(options: GivenOptions) -> tuple[FloatArray, FloatArray]:
    check_file(options.path)
    arrays = read_table(options.path, ("t_s", "r_beam")).arrays
    if len(arrays) < 2:
        missing = "r_beam" if "t_s" in arrays else "t_s"
        raise InputError(f"{options.path} has no {missing}; a pattern of beams has t_s and r_beam")
    if len(arrays["t_s"]) * options.rays > MOST_RAYS:
        raise InputError(
            f"{options.path}: {len(arrays['t_s'])} beams of {options.rays} rays are more than the"
            f" {MOST_RAYS} rays of a reading; use fewer beams, or fewer rays for each"
        )
    try:
        return unit(arrays["r_beam"]), arrays["t_s"]
    except ValueError:
        raise InputError(f"{options.path}: a direction of r_beam is zero; leave its row out") from None
