"""The state of one frame of a trajectory, as renderers and the sky need it."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._environment.earth import R_itrf_from_gcrf
from posse_core._environment.eclipse import sun_angular_radius_rad
from posse_core._environment.time import Epoch
from posse_core._frames import R_eci_from_rtn, matrix_from_quaternion, rtn_spin_rad_s
from posse_core._model.craft_state import Rates
from posse_core._model.joints import RIGID, Articulation
from posse_core._model.scene import FrameState
from posse_core._model.trajectory import Trajectory


def frame_state(
    trajectory: Trajectory, index: int, constants: Constants, articulation: Articulation = RIGID
) -> FrameState:
    """Return the state of frame ``index``, 0 … F−1, with the target's joints."""
    t_s = trajectory.t_s[index]
    epoch = Epoch.from_iso(trajectory.epoch_utc)
    tt = epoch.tt(t_s)
    r_target, r_sun = trajectory.r_target_eci_m[index], trajectory.r_sun_eci_m[index]
    R_eci_from_cam = matrix_from_quaternion(trajectory.q_eci_from_camera[index])
    t_body_cam_m, v_body_cam_m_s = seen_from_chaser(trajectory, index, np.zeros(3), np.zeros(3))
    return FrameState.of(
        index=index,
        sequence=int(trajectory.sequence[index]),
        t_s=float(t_s),
        epoch_jd_tt=float(tt[0] + tt[1]),
        R_cam_from_body=R_eci_from_cam.T @ matrix_from_quaternion(trajectory.q_eci_from_body[index]),
        t_body_cam_m=t_body_cam_m,
        R_cam_from_eci=R_eci_from_cam.T,
        R_ecef_from_eci=R_itrf_from_gcrf(*tt, *epoch.ut1(t_s)),
        r_camera_eci_m=trajectory.r_chaser_eci_m[index],
        v_camera_eci_m_s=trajectory.v_chaser_eci_m_s[index],
        r_target_eci_m=r_target,
        r_sun_eci_m=r_sun,
        r_moon_eci_m=trajectory.r_moon_eci_m[index],
        solar_flux_w_m2=float(trajectory.solar_flux_w_m2[index]),
        sun_fraction_target=float(trajectory.sun_fraction_target[index]),
        sun_fraction_camera=float(trajectory.sun_fraction_camera[index]),
        sun_angular_radius_rad=float(sun_angular_radius_rad(r_target, r_sun, constants.sun_radius_m)),
        rates=Rates(
            v_body_cam_m_s=v_body_cam_m_s,
            omega_body_rad_s=trajectory.omega_body_rad_s[index],
            omega_camera_rad_s=trajectory.omega_camera_rad_s[index],
        ),
        articulation=articulation,
    )


def seen_from_chaser(
    trajectory: Trajectory, index: int, r_rtn_m: FloatArray, v_rtn_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """A body beside the target as the chaser's camera sees it in frame ``index``.

    Args:
        trajectory: of target and chaser.
        index: 0 … F−1.
        r_rtn_m, v_rtn_m_s: (3,) the body's position relative to the target, and its derivative in the
            rotating axes, target's RTN axes; zero for the target itself.

    Returns:
        (3,) position in camera axes, and (3,) velocity relative to the camera, measured in GCRF axes and
        given in camera axes.
    """
    target = trajectory.r_target_eci_m[index], trajectory.v_target_eci_m_s[index]
    R_eci_from_cam = matrix_from_quaternion(trajectory.q_eci_from_camera[index])
    R_cam_from_rtn = R_eci_from_cam.T @ R_eci_from_rtn(*target)
    omega_rtn = rtn_spin_rad_s(*target, trajectory.plane_turn_rad_s[index])
    # The difference of the ECI positions would have the rounding error of an orbit's radius.
    from_body_m = trajectory.r_chaser_rtn_m[index] - r_rtn_m
    v_from_body_m_s = trajectory.v_chaser_rtn_m_s[index] - v_rtn_m_s + np.cross(omega_rtn, from_body_m)
    return -R_cam_from_rtn @ from_body_m, -R_cam_from_rtn @ v_from_body_m_s
