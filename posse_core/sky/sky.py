"""The sky seen from the camera: Earth, Sun and stars. The same for every renderer."""

from __future__ import annotations

import numpy as np

from posse_core.model.arrays import Float32Array, FloatArray
from posse_core.model.bands import SOLAR_BAND_FRACTIONS
from posse_core.model.camera import Camera
from posse_core.model.scene import EnvironmentMap, FrameState
from posse_core.scenario.sky import SkyConfig
from posse_core.sky.ellipsoid import entry_distance_m
from posse_core.sky.stars import hipparcos
from posse_core.sky.sun import box_of_disc, limb_darkened, subpixel_rays
from posse_core.sky.view import SkyView

__all__ = ["STAR_MARGIN_PX", "Sky", "SkyView"]

STAR_MARGIN_PX = 32.0
"""Stars this far outside the image are handed on: a wide PSF brings their light in."""


class Sky:
    """Radiance of the sky by direction at the camera's place.

    Places are geometric, as everything in a scene is: no aberration (20″), no light time.
    """

    def __init__(self, config: SkyConfig, camera: Camera, seed: int) -> None:
        self._config = config
        self._camera = camera
        self._seed = seed

    def look(self, frame: FrameState) -> SkyView:
        """What the camera sees behind the spacecraft."""
        radiance: Float32Array | None = None
        if self._config.sun_disc and frame.sun_fraction_camera > 0:
            radiance = self._with_sun(frame, radiance)
        points_px, irradiance = self._stars(frame)
        return SkyView(radiance, points_px, irradiance)

    def environment(self, frame: FrameState) -> EnvironmentMap | None:
        """Light from everywhere but the Sun and the spacecraft; None where there is none."""
        return None

    def _with_sun(self, frame: FrameState, radiance: Float32Array | None) -> Float32Array | None:
        """Add the Sun's disc; the Earth hides its part."""
        away_m = frame.r_sun_eci_m - frame.r_camera_eci_m
        direction_cam = frame.R_cam_from_eci @ (away_m / np.linalg.norm(away_m))
        box = box_of_disc(self._camera, direction_cam, frame.sun_angular_radius_rad)
        if box.is_empty:
            return radiance
        rays_cam = subpixel_rays(self._camera, box)
        disc = limb_darkened(
            rays_cam,
            direction_cam,
            frame.sun_angular_radius_rad,
            frame.solar_flux_w_m2 * SOLAR_BAND_FRACTIONS,
        )
        disc[self._hidden_by_earth(frame, rays_cam @ frame.R_cam_from_eci)] = 0
        if radiance is None:
            radiance = np.zeros((self._camera.height_px, self._camera.width_px, 3), dtype=np.float32)
        radiance[box.slices] += disc.mean(axis=2)
        return radiance

    def _stars(self, frame: FrameState) -> tuple[FloatArray, FloatArray]:
        """(S, 2) pixels and (S, 3) irradiances of the stars in view."""
        config = self._config.stars
        if config is None:
            return np.empty((0, 2)), np.empty((0, 3))
        field = hipparcos(config.max_magnitude)
        directions = field.directions_at(frame.epoch_jd_tt)
        uv = self._camera.project(directions @ frame.R_cam_from_eci.T)
        low = -0.5 - STAR_MARGIN_PX
        high = np.array([self._camera.width_px, self._camera.height_px]) - 0.5 + STAR_MARGIN_PX
        seen = np.flatnonzero(np.all((uv >= low) & (uv <= high), axis=-1))
        seen = seen[~self._hidden_by_earth(frame, directions[seen])]
        return uv[seen], config.gain * field.irradiance_rgb_w_m2[seen]

    def _hidden_by_earth(self, frame: FrameState, directions_eci: FloatArray) -> np.ndarray:
        """(..., 3) unit vectors → (...) bool. The Earth hides even where it is not shown."""
        origin_m = frame.R_ecef_from_eci @ frame.r_camera_eci_m
        return np.isfinite(entry_distance_m(origin_m, directions_eci @ frame.R_ecef_from_eci.T))
