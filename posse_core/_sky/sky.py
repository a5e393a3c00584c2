"""The sky seen from the camera: Earth, Moon, Sun and stars, or a laboratory in their place.

It is the same for every renderer.
"""

from __future__ import annotations

import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray
from posse_core._environment.ephemeris import earth_velocity_m_s
from posse_core._frames import turned
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.scene import EnvironmentMap, FrameState
from posse_core._model.shutter import STEP_PX, fastest_px_s, instants_s, moments
from posse_core._model.sky_view import SkyView
from posse_core._scenario.sky import SkyConfig
from posse_core._sky import moon
from posse_core._sky.atmosphere import RADIUS_M, TOP_M
from posse_core._sky.clouds import make_clouds
from posse_core._sky.earth import Earth, EarthView
from posse_core._sky.ellipsoid import entry_distance_m
from posse_core._sky.environment import environment_map, room_map
from posse_core._sky.ground import blue_marble
from posse_core._sky.laboratory import Room, background
from posse_core._sky.picture import picture
from posse_core._sky.stars import aberrated, hipparcos, random_field
from posse_core._sky.sun import MAX_SUBSAMPLES, box_of_disc, limb_darkened, subpixel_rays

__all__ = ["STAR_MARGIN_PX", "Sky", "SkyView", "sky_speed_px_s"]

STAR_MARGIN_PX = 32.0
"""Stars up to this far outside the image are included, because a wide PSF spreads their light into
it."""
STREAK_POINTS = 1024
"""Maximum number of points in a star's streak."""
_ROW_ITERATIONS = 8


def sky_speed_px_s(camera: Camera, frame: FrameState, *, earth: bool) -> float:
    """Largest speed of the sky in the image, px/s, by the camera's rotation and, with ``earth`` in view,
    by its motion over the Earth."""
    height_m = max(float(np.linalg.norm(frame.r_camera_eci_m)) - RADIUS_M, TOP_M)
    return fastest_px_s(
        camera,
        PixelBox(0, 0, camera.width_px, camera.height_px),
        -frame.R_cam_from_eci @ frame.v_camera_eci_m_s,
        -frame.craft.rates.omega_camera_rad_s,
        height_m if earth else np.inf,
        np.inf,
    )


