"""The image sensor: radiance → photons → electrons → DN."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._constants import PLANCK_J_S, SPEED_OF_LIGHT_M_S
from posse_core._errors import ComponentError
from posse_core._imaging.noise import detected, normal, read, shot
from posse_core._imaging.psf import glared, make_psf
from posse_core._model.bands import BAND_CENTRES_M, SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.distortion import Fisheye
from posse_core._model.light import Light
from posse_core._model.scene import Radiance
from posse_core._model.sky_view import SkyView
from posse_core._model.srgb import srgb_from_linear
from posse_core._randomness import random_generator
from posse_core._scenario.sensor import AutoExposureConfig, SensorConfig

FULL_WELL_E_M2 = 1.05e6 / 28.125e-6**2
"""Default full well per pixel area: about 10³ electrons per µm², which is usual for silicon."""
_BLOCK = 1 << 16
"""Numbers that are digitised at once: few enough to stay in the processor's cache."""


@dataclass(frozen=True)
class Photograph:
    """A finished image, and what it was made of.

    Attributes:
        image: (H, W) or (H, W, 3) red-green-blue digital numbers, uint8 or uint16.
        exposure_s: how long the shutter was open.
        light: that reached the image sensor.
    """

    image: AnyArray
    exposure_s: float
    light: Light


