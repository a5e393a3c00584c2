"""The sensor ``star-tracker``."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

import posse_core as posse
from posse_star_tracker.catalogue import catalogue
from posse_star_tracker.options import StarTrackerOptions

ARCSEC_RAD = np.pi / 180 / 3600
EARTH_RADIUS_M = 6_378_137.0
ELECTRONS_PER_S_MM2 = 19_100.0
"""By a star of magnitude 0 and class G2 on a silicon detector (Liebe 1995, "Star trackers for attitude
determination", IEEE AES Systems Magazine 10(6), 10-16)."""
LEAST_STARS = 3


class StarTracker(posse.Sensor[StarTrackerOptions]):
    """Measures the directions of the stars in its field of view, and solves for its attitude.

    The tracker looks along its axis +z. Which star is which is known. Directions are corrected for the
    lens and for aberration, as trackers do by calibration and orbit, so what is left are errors of the
    centroids: by photon noise, which smear increases, and a floor.
    """

    def sense(self, look: posse.SensorLook) -> posse.Reading:
        """Labels and arrays are described in the README."""
        R_sensor_from_eci = look.state.R_cam_from_eci
        status = self._blinded_by(look.state)
        stars = catalogue(self.options.max_magnitude)
        direction_eci = stars.directions_at(look.state.epoch_jd_tt)
        true = direction_eci @ R_sensor_from_eci.T
        seen = np.flatnonzero(true[:, 2] > np.cos(np.radians(self.options.fov_deg / 2)))
        if status is not None:
            seen = seen[:0]
        seen = seen[~look.rays(true[seen]).hit]
        sigma_rad = self._sigma_rad(stars.magnitude[seen], look.state.craft.rates.omega_camera_rad_s)
        noise_rad = look.generator("centroids").normal(0.0, sigma_rad[:, None], (len(seen), 3))
        measured = true[seen] + noise_rad  # what is along the direction itself changes nothing
        measured /= np.linalg.norm(measured, axis=1, keepdims=True)
        if status is None and len(seen) < LEAST_STARS:
            status = "stars"
        q = attitude_sigma_rad = None
        if status is None:
            q, attitude_sigma_rad = attitude(measured, direction_eci[seen], sigma_rad)
        return posse.Reading(
            labels={
                "blinded_by": status,
                "q_eci_from_sensor": q,
                "sigma_rad": attitude_sigma_rad,
                "true_q_eci_from_sensor": _quaternion(Rotation.from_matrix(R_sensor_from_eci.T)),
            },
            arrays={
                "hip": stars.hip[seen],
                "direction_eci": direction_eci[seen],
                "direction_sensor": measured,
                "sigma_rad": sigma_rad,
            },
        )

    def faults(self, stored: posse.StoredReading) -> Iterator[str]:
        """Directions and attitude agree with the truth within their errors, and no star is hidden."""
        labels, arrays = stored.reading.labels, stored.reading.arrays
        to_eci = Rotation.from_quat(labels["true_q_eci_from_sensor"], scalar_first=True)
        true = to_eci.apply(arrays["direction_eci"], inverse=True).reshape(-1, 3)
        error_rad = np.linalg.norm(arrays["direction_sensor"] - true, axis=1)
        for hip, error in zip(arrays["hip"], error_rad / arrays["sigma_rad"], strict=True):
            if error > 7:
                yield f"the direction of HIP {hip} is off by {error:.1f} standard deviations"
        hidden = np.isfinite(stored.distances_m(true, [0, 0, 0], 0)) if len(true) else np.zeros(0, bool)
        for hip in arrays["hip"][hidden]:
            yield f"HIP {hip} is behind the spacecraft"
        if labels["q_eci_from_sensor"] is not None:
            found = Rotation.from_quat(labels["q_eci_from_sensor"], scalar_first=True)
            away = (to_eci.inv() * found).as_rotvec() / labels["sigma_rad"]
            if np.abs(away).max() > 7:
                yield f"the attitude is off by {np.abs(away).max():.1f} standard deviations"

    def _blinded_by(self, state: posse.FrameState) -> str | None:
        """What keeps the tracker from seeing stars: the Sun, the Earth, its own turn, or nothing."""
        options, axis_eci = self.options, state.R_cam_from_eci[2]
        r_m = float(np.linalg.norm(state.r_camera_eci_m))
        limb_rad = np.arcsin(EARTH_RADIUS_M / r_m)
        sun_angle = _angle_rad(axis_eci, state.r_sun_eci_m - state.r_camera_eci_m)
        if state.sun_fraction_camera > 0 and sun_angle < np.radians(options.sun_exclusion_deg):
            return "sun"
        earth_angle = _angle_rad(axis_eci, -state.r_camera_eci_m)
        if earth_angle < limb_rad + np.radians(options.earth_exclusion_deg):
            return "earth"
        rate_rad_s = np.linalg.norm(state.craft.rates.omega_camera_rad_s)
        return "rate" if rate_rad_s > np.radians(options.max_rate_deg_s) else None

    def _sigma_rad(self, magnitude: posse.FloatArray, omega_rad_s: posse.FloatArray) -> posse.FloatArray:
        """(S,) standard deviations of the directions about each axis across them.

        The centroid of N photons whose directions scatter by σ is known to σ/√N. While the shutter is
        open a star moves evenly by ω t, which adds (ω t)²/12 to σ²; that is taken for both axes.
        """
        options = self.options
        area_mm2 = np.pi / 4 * options.aperture_mm**2
        electrons = ELECTRONS_PER_S_MM2 * area_mm2 * options.exposure_s * 10 ** (-0.4 * magnitude)
        smear_rad2 = float(omega_rad_s @ omega_rad_s) * options.exposure_s**2 / 12
        blur_rad2 = (ARCSEC_RAD * options.blur_arcsec) ** 2 + smear_rad2
        return np.asarray(np.sqrt(blur_rad2 / electrons + (ARCSEC_RAD * options.floor_arcsec) ** 2))


def attitude(
    direction_sensor: posse.FloatArray, direction_eci: posse.FloatArray, sigma_rad: posse.FloatArray
) -> tuple[list[float], list[float]]:
    """The attitude that fits directions best (Wahba's problem), and its errors.

    Args:
        direction_sensor, direction_eci: (S, 3) unit vectors, S ≥ 2.
        sigma_rad: (S,) standard deviations of the first about each axis across them.

    Returns:
        q_eci_from_sensor, scalar first, and the standard deviations of the attitude about the sensor's
        axes, rad, by the covariance of Shuster and Oh 1981 (doi:10.2514/3.19717, eq. 92).
    """
    weights = sigma_rad**-2
    found, _ = Rotation.align_vectors(direction_eci, direction_sensor, weights)
    across = np.eye(3) - direction_sensor[:, :, None] * direction_sensor[:, None, :]
    covariance = np.linalg.inv(np.sum(weights[:, None, None] * across, axis=0))
    return _quaternion(found), np.sqrt(np.diag(covariance)).tolist()


def _quaternion(rotation: Rotation) -> list[float]:
    """Scalar first, w ≥ 0."""
    return rotation.as_quat(canonical=True, scalar_first=True).tolist()  # type: ignore[no-any-return]


def _angle_rad(a: posse.FloatArray, b: posse.FloatArray) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
