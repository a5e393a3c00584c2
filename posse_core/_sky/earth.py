"""The Earth's radiance by direction, as seen from the camera's position."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray, IntArray
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.scene import FrameState
from posse_core._sky.air import AirTables, air_tables, ground_row, limb_row
from posse_core._sky.atmosphere import (
    GROUND_MU_MIN,
    GROUND_SUNS,
    RADIUS_M,
    TOP_M,
    RealArray,
    ground_irradiance,
    sunlight,
)
from posse_core._sky.clouds import Clouds, cover_and_light, drifted, threshold
from posse_core._sky.ellipsoid import SEMI_AXES_M
from posse_core._sky.ground import OCEAN_RGB, Ground, glint_radiance, longitude_turns
from posse_core._sky.pyramid import lookup
from posse_core._sky.surface import Surface

_STRETCH: FloatArray = RADIUS_M / SEMI_AXES_M
"""(3,) scale factors that map the ellipsoid to a sphere of the equatorial radius. Straight lines stay
straight. Vectors scaled by it are called stretched below."""

_FLATTENED = float(SEMI_AXES_M[2] / RADIUS_M)
"""Length of the polar axis in that of the equator's."""

_AIR_STEP_M = 2e3
_MOST_AIR_STEPS = 16
"""How wide a pixel is for which the air above the limb is sampled once, and the most samples of a wider
one."""

LEAST_VIEW_COSINE = 0.02
"""Of the angle between the ground's normal and the way to the camera: what is seen more obliquely counts
as seen so."""

_SAMPLES_ACROSS = 64
"""The fewest samples in the Earth's diameter."""

_RELIEF = np.float32(0.6)
_LOW_SUN = np.float32(0.15)
"""How much darker clouds are by their slope per km away from a Sun in the zenith, and the cosine of the
Sun's zenith angle below which that grows no more."""


@dataclass(frozen=True)
class Earth:
    """The components of the Earth.

    Attributes:
        ground: land and water.
        clouds: None for a clear sky everywhere.
        air: whether there is an atmosphere.
    """

    ground: Ground
    clouds: Clouds | None
    air: bool = True

    def seen(self, frame: FrameState) -> EarthView:
        """The Earth as seen from the camera's position in a frame."""
        return EarthView(self, frame)


@dataclass(frozen=True)
class EarthRays:
    """Rays from the camera, in stretched ECEF axes.

    Attributes:
        directions: (3, n) unit vectors.
        ahead_m: (n,) distance along the ray to its point nearest to the Earth's centre; negative behind
            the camera.
        nearest_m: (n,) distance of that point from the centre.
        pixel_rad: (n,) angular width of the pixel.
        width_m: (n,) width of the pixel there.
        on_ground: (n,) float32 share of the pixel that is below the limb.
        through_air: (n,) whether the rest of the pixel sees the atmosphere above the limb.
    """

    directions: FloatArray
    ahead_m: FloatArray
    nearest_m: FloatArray
    pixel_rad: FloatArray
    width_m: FloatArray
    on_ground: Float32Array
    through_air: BoolArray