class ImageSensor:
    """A lens and an image sensor with a linear response up to its full well.

    A pixel's irradiance is π L / (4 N²) (Born & Wolf § 4.8, for distant objects on the axis). A point
    source contributes its irradiance times the area of the aperture. Without vignetting both hold
    everywhere in the image, as after a flat-field correction.
    """

    def __init__(self, config: SensorConfig, camera: Camera, name: str = "") -> None:
        """name: of the sensor beside the chaser's camera that it belongs to; its noise is its own."""
        self._config = config
        self._name = f"{name} " if name else ""
        self._psf = make_psf(config.psf, config.f_number, camera.pixel_pitch_m)
        self._shape = (camera.height_px, camera.width_px)
        photons_j = np.array(BAND_CENTRES_M) / (PLANCK_J_S * SPEED_OF_LIGHT_M_S)
        electrons_j = photons_j * np.array(config.quantum_efficiency)
        pixel_m2 = camera.pixel_pitch_m**2
        aperture_m2 = np.pi / 4 * (camera.focal_length_m / config.f_number) ** 2
        per_radiance = np.pi * pixel_m2 / (4 * config.f_number**2) * electrons_j
        per_irradiance = aperture_m2 * electrons_j
        self._camera = camera
        self._vignetting = config.vignetting == "cos4"
        self._falloff = _falloff(camera, self._vignetting)
        self._max_dn = 2**config.bit_depth - 1
        self._full_well_e = config.full_well_e or FULL_WELL_E_M2 * pixel_m2
        gain_e_dn = config.gain_e_dn or self._full_well_e / self._max_dn
        if config.color == "mono":
            self._e_s_per_radiance = per_radiance[:, None]
            self._e_s_per_irradiance = per_irradiance[:, None]
            self._gain_e_dn = np.array([gain_e_dn])
        else:
            self._e_s_per_radiance = np.diag(per_radiance)
            self._e_s_per_irradiance = np.diag(per_irradiance)
            white_e = per_radiance * SOLAR_BAND_FRACTIONS
            self._gain_e_dn = gain_e_dn * white_e / white_e.sum()

    def electrons_s(self, radiance_rgb: FloatArray) -> FloatArray:
        """(C,) photo-electrons per second of a pixel on the axis that sees the radiance (3,) everywhere,
        C = 1 or 3."""
        return np.asarray(radiance_rgb @ self._e_s_per_radiance)

    def metered_s(self, sky: SkyView, craft: Radiance | None, rule: AutoExposureConfig) -> float:
        """The exposure time in s that an auto-exposure rule chooses for a frame.

        Raises:
            ComponentError: the renderer's radiance is negative or not finite.
        """
        white_e = np.minimum(self._gain_e_dn * self._max_dn, self._full_well_e)
        whites_s = (self.mean_electrons(sky, craft, 1.0) / white_e).max(axis=-1)
        if craft is not None and (craft.coverage > 0.5).any():
            whites_s = whites_s[craft.box.slices][craft.coverage > 0.5]
        bright_s = float(np.percentile(whites_s, rule.percentile))
        wanted_s = rule.level / bright_s if bright_s > 0 else rule.longest_s
        return float(np.clip(wanted_s, rule.shortest_s, rule.longest_s))

    def mean_electrons(self, sky: SkyView, craft: Radiance | None, exposure_s: float) -> Float32Array:
        """Expected number of photo-electrons: (H, W, C), C = 1 or 3.

        Raises:
            ComponentError: the renderer's radiance is negative or not finite.
        """
        to_e = (self._e_s_per_radiance * exposure_s).astype(np.float32)
        lit = PixelBox(0, 0, self._camera.width_px, self._camera.height_px)
        if sky.radiance_rgb is None:
            electrons = np.zeros((*self._shape, to_e.shape[1]), dtype=np.float32)
            lit = PixelBox(0, 0, 0, 0) if craft is None else craft.box
        else:
            electrons = cv2.transform(sky.radiance_rgb, to_e.T).reshape(*self._shape, -1)
        if craft is not None:
            light = craft.radiance_rgb
            if not np.all((light >= 0) & np.isfinite(light)):
                raise ComponentError("the renderer's radiance is negative or not finite in some pixels")
            inside = electrons[craft.box.slices]
            inside *= np.repeat(1 - craft.coverage[..., None], inside.shape[2], axis=2)
            inside += cv2.transform(light, to_e.T).reshape(inside.shape)
        if not lit.is_empty:
            # Around the light there must be room for its spots, within which the image is not mirrored.
            around = lit.grown(2 * self._psf.radius_px, self._camera).slices
            if self._falloff is not None:
                electrons[around] *= self._falloff[around]
            electrons[around] = self._psf.blur(electrons[around])
            if self._config.psf is not None and self._config.psf.glare:
                electrons = glared(electrons, self._config.psf.glare, self._config.psf.glare_px)
        if len(sky.points_px):
            self._add_points(electrons, sky, craft, exposure_s)
        return electrons

    def photograph(
        self, gather: Callable[[float, int], Light], seed: int, index: int, number: int = 0
    ) -> Photograph:
        """Take a photograph, with the exposure that the keys ask for.

        Args:
            gather: collects the light over an exposure: (seconds, largest number of instants).
            seed, index, number: as in :meth:`expose`.

        Raises:
            ComponentError: the renderer's radiance is negative or not finite.
        """
        config, light = self._config, None
        instants = 1 if config.motion_blur is None else config.motion_blur.instants
        exposure_s = config.exposure_s
        if config.auto_exposure is not None:
            light = gather(0.0, instants)
            exposure_s = self.metered_s(light.sky, light.craft, config.auto_exposure)
        exposure_s *= self._exposure_factor(seed, index, number)
        if light is None or config.motion_blur is not None:
            light = gather(exposure_s, instants)
        image = self.expose(light.sky, light.craft, exposure_s, seed, index, number)
        return Photograph(image, exposure_s, light)

    def _exposure_factor(self, seed: int, index: int, number: int) -> float:
        """The random factor on the exposure of an image."""
        least, greatest = self._config.exposure_stops
        if least == greatest:
            return float(2.0**least)
        again = f" {number}" if number else ""
        random = random_generator(seed, index, f"{self._name}exposure{again}")
        return float(2.0 ** random.uniform(least, greatest))

    def expose(
        self,
        sky: SkyView,
        craft: Radiance | None,
        exposure_s: float,
        seed: int,
        index: int,
        number: int = 0,
    ) -> AnyArray:
        """Make the image of a frame: (H, W) or (H, W, 3) of uint8 or uint16.

        ``craft`` is None if the spacecraft is out of view. The noise depends only on ``seed``, on
        ``index``, the frame's index, and on ``number``, the number of the image within the frame.

        Raises:
            ComponentError: the renderer's radiance is negative or not finite.
        """
        config = self._config
        again = f" {number}" if number else ""
        random = random_generator(seed, index, f"{self._name}sensor{again}")
        electrons = self.mean_electrons(sky, craft, exposure_s)
        electrons += np.float32(config.noise.dark_e_s * exposure_s)
        if config.noise.hot_pixels:
            self._add_hot_pixels(
                electrons, exposure_s, random_generator(seed, -1, f"{self._name}hot pixels")
            )
        shot_noise = config.noise.shot
        if config.blooming:
            if shot_noise:
                electrons = shot(electrons.ravel(), random).reshape(electrons.shape)
            _bloom(electrons, np.float32(self._full_well_e))
            shot_noise = False
        height, width = self._shape
        dtype = np.uint8 if config.bit_depth == 8 else np.uint16
        image: AnyArray = np.empty((height, electrons[0].size), dtype=dtype)
        rows = max(1, _BLOCK // image.shape[1])
        for top in range(0, height, rows):
            block = electrons[top : top + rows].ravel()
            arguments = (self._full_well_e, config.noise.read_e, random)
            block = detected(block, *arguments) if shot_noise else read(block, *arguments)
            image[top : top + rows] = self._digitised(block.reshape(-1, image.shape[1]), random)
        return image.reshape(height, width, -1) if config.color == "rgb" else image

    def _digitised(self, electrons: Float32Array, random: np.random.Generator) -> Float32Array:
        """Whole DN of electrons (rows, columns · channels), in place."""
        config, dn = self._config, electrons
        dn *= np.tile(1 / self._gain_e_dn, self._shape[1]).astype(np.float32)
        if config.offset_dn:
            dn += np.float32(config.offset_dn)
        if config.response == "srgb":
            dn *= np.float32(1 / self._max_dn)
            dn = srgb_from_linear(np.clip(dn, 0, 1, out=dn))
            dn *= np.float32(self._max_dn)
        if config.noise.gaussian_dn:
            dn += np.float32(config.noise.gaussian_dn) * normal(random, dn.size).reshape(dn.shape)
        return np.clip(np.rint(dn, out=dn), 0, self._max_dn, out=dn)

    def _add_hot_pixels(
        self, electrons: Float32Array, exposure_s: float, random: np.random.Generator
    ) -> None:
        """Add the dark current of hot pixels, in place."""
        noise, pixels = self._config.noise, electrons.reshape(-1)
        hot = random.choice(pixels.size, round(noise.hot_pixels * pixels.size), replace=False)
        pixels[hot] += random.exponential(noise.hot_e_s * exposure_s, hot.size)

    def _add_points(
        self, electrons: Float32Array, sky: SkyView, craft: Radiance | None, exposure_s: float
    ) -> None:
        """Add the spots of point sources, in place; the spacecraft hides those behind it."""
        radius = self._psf.radius_px
        pixels = np.floor(sky.points_px + 0.5).astype(np.int64)
        light_e: FloatArray = sky.points_irradiance_rgb_w_m2 @ self._e_s_per_irradiance * exposure_s
        if craft is not None:
            box = craft.box
            x, y = pixels[:, 0] - box.x0, pixels[:, 1] - box.y0
            behind = (x >= 0) & (x < box.width) & (y >= 0) & (y < box.height)
            light_e[behind] *= 1 - craft.coverage[y[behind], x[behind], None]
        if self._vignetting:
            # For a star only the aperture's tilt counts; the other cosines of cos⁴ belong to pixels.
            light_e /= np.linalg.norm(self._camera.rays(sky.points_px), axis=-1, keepdims=True)
        height, width = self._shape
        reach = np.all((pixels >= -radius) & (pixels < [width + radius, height + radius]), axis=-1)
        pixels, light_e = pixels[reach], light_e[reach]
        spots = self._psf.spots(sky.points_px[reach] - pixels)
        around = pixels[:, None, :] + np.arange(-radius, radius + 1)[:, None]
        # What falls beside the image is deposited at its border, as nothing.
        inside = (around >= 0) & (around < [width, height])
        columns, rows = np.moveaxis(np.clip(around, 0, [width - 1, height - 1]), -1, 0)
        spots = spots * inside[:, :, None, 1] * inside[:, None, :, 0]
        channels = electrons.shape[-1]
        first = channels * (rows[:, :, None] * width + columns[:, None, :]).ravel()
        for channel in range(channels):
            deposit = (spots * light_e[:, None, None, channel]).astype(np.float32)
            np.add.at(electrons.reshape(-1), first + channel, deposit.ravel())


def _falloff(camera: Camera, cos4: bool) -> Float32Array | None:
    """(H, W, 1) irradiance of each pixel under uniform radiance, relative to one on the axis; None if it
    is 1 everywhere.

    Distortion changes the solid angle that a pixel sees, and with it the pixel's light. A fisheye's is
    proportional to that solid angle: cos³ θ times the area in a pinhole's image. A flat field like that
    of a pinhole would make its corners many times too bright.
    """
    if camera.distortion is None and not cos4:
        return None
    centres_px = PixelBox(0, 0, camera.width_px, camera.height_px).pixel_centres_px()
    falloff = camera.area_seen(centres_px)
    power = 4 if cos4 else 3 if isinstance(camera.distortion, Fisheye) else 0
    if power:
        cosine2 = 1 / np.sum(camera.rays(centres_px) ** 2, axis=-1)
        falloff = falloff * cosine2 ** (power / 2)
    return falloff.astype(np.float32)[..., None]


def _bloom(electrons: Float32Array, full_well_e: np.float32) -> None:
    """Let the charge of overfull pixels spread along their columns, in place. Charge that passes the
    image's border is lost."""
    full = np.flatnonzero((electrons > full_well_e).any(axis=(0, 2)))
    if not len(full):
        return
    columns = electrons[:, full]
    over = np.maximum(columns - full_well_e, 0)
    columns -= over
    for rows in (range(len(columns)), range(len(columns) - 1, -1, -1)):
        carried = np.zeros_like(columns[0])
        for row in rows:
            carried += columns[row]
            columns[row] = np.minimum(carried, full_well_e)
            carried += over[row] / 2 - columns[row]
    electrons[:, full] = columns
