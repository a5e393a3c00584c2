"""Heat from behind the spacecraft: the Earth's ground and clouds, the Sun's disc, and space."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._environment.earthlight import emissivity
from posse_core._model.bands import SUN_TEMPERATURE_K
from posse_core._model.scene import FrameState
from posse_core._sensors.thermal.planck import SPACE_K, STEFAN_BOLTZMANN_W_M2_K4, Band
from posse_core._sky.ellipsoid import entry_distance_m

_LATITUDES = 181


def earth_k(sin_latitude: FloatArray, jd_tt: float, solar_flux_w_m2: float) -> FloatArray:
    """Brightness temperature of the Earth by the sine of the latitude, any shape.

    It is that of the zonal infrared exitance of Knocke, Ries & Tapley (1988), which warms the spacecraft
    too: the mean of day and night, of clear sky and clouds, over all wavelengths.
    """
    exitance = emissivity(sin_latitude, np.array(jd_tt)) * solar_flux_w_m2 / 4
    return np.asarray((exitance / STEFAN_BOLTZMANN_W_M2_K4) ** 0.25)


def background_w_m2_sr(directions_cam: FloatArray, state: FrameState, band: Band) -> FloatArray:
    """Radiance in a band from directions (..., 3) of any length, in the axes of the state's camera →
    (...).

    The Earth is the WGS 84 ellipsoid without an atmosphere, so its limb is sharp. The Moon and the stars
    are left out.
    """
    rays = directions_cam / np.sqrt(np.sum(directions_cam**2, axis=-1, keepdims=True))
    radiance = np.full(rays.shape[:-1], float(band.radiance_w_m2_sr(np.array(SPACE_K))))
    chord = 2 * np.sin(state.craft.sun_angular_radius_rad / 2)
    in_sun = np.sum((rays - state.craft.sun_direction_cam) ** 2, axis=-1) < chord**2
    radiance[in_sun] = float(band.radiance_w_m2_sr(np.array(SUN_TEMPERATURE_K)))
    R_ecef_from_cam = state.R_ecef_from_eci @ state.R_cam_from_eci.T
    rays_ecef = np.stack([np.sum(row * rays, axis=-1) for row in R_ecef_from_cam], axis=-1)
    camera_m = state.R_ecef_from_eci @ state.r_camera_eci_m
    distance_m = entry_distance_m(camera_m, rays_ecef)
    hits = np.isfinite(distance_m)
    if hits.any():
        point_m = camera_m + distance_m[hits, None] * rays_ecef[hits]
        sin_latitude = point_m[:, 2] / np.sqrt(np.sum(point_m**2, axis=1))
        sine = np.linspace(-1, 1, _LATITUDES)
        ground = band.radiance_w_m2_sr(earth_k(sine, state.epoch_jd_tt, state.solar_flux_w_m2))
        radiance[hits] = np.interp(sin_latitude, sine, ground)
    return radiance