class EarthView:
    """The Earth as seen from one position at one time."""

    def __init__(self, earth: Earth, frame: FrameState) -> None:
        self._earth = earth
        self._t_s = frame.t_s
        self.sun_rgb_w_m2 = (frame.solar_flux_w_m2 * SOLAR_BAND_FRACTIONS).astype(np.float32)
        self._R_ecef_from_cam = frame.R_ecef_from_eci @ frame.R_cam_from_eci.T
        self._origin_m = _STRETCH * (frame.R_ecef_from_eci @ frame.r_camera_eci_m)
        self._distance_m = float(np.linalg.norm(self._origin_m))
        sun = frame.R_ecef_from_eci @ frame.r_sun_eci_m
        self._sun = sun / np.linalg.norm(sun)
        zenith = self._origin_m / self._distance_m
        sun_stretched = _STRETCH * self._sun / np.linalg.norm(_STRETCH * self._sun)
        # Azimuths are relative to the Sun's. If the Sun is in the zenith, any reference will do.
        side = np.cross(zenith, sun_stretched)
        if np.linalg.norm(side) < 1e-9:
            side = np.cross(zenith, np.roll(zenith, 1) + np.array([0.1, 0.2, 0.3]))
        side /= np.linalg.norm(side)
        self._azimuth_axes = np.stack([np.cross(side, zenith), side])
        self._sun_zenith_cosine = float(zenith @ sun_stretched)

    @functools.cached_property
    def _air(self) -> AirTables:
        return air_tables(self._distance_m, self._sun_zenith_cosine)

    def light(self, directions_cam: FloatArray, pixel_rad: float | FloatArray) -> Float32Array:
        """Radiance of ground, clouds and air.

        Args:
            directions_cam: (..., 3) of any length, camera axes.
            pixel_rad: angular width of the pixel that a direction represents: one for all n, or (n,).

        Returns:
            (..., 3) W m⁻² sr⁻¹.
        """
        rays = self.rays(directions_cam, pixel_rad)
        radiance = self.air_light(rays)
        ground = np.flatnonzero(rays.on_ground > 0)
        if len(ground):
            surface = Surface(self.surface(rays, ground))
            seen = surface.airlight.copy()
            # At night there is only the air's light, whatever is on the ground.
            lit = np.flatnonzero(surface.is_lit())
            if len(lit):
                seen[:, lit] = self.ground_light(Surface(np.take(surface.fields, lit, axis=1)))
            radiance[ground] += rays.on_ground[ground, None] * seen.T
        return radiance.reshape(directions_cam.shape)

    def air_light(self, rays: EarthRays) -> Float32Array:
        """(n, 3) radiance of the air beyond the limb, W m⁻² sr⁻¹."""
        radiance = np.zeros((rays.ahead_m.size, 3), dtype=np.float32)
        air = np.flatnonzero(rays.through_air)
        if len(air) and self._earth.air:
            # The light is averaged over what the pixel sees above the limb. The heights are closest
            # to each other at the bottom, where the air is densest.
            high_m = rays.nearest_m[air] + rays.width_m[air] / 2 - RADIUS_M
            low_m = np.maximum(0, high_m - rays.width_m[air])
            at_limb_m = np.sqrt(max(0.0, self._distance_m**2 - RADIUS_M**2)) * np.max(rays.pixel_rad)
            count = int(np.clip(np.ceil(at_limb_m / _AIR_STEP_M), 1, _MOST_AIR_STEPS))
            at = ((np.arange(count) + 0.5) / count)[:, None]
            height_m = low_m + at**2 * (high_m - low_m)
            azimuth = np.tile(self._azimuth(rays.directions[:, air]), (count, 1))
            glow = self._air.glow(limb_row(height_m), azimuth)
            share = np.where(height_m <= TOP_M, 2 * at / count, 0).astype(np.float32)
            seen = (1 - rays.on_ground[air, None]) * self.sun_rgb_w_m2
            radiance[air] = np.einsum("cn,cnb->nb", share, glow) * seen
        return radiance

    def passed(self, directions_cam: FloatArray, pixel_rad: float) -> Float32Array:
        """Transmission of light from behind the Earth, by ground and air: (..., 3) directions in camera
        axes → (..., 3)."""
        rays = self.rays(directions_cam, pixel_rad)
        share = np.repeat(1 - rays.on_ground[:, None], 3, axis=1)
        air = np.flatnonzero(rays.through_air)
        if len(air) and self._earth.air:
            share[air] *= self._air.transmission(limb_row(rays.nearest_m[air] - RADIUS_M))
        return share.reshape(directions_cam.shape)

    def rays(self, directions_cam: FloatArray, pixel_rad: float | FloatArray) -> EarthRays:
        """Rays in directions (..., 3) of any length, camera axes; n is the number of them. The width of
        their pixels is one for all or (n,)."""
        d = (_STRETCH[:, None] * self._R_ecef_from_cam) @ directions_cam.reshape(-1, 3).T
        d /= np.sqrt(np.einsum("in,in->n", d, d))
        ahead_m = -(self._origin_m @ d)
        nearest_m = np.sqrt(np.maximum(0, self._distance_m**2 - ahead_m**2))
        pixel_rad = np.broadcast_to(pixel_rad, ahead_m.shape)
        width_m = np.maximum(ahead_m, 1) * pixel_rad
        share = np.clip(0.5 - (nearest_m - RADIUS_M) / width_m, 0, 1)
        on_ground = np.where(ahead_m > 0, share, 0).astype(np.float32)
        lowest_m = nearest_m - width_m / 2
        through_air = (on_ground < 1) & (ahead_m > 0) & (lowest_m < RADIUS_M + TOP_M)
        return EarthRays(d, ahead_m, nearest_m, pixel_rad, width_m, on_ground, through_air)

    def touches(self, directions_cam: FloatArray, reach_rad: float) -> BoolArray:
        """(..., 3) unit vectors, camera axes → (...): whether the Earth or its air is within an angle of
        them."""
        edge_rad = np.arcsin(min(1.0, (RADIUS_M + TOP_M) / (_FLATTENED * self._distance_m)))
        return np.asarray(self._from_nadir_rad(directions_cam) < edge_rad + reach_rad)

    def fills(self, directions_cam: FloatArray, reach_rad: float) -> BoolArray:
        """(..., 3) unit vectors, camera axes → (...): whether all that is within an angle of them is
        ground."""
        edge_rad = np.arcsin(min(1.0, _FLATTENED * RADIUS_M / self._distance_m))
        return np.asarray(self._from_nadir_rad(directions_cam) < edge_rad - reach_rad)

    def _from_nadir_rad(self, directions_cam: FloatArray) -> FloatArray:
        """(..., 3) unit vectors, camera axes → (...) angle from the direction to the Earth's centre."""
        nadir_cam = -(self._R_ecef_from_cam.T @ (self._origin_m / _STRETCH))
        nadir_cam /= np.linalg.norm(nadir_cam)
        return np.asarray(np.arccos(np.clip(directions_cam @ nadir_cam, -1, 1)))

    def samples(self, pixel_rad: float) -> int:
        """How many samples, in each direction, a pixel of a width needs so that there are enough across
        the Earth to find its limb and its terminator."""
        width_rad = 2 * np.arcsin(min(1.0, RADIUS_M / self._distance_m))
        return int(np.clip(np.ceil(_SAMPLES_ACROSS * pixel_rad / width_rad), 1, _SAMPLES_ACROSS))

    def _azimuth(self, d: RealArray) -> Float32Array:
        """(3, n) stretched directions → (n,) angle from the Sun's azimuth, 0 … π."""
        x, y = self._azimuth_axes @ d
        return np.asarray(np.arctan2(np.abs(y), x), dtype=np.float32)

    def surface(self, rays: EarthRays, which: IntArray) -> Float32Array:
        """(Surface.COUNT, k) angles, light and weather where the rays ``which`` (k,) meet the ground.

        For pixels on the limb they are those in the middle of the part that is below it.
        """
        share = rays.on_ground[which].astype(np.float64)
        b_m = np.minimum(rays.nearest_m[which], RADIUS_M - rays.width_m[which] * share / 2)
        view_cosine = np.sqrt(np.maximum(0, 1 - (b_m / RADIUS_M) ** 2))
        way_m = rays.ahead_m[which] - RADIUS_M * view_cosine
        d = rays.directions[:, which].astype(np.float32)
        surface = Surface(np.zeros((Surface.COUNT, d.shape[1]), dtype=np.float32))
        normal = surface.normal
        np.multiply(way_m.astype(np.float32), d, out=normal)
        normal += self._origin_m.astype(np.float32)[:, None]
        normal *= (_STRETCH / RADIUS_M).astype(np.float32)[:, None]
        normal /= np.sqrt(np.einsum("in,in->n", normal, normal))
        sun = self._sun.astype(np.float32)
        sun_cosine = sun @ normal
        unstretched = d / _STRETCH.astype(np.float32)[:, None]
        to_eye = -(sun @ unstretched) / np.sqrt(np.einsum("in,in->n", unstretched, unstretched))
        glint = glint_radiance(sun_cosine, view_cosine.astype(np.float32), to_eye)
        latitude_rad = np.arcsin(np.clip(surface.normal[2], -1, 1))
        surface.longitude[:] = longitude_turns(surface.normal)
        surface.latitude[:] = np.float32(0.5) - latitude_rad * np.float32(1 / np.pi)
        across_m = np.maximum(way_m, 1) * rays.pixel_rad[which]
        footprint_m = across_m / np.sqrt(np.maximum(view_cosine, LEAST_VIEW_COSINE))
        surface.log_footprint[:] = np.log2(footprint_m)
        if self._earth.clouds is not None:
            aridity = self._earth.ground.aridity(surface.longitude, surface.latitude)
            surface.threshold[:] = threshold(latitude_rad) + np.float32(1.2) * aridity
            surface.drifted[:] = drifted(surface.normal, latitude_rad, self._t_s)
            surface.drifted_longitude[:] = longitude_turns(surface.drifted)
            surface.relief[:] = _RELIEF / np.maximum(sun_cosine, _LOW_SUN)
        if not self._earth.air:
            surface.daylight[:] = np.maximum(0, sun_cosine) * np.float32(1 / np.pi)
            surface.sea[:] = glint
        else:
            column = (sun_cosine - GROUND_MU_MIN) * np.float32((GROUND_SUNS - 1) / (1 - GROUND_MU_MIN))
            irradiance = lookup(ground_irradiance(), column, np.zeros_like(column))[:, :3]
            direct = sunlight(np.zeros(()), sun_cosine)
            row = ground_row(view_cosine)
            transmission = self._air.transmission(row)
            surface.daylight[:] = (irradiance * transmission * np.float32(1 / np.pi)).T
            surface.sea[:] = (glint[:, None] * direct * transmission).T
            surface.airlight[:] = self._air.glow(row, self._azimuth(d)).T
        surface.sea[:] += OCEAN_RGB[:, None] * surface.daylight
        surface.fields[Surface.LIGHT] *= np.tile(self.sun_rgb_w_m2, 3)[:, None]
        return surface.fields

    def is_open_sea(self, cells: Surface) -> BoolArray:
        """(n,) whether there is nothing but water within cells, given at their nodes (COUNT, n, k)."""
        return self._earth.ground.is_open_sea(cells.longitude, cells.latitude)

    def ground_light(self, surface: Surface, is_open_sea: bool = False) -> Float32Array:
        """(3, ...) radiance of ground, clouds and the air in front of them, W m⁻² sr⁻¹.

        is_open_sea: whether it is known to be everywhere, so that the map need not be sampled.
        """
        clear: Float32Array = np.ones((), dtype=np.float32)
        bright: Float32Array = np.zeros((), dtype=np.float32)
        if self._earth.clouds is not None:
            cover, bright = self._cover(surface)
            clear = 1 - cover
        day, sea, air = surface.daylight, surface.sea, surface.airlight
        if is_open_sea:
            radiance = sea * clear
            for band, each_day, each_air in zip(radiance, day, air, strict=True):
                band += bright * each_day
                band += each_air
            return radiance
        radiance, water = self._earth.ground.at(
            surface.normal, surface.longitude, surface.latitude, surface.log_footprint
        )
        dry = (1 - water) * clear
        water *= clear
        for band, each_day, each_sea, each_air in zip(radiance, day, sea, air, strict=True):
            band *= dry
            band += bright
            band *= each_day
            band += water * each_sea
            band += each_air
        return radiance

    def _cover(self, surface: Surface) -> tuple[Float32Array, Float32Array]:
        """Cover of clouds, and the reflectance that they add, (...) each."""
        assert self._earth.clouds is not None
        depth, variance, slope = self._earth.clouds.at(
            surface.drifted, surface.drifted_longitude, surface.latitude, surface.log_footprint
        )
        depth -= surface.threshold
        cover, light = cover_and_light(depth, variance)
        # Sides of clouds that face the Sun are brighter, and the more so the lower it is. Those that
        # face away are darker by as much, so that the mean light does not depend on the resolution.
        x, y, z = self._sun.astype(np.float32)
        relief = x * slope[0] + y * slope[1] + z * slope[2]
        relief *= surface.relief
        np.clip(relief, np.float32(-0.3), np.float32(0.3), out=relief)
        np.subtract(1, relief, out=relief)
        relief *= light
        return cover, relief
