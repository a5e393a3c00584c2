"""What a renderer is given: a scene that stays, and a frame state that changes.

Everything in a frame state is seen from the camera, so no number is of planetary size where
single precision could be lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core.model.arrays import Float32Array, FloatArray
from posse_core.model.bands import SOLAR_BAND_FRACTIONS
from posse_core.model.camera import Camera, PixelBox
from posse_core.model.spacecraft import Spacecraft


@dataclass(frozen=True)
class Scene:
    """What never changes in a run."""

    spacecraft: Spacecraft
    camera: Camera


@dataclass(frozen=True)
class FrameState:
    """What changes from frame to frame. Camera axes: x right, y down, z forward.

    Attributes:
        index: number of the frame in its run, from 0.
        t_s: seconds since the scenario's epoch.
        epoch_jd_tt: Julian date of this frame in terrestrial time.
        R_cam_from_body: (3, 3): x_cam = R_cam_from_body x_body + t_body_cam_m.
        t_body_cam_m: (3,) the spacecraft's origin in camera axes.
        R_cam_from_eci: (3, 3) from GCRF axes.
        R_ecef_from_eci: (3, 3) the Earth's rotation, GCRF → ITRF.
        r_camera_eci_m, r_target_eci_m, r_sun_eci_m, r_moon_eci_m: (3,) geocentric, GCRF axes.
        solar_flux_w_m2: total irradiance at the target by the whole Sun, at its true distance.
        sun_fraction_target: share of the Sun's disc that the Earth leaves free, seen by the target.
        sun_fraction_camera: the same, seen by the camera.
        sun_angular_radius_rad: of the disc, seen by the target.
    """

    index: int
    t_s: float
    epoch_jd_tt: float
    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
    R_cam_from_eci: FloatArray
    R_ecef_from_eci: FloatArray
    r_camera_eci_m: FloatArray
    r_target_eci_m: FloatArray
    r_sun_eci_m: FloatArray
    r_moon_eci_m: FloatArray
    solar_flux_w_m2: float
    sun_fraction_target: float
    sun_fraction_camera: float
    sun_angular_radius_rad: float

    @property
    def sun_direction_cam(self) -> FloatArray:
        """(3,) unit vector from the target to the Sun, camera axes."""
        away = self.R_cam_from_eci @ (self.r_sun_eci_m - self.r_target_eci_m)
        return np.asarray(away / np.linalg.norm(away))

    @property
    def sun_direction_body(self) -> FloatArray:
        """(3,) unit vector from the target to the Sun, body axes."""
        return np.asarray(self.R_cam_from_body.T @ self.sun_direction_cam)

    @property
    def sun_irradiance_rgb_w_m2(self) -> FloatArray:
        """(3,) irradiance at the target, facing the Sun, in the red, green and blue band."""
        return self.solar_flux_w_m2 * self.sun_fraction_target * SOLAR_BAND_FRACTIONS

    @property
    def range_m(self) -> float:
        """Distance between the camera and the spacecraft's origin."""
        return float(np.linalg.norm(self.t_body_cam_m))


@dataclass(frozen=True)
class EnvironmentMap:
    """Light from everywhere but the Sun and the spacecraft: the sky as an equirectangular map.

    Attributes:
        radiance_rgb: (h, w, 3) float32 radiance, W m⁻² sr⁻¹. Row i, column j is seen in the
            direction, in camera axes, (sin θ sin φ, −cos θ, sin θ cos φ) with θ = π (i + ½)/h
            and φ = 2π (j + ½)/w − π: the middle is forward, the top row is up (−y).
    """

    radiance_rgb: Float32Array


@dataclass(frozen=True)
class RenderRequest:
    """One frame to render.

    Attributes:
        box: the part of the image to render; never empty, never outside the image.
        environment: None where the sky is black.
        seed: for whatever the renderer draws at random in this frame.
    """

    frame: FrameState
    box: PixelBox
    environment: EnvironmentMap | None
    seed: int


@dataclass(frozen=True)
class Radiance:
    """Light from the spacecraft alone, in the box that was asked for.

    Attributes:
        box: the same box as in the request.
        radiance_rgb: (h, w, 3) float32 W m⁻² sr⁻¹ in the red, green and blue band, averaged over the
            pixel; where the craft covers a part of the pixel, the rest counts as black.
        coverage: (h, w) float32, share of the pixel that the craft covers, 0 … 1.
        depth_m: (h, w) float32 planar z at the pixel's centre, NaN off the craft; None where the
            renderer has none. Only cross-checks read it.
    """

    box: PixelBox
    radiance_rgb: Float32Array
    coverage: Float32Array
    depth_m: Float32Array | None = None
