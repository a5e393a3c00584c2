"""The Earth's radiance by direction, as seen from the camera's position."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.scene import FrameState
from posse_core._sky.atmosphere import (
    GROUND_MU_MIN,
    GROUND_SUNS,
    RADIUS_M,
    TOP_M,
    AirTables,
    air_tables,
    ground_irradiance,
    ground_row,
    limb_row,
    sunlight,
)
from posse_core._sky.clouds import Clouds
from posse_core._sky.ellipsoid import SEMI_AXES_M
from posse_core._sky.ground import OCEAN_RGB, Ground, glint_radiance
from posse_core._sky.pyramid import lookup

_STRETCH: FloatArray = RADIUS_M / SEMI_AXES_M
"""(3,) scale factors that map the ellipsoid to a sphere of the equatorial radius. Straight lines stay
straight. Vectors scaled by it are called stretched below."""


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
class _Rays:
    """Rays from the camera, in stretched ECEF axes.

    Attributes:
        directions: (n, 3) unit vectors.
        ahead_m: (n,) distance along the ray to its point nearest to the Earth's centre; negative behind
            the camera.
        nearest_m: (n,) distance of that point from the centre.
        on_ground: (n,) float32 share of the pixel that is below the limb.
        through_air: (n,) whether the rest of the pixel sees the atmosphere above the limb.
    """

    directions: FloatArray
    ahead_m: FloatArray
    nearest_m: FloatArray
    on_ground: Float32Array
    through_air: BoolArray


class EarthView:
    """The Earth as seen from one position at one time."""

    def __init__(self, earth: Earth, frame: FrameState) -> None:
        self._earth = earth
        self._t_s = frame.t_s
        self._sun_rgb_w_m2 = (frame.solar_flux_w_m2 * SOLAR_BAND_FRACTIONS).astype(np.float32)
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

    def light(self, directions_cam: FloatArray, pixel_rad: float) -> Float32Array:
        """Radiance of ground, clouds and air.

        Args:
            directions_cam: (..., 3) of any length, camera axes.
            pixel_rad: angular width of the pixel that each direction represents.

        Returns:
            (..., 3) W m⁻² sr⁻¹.
        """
        rays = self._rays(directions_cam, pixel_rad)
        radiance = np.zeros((len(rays.directions), 3), dtype=np.float32)
        ground = np.flatnonzero(rays.on_ground > 0)
        air = np.flatnonzero(rays.through_air)
        if len(air) and self._earth.air:
            glow, _ = self._air.sample(
                limb_row(rays.nearest_m[air] - RADIUS_M), self._azimuth(rays.directions[air])
            )
            radiance[air] = (1 - rays.on_ground[air, None]) * glow * self._sun_rgb_w_m2
        if len(ground):
            seen = self._ground(
                rays.directions[ground], rays.ahead_m[ground], rays.nearest_m[ground], pixel_rad
            )
            radiance[ground] += rays.on_ground[ground, None] * seen
        return radiance.reshape(directions_cam.shape)

    def passed(self, directions_cam: FloatArray, pixel_rad: float) -> Float32Array:
        """Transmission of light from behind the Earth, by ground and air: (..., 3) directions in camera
        axes → (..., 3)."""
        rays = self._rays(directions_cam, pixel_rad)
        share = np.repeat(1 - rays.on_ground[:, None], 3, axis=1)
        air = np.flatnonzero(rays.through_air)
        if len(air) and self._earth.air:
            _, transmission = self._air.sample(
                limb_row(rays.nearest_m[air] - RADIUS_M), self._azimuth(rays.directions[air])
            )
            share[air] *= transmission
        return share.reshape(directions_cam.shape)

    def _rays(self, directions_cam: FloatArray, pixel_rad: float) -> _Rays:
        d = directions_cam.reshape(-1, 3) @ (_STRETCH[:, None] * self._R_ecef_from_cam).T
        d /= np.sqrt(np.einsum("ni,ni->n", d, d))[:, None]
        ahead_m = -(d @ self._origin_m)
        nearest_m = np.sqrt(np.maximum(0, self._distance_m**2 - ahead_m**2))
        width_m = np.maximum(ahead_m, 1) * pixel_rad
        share = np.clip(0.5 - (nearest_m - RADIUS_M) / width_m, 0, 1)
        on_ground = np.where(ahead_m > 0, share, 0).astype(np.float32)
        through_air = (on_ground < 1) & (ahead_m > 0) & (nearest_m < RADIUS_M + TOP_M)
        return _Rays(d, ahead_m, nearest_m, on_ground, through_air)

    def touches(self, directions_cam: FloatArray, reach_rad: float) -> BoolArray:
        """(..., 3) unit vectors, camera axes → (...): whether the Earth or its air is within an angle of
        them."""
        nadir_cam = -(self._R_ecef_from_cam.T @ (self._origin_m / _STRETCH))
        nadir_cam /= np.linalg.norm(nadir_cam)
        edge = np.arcsin(min(1.0, (RADIUS_M + TOP_M) / (SEMI_AXES_M[2] / RADIUS_M * self._distance_m)))
        from_nadir = np.arccos(np.clip(directions_cam @ nadir_cam, -1, 1))
        return np.asarray(from_nadir < edge + reach_rad)

    def _azimuth(self, d: FloatArray) -> Float32Array:
        """(n, 3) stretched directions → (n,) angle from the Sun's azimuth, 0 … π."""
        x, y = self._azimuth_axes @ d.T
        return np.asarray(np.arctan2(np.abs(y), x), dtype=np.float32)

    def _ground(
        self, d: FloatArray, ahead_m: FloatArray, b_m: FloatArray, pixel_rad: float
    ) -> Float32Array:
        """(n, 3) radiance of ground, clouds and the air in front of them, for stretched rays."""
        view_cosine = np.sqrt(np.maximum(0, 1 - (b_m / RADIUS_M) ** 2))
        way_m = ahead_m - RADIUS_M * view_cosine
        normal = ((self._origin_m[:, None] + way_m * d.T) * (_STRETCH / RADIUS_M)[:, None]).astype(
            np.float32
        )
        normal /= np.sqrt(np.einsum("in,in->n", normal, normal))
        sun_cosine = self._sun.astype(np.float32) @ normal
        footprint_m = (way_m * pixel_rad / np.sqrt(np.maximum(view_cosine, 0.02))).astype(np.float32)
        latitude = np.arcsin(np.clip(normal[2], -1, 1))
        land, water = self._earth.ground.at(normal, latitude, footprint_m)
        diffuse = land + water[:, None] * (OCEAN_RGB - land)
        view32 = view_cosine.astype(np.float32)
        to_eye = -(d / _STRETCH) @ self._sun / np.linalg.norm(d / _STRETCH, axis=1)
        glint = water * glint_radiance(sun_cosine, view32, to_eye.astype(np.float32))
        if not self._earth.air:
            irradiance = np.maximum(0, sun_cosine)[:, None] * np.ones(3, dtype=np.float32)
            direct: Float32Array = np.ones((1, 3), dtype=np.float32)
        else:
            column = (sun_cosine - GROUND_MU_MIN) * np.float32((GROUND_SUNS - 1) / (1 - GROUND_MU_MIN))
            irradiance = lookup(ground_irradiance(), column, np.zeros_like(column))
            direct = sunlight(np.zeros_like(sun_cosine), sun_cosine)
        radiance = irradiance * diffuse * np.float32(1 / np.pi) + glint[:, None] * direct
        if self._earth.clouds is not None:
            self._cover(radiance, irradiance, normal, latitude, sun_cosine, footprint_m)
        if self._earth.air:
            glow, transmission = self._air.sample(ground_row(view_cosine), self._azimuth(d))
            radiance = radiance * transmission + glow
        return np.asarray(radiance * self._sun_rgb_w_m2)

    def _cover(
        self,
        radiance: Float32Array,
        irradiance: Float32Array,
        normal: Float32Array,
        latitude: Float32Array,
        sun_cosine: Float32Array,
        footprint_m: Float32Array,
    ) -> None:
        """Add clouds to the ground's ``radiance`` (n, 3), in place. Radiance and irradiance are per
        solar irradiance."""
        assert self._earth.clouds is not None
        field, lost, slope = self._earth.clouds.at(normal, latitude, footprint_m, self._t_s)
        field -= np.float32(1.2) * self._earth.ground.aridity(normal, latitude, footprint_m)
        depth = field / (1 + 1.5 * lost)
        cover = np.clip(depth / 1.1 + 0.35, 0, 1)
        cover *= cover * (3 - 2 * cover)
        # Sides of clouds that face the Sun are brighter, and the more so the lower it is.
        relief = -(self._sun.astype(np.float32) @ slope) / np.maximum(sun_cosine, 0.15)
        thick = 1 - np.exp(-np.maximum(depth, 0))
        bright = (0.46 + 0.48 * thick) * np.clip(1 + 0.6 * relief, 0.65, 1.25)
        radiance *= (1 - cover)[:, None]
        radiance += (cover * bright * np.float32(1 / np.pi))[:, None] * irradiance