class Sky:
    """Radiance of the sky by direction, as seen from the camera.

    Stars are where a camera sees them that moves around the Earth and with the Earth around the Sun
    (aberration, up to 5″ and 20″). All other directions are geometric, as everywhere in a scene: light
    time and refraction are neglected. So is the deflection of starlight by the Sun (1.8″ at its limb).
    """

    def __init__(self, config: SkyConfig, camera: Camera, seed: int) -> None:
        """``seed`` is that of the run; it determines the clouds and the random stars."""
        self._config = config
        self._camera = camera
        self._seed = seed
        self._earth = Earth(blue_marble(), make_clouds(seed)) if config.earth else None
        self._last_environment: tuple[FrameState, EnvironmentMap] | None = None

    def look(self, frame: FrameState, exposure_s: float = 0.0, instants: int = 1) -> SkyView:
        """The sky behind the spacecraft, averaged over at most ``instants`` instants of an exposure.

        Which stars the Earth hides is decided at the frame's instant.
        """
        speed_px_s = sky_speed_px_s(self._camera, frame, earth=self._earth is not None)
        radiance_rgb: Float32Array | None = None
        for moment in moments(self._camera, speed_px_s, STEP_PX, exposure_s, instants):
            light = self._background(frame.after(moment.after_s), moment.first_row, moment.rows)
            if light is not None:
                if moment.share != 1:
                    light *= np.float32(moment.share)
                radiance_rgb = light if radiance_rgb is None else radiance_rgb + light
        streaks = STREAK_POINTS if instants > 1 else 1
        offsets_s = instants_s(speed_px_s, STEP_PX, exposure_s, streaks)
        return SkyView(radiance_rgb, *self._stars(frame, speed_px_s, offsets_s))

    def _background(self, frame: FrameState, first_row: int, rows: int) -> Float32Array | None:
        """(H, W, 3) radiance of everything but the stars in some rows, at one instant; None if all is
        black."""
        camera = self._camera
        earth = self._earth.seen(frame) if self._earth is not None else None
        to_moon_m = frame.R_cam_from_eci @ (frame.r_moon_eci_m - frame.r_camera_eci_m)
        to_sun_m = frame.R_cam_from_eci @ (frame.r_sun_eci_m - frame.r_camera_eci_m)
        to_sun = to_sun_m / np.linalg.norm(to_sun_m)
        moon_to_sun = (to_sun_m - to_moon_m) / np.linalg.norm(to_sun_m - to_moon_m)
        sun_rgb_w_m2 = frame.solar_flux_w_m2 * SOLAR_BAND_FRACTIONS
        image = _Image(camera)
        if earth is not None:
            for box, light in picture(earth, camera, first_row, rows):
                image.add(box, light)
        room = self._room(frame)
        if room is not None:
            for box, light in background(room, camera, first_row, rows):
                image.add(box, light)
        moon_rad = float(np.arcsin(min(1.0, moon.RADIUS_M / float(np.linalg.norm(to_moon_m)))))
        box = box_of_disc(camera, to_moon_m / np.linalg.norm(to_moon_m), moon_rad)
        box = box.within_rows(first_row, rows)
        if room is None and not box.is_empty:
            rays = subpixel_rays(camera, box)
            light = moon.radiance(rays, to_moon_m, moon_to_sun, sun_rgb_w_m2)
            image.add(box, (light * self._passed(frame, earth, rays)).mean(axis=2))
        box = box_of_disc(camera, to_sun, frame.craft.sun_angular_radius_rad).within_rows(
            first_row, rows
        )
        if self._config.sun_disc and frame.sun_fraction_camera > 0 and not box.is_empty:
            rays = subpixel_rays(camera, box)
            light = limb_darkened(rays, to_sun, frame.craft.sun_angular_radius_rad, sun_rgb_w_m2)
            image.add(box, (light * self._passed(frame, earth, rays)).mean(axis=2))
        return image.radiance_rgb

    def environment(self, frame: FrameState) -> EnvironmentMap | None:
        """Light from everywhere but the Sun and the spacecraft; None if the scenario has neither an
        Earth nor a laboratory.

        The Moon and the stars are left out: their light is under a thousandth of the Earth's. The last
        map is kept, so that several images with the Earth-shine of one state share it.
        """
        if self._last_environment is None or self._last_environment[0] is not frame:
            room = self._room(frame)
            if room is not None:
                self._last_environment = (frame, room_map(room))
            elif self._earth is not None:
                self._last_environment = (frame, environment_map(self._earth.seen(frame)))
            else:
                return None
        return self._last_environment[1]

    def _room(self, frame: FrameState) -> Room | None:
        """The laboratory around a frame, if the scenario has one."""
        laboratory = self._config.laboratory
        return None if laboratory is None else Room.drawn(laboratory, self._seed, frame.index)

    def _passed(self, frame: FrameState, earth: EarthView | None, rays_cam: FloatArray) -> Float32Array:
        """Transmission of light from behind the Earth: (..., 3) rays → (..., 3).

        Even if the scenario does not show the Earth, it hides what is behind it, but then it has no air.
        """
        if earth is not None:
            return earth.passed(rays_cam, self._camera.pixel_rad / MAX_SUBSAMPLES)
        origin_m = frame.R_ecef_from_eci @ frame.r_camera_eci_m
        rays_ecef = rays_cam @ (frame.R_ecef_from_eci @ frame.R_cam_from_eci.T).T
        open_sky = np.isnan(entry_distance_m(origin_m, rays_ecef))
        return np.repeat(open_sky[..., None].astype(np.float32), 3, axis=-1)

    def _stars(
        self, frame: FrameState, speed_px_s: float, offsets_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(S, 2) image positions, px, and (S, 3) irradiances of the stars in view: one point per star
        and time offset."""
        config, camera, turn = self._config.stars, self._camera, -frame.craft.rates.omega_camera_rad_s
        if config is None:
            return np.empty((0, 2)), np.empty((0, 3))
        if config.catalogue == "hipparcos":
            field = hipparcos(config.max_magnitude)
        else:
            field = random_field(self._seed, config.max_magnitude)
        v_m_s = earth_velocity_m_s(frame.epoch_jd_tt) + frame.v_camera_eci_m_s
        seen_eci = aberrated(field.directions_at(frame.epoch_jd_tt), v_m_s)
        directions_cam = seen_eci @ frame.R_cam_from_eci.T
        open_s = 2 * np.abs(offsets_s).max() + camera.line_time_s * camera.height_px
        near = self._in_view(camera.project(directions_cam), STAR_MARGIN_PX + speed_px_s * open_s)
        earth = self._earth.seen(frame) if self._earth is not None else None
        passed = self._passed(frame, earth, directions_cam[near])
        light = config.gain * field.irradiance_rgb_w_m2[near] * passed
        left = passed.max(axis=-1) > 0
        directions_cam = directions_cam[near][left][:, None]
        after_s = np.broadcast_to(offsets_s, (len(directions_cam), len(offsets_s)))
        uv = camera.project(turned(directions_cam, turn, after_s))
        if camera.line_time_s > 0:
            for _ in range(_ROW_ITERATIONS):
                row_s = camera.row_after_s(np.nan_to_num(uv[..., 1]))
                uv = camera.project(turned(directions_cam, turn, after_s + row_s))
        seen = self._in_view(uv, STAR_MARGIN_PX)
        shares = np.repeat(light[left][:, None] / len(offsets_s), len(offsets_s), axis=1)
        return uv[seen], shares[seen]

    def _in_view(self, uv_px: FloatArray, margin_px: float) -> BoolArray:
        """(..., 2) positions → (...): whether they are in the image or within a margin around it."""
        high = np.array([self._camera.width_px, self._camera.height_px]) - 0.5 + margin_px
        return np.asarray(np.all((uv_px >= -0.5 - margin_px) & (uv_px <= high), axis=-1))


class _Image:
    """Radiance of an image, which stays None until some light is added."""

    def __init__(self, camera: Camera) -> None:
        self._shape = (camera.height_px, camera.width_px, 3)
        self.radiance_rgb: Float32Array | None = None

    def add(self, box: PixelBox, light: Float32Array) -> None:
        """Add the radiance ``light`` (h, w, 3) in a box."""
        if light.max() == 0:
            return
        if self.radiance_rgb is not None:
            self.radiance_rgb[box.slices] += light
            return
        if light.shape == self._shape:
            self.radiance_rgb = np.ascontiguousarray(light)
            return
        self.radiance_rgb = np.zeros(self._shape, dtype=np.float32)
        self.radiance_rgb[box.slices] = light
