"""Motion of target and chaser over the frames of a run."""

from __future__ import annotations

from dataclasses import dataclass

from posse_core._arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Motion:
    """What a propagator computes, for F frames. RTN: see ``posse_core._frames``.

    Attributes:
        t_s: (F,) seconds since the scenario's epoch.
        r_target_eci_m, v_target_eci_m_s: (F, 3) GCRF axes, geocentric.
        r_chaser_rtn_m: (F, 3) the chaser's position relative to the target, target's RTN axes.
        v_chaser_rtn_m_s: (F, 3) its derivative in the rotating RTN frame.
        sequence: (F,) int; frames of one continuous relative orbit have one number.
    """

    t_s: FloatArray
    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    r_chaser_rtn_m: FloatArray
    v_chaser_rtn_m_s: FloatArray
    sequence: IntArray


@dataclass(frozen=True)
class Trajectory:
    """Motion, attitude and light, for F frames: all that a scene needs of the dynamics.

    Attributes:
        epoch_utc: ISO 8601, of t_s = 0.
        t_s: (F,).
        sequence: (F,) int.
        r_target_eci_m, v_target_eci_m_s, r_chaser_eci_m, v_chaser_eci_m_s: (F, 3) GCRF axes.
        r_chaser_rtn_m, v_chaser_rtn_m_s: (F, 3) relative to the target; rotating-frame derivative.
        q_eci_from_body, q_eci_from_camera: (F, 4) unit, scalar first, w ≥ 0.
        omega_body_rad_s, omega_camera_rad_s: (F, 3) rate of turn against GCRF axes, in the axes of
            the body and of the camera.
        r_sun_eci_m, r_moon_eci_m: (F, 3) geocentric, geometric.
        sun_fraction_target, sun_fraction_camera: (F,) share of the Sun's disc in view, 0 … 1.
        solar_flux_w_m2: (F,) at the target, of the whole disc.
        earth_albedo_w_m2, earth_infrared_w_m2: (F,) the Earth's reflected and own light on a plate
            at the target that faces the Earth's centre.
        earth_rotation_rad: (F,) Earth rotation angle, 0 … 2π.
    """

    epoch_utc: str
    t_s: FloatArray
    sequence: IntArray
    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    r_chaser_rtn_m: FloatArray
    v_chaser_rtn_m_s: FloatArray
    r_chaser_eci_m: FloatArray
    v_chaser_eci_m_s: FloatArray
    q_eci_from_body: FloatArray
    q_eci_from_camera: FloatArray
    omega_body_rad_s: FloatArray
    omega_camera_rad_s: FloatArray
    r_sun_eci_m: FloatArray
    r_moon_eci_m: FloatArray
    sun_fraction_target: FloatArray
    sun_fraction_camera: FloatArray
    solar_flux_w_m2: FloatArray
    earth_albedo_w_m2: FloatArray
    earth_infrared_w_m2: FloatArray
    earth_rotation_rad: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)
