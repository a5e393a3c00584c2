"""From a propagator's motion to a trajectory: attitude and light added; a frame's state; files."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._attitude.camera import R_eci_from_camera
from posse_core._attitude.target import R_eci_from_body, Surroundings
from posse_core._constants import Constants
from posse_core._dynamics.orbit import orbit_epoch
from posse_core._environment.earth import (
    R_cirs_from_gcrf,
    R_itrf_from_gcrf,
    earth_rotation_angle_rad,
)
from posse_core._environment.earthlight import earthlight_on_plate
from posse_core._environment.eclipse import solar_flux_w_m2, sun_angular_radius_rad, sun_fraction
from posse_core._environment.ephemeris import moon_eci_m, sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.tables import read_table, write_table
from posse_core._frames import (
    R_eci_from_rtn,
    eci_from_rtn,
    matrix_from_quaternion,
    quaternion_from_matrix,
    rotation_vector_from_matrix,
    rtn_rate_rad_s,
)
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.scene import FrameState, Rates
from posse_core._model.trajectory import Trajectory
from posse_core._scenario.attitude import AttitudeConfig

_RATE_STEP_S = 1e-3
"""Half the step of rates of turn; a steady turn comes out exact, whatever the step."""


def build_trajectory(
    *,
    propagator: Propagator,
    problem: PropagationProblem,
    attitude: AttitudeConfig,
    seed: int,
) -> Trajectory:
    """Propagate, and add attitude and light. The same arguments give the same bits.

    Raises:
        InputError: the problem is outside the propagator's domain or the ephemeris, the target
            passes below the Earth's surface, or an attitude law is undetermined at a frame.
    """
    constants = problem.constants
    epoch = orbit_epoch(problem.orbit)
    motion = propagator.propagate(problem)
    r_target, v_target = motion.r_target_eci_m, motion.v_target_eci_m_s
    r_chaser, v_chaser = eci_from_rtn(r_target, v_target, motion.r_chaser_rtn_m, motion.v_chaser_rtn_m_s)
    tdb = epoch.tdb(motion.t_s)
    r_sun = sun_eci_m(*tdb)
    around = Surroundings(
        epoch=epoch,
        t_s=motion.t_s,
        r_target_eci_m=r_target,
        v_target_eci_m_s=v_target,
        r_sun_eci_m=r_sun,
        r_sun_epoch_eci_m=sun_eci_m(*epoch.tdb(np.zeros(()))),
        r_chaser_rtn_m=motion.r_chaser_rtn_m,
    )
    R_eci_body, omega_body = _turning(
        lambda near: R_eci_from_body(attitude.target, near), around, motion.v_chaser_rtn_m_s
    )
    R_eci_camera, omega_camera = _turning(
        lambda near: R_eci_from_camera(attitude.camera, near, seed), around, motion.v_chaser_rtn_m_s
    )
    tt = epoch.tt(motion.t_s)
    pole = R_cirs_from_gcrf(*tt)[..., 2, :]
    flux = solar_flux_w_m2(
        r_target, r_sun, solar_constant_w_m2=constants.solar_constant_w_m2, au_m=constants.au_m
    )
    earthlight = earthlight_on_plate(
        r_eci_m=r_target,
        normal_eci=-r_target,
        r_sun_eci_m=r_sun,
        earth_pole_eci=pole,
        jd_tt=tt[0] + tt[1],
        solar_flux_w_m2=flux,
        earth_radius_m=constants.earth_radius_m,
    )

    def fraction(r_eci_m: AnyArray) -> AnyArray:
        return sun_fraction(
            r_eci_m,
            r_sun,
            earth_radius_m=constants.earth_radius_m,
            sun_radius_m=constants.sun_radius_m,
            flattening=constants.eclipse_flattening,
            earth_pole_eci=pole,
        )

    return Trajectory(
        epoch_utc=epoch.iso(),
        t_s=motion.t_s,
        sequence=motion.sequence,
        r_target_eci_m=r_target,
        v_target_eci_m_s=v_target,
        r_chaser_rtn_m=motion.r_chaser_rtn_m,
        v_chaser_rtn_m_s=motion.v_chaser_rtn_m_s,
        r_chaser_eci_m=r_chaser,
        v_chaser_eci_m_s=v_chaser,
        q_eci_from_body=quaternion_from_matrix(R_eci_body),
        q_eci_from_camera=quaternion_from_matrix(R_eci_camera),
        omega_body_rad_s=omega_body,
        omega_camera_rad_s=omega_camera,
        r_sun_eci_m=r_sun,
        r_moon_eci_m=moon_eci_m(*tdb),
        sun_fraction_target=fraction(r_target),
        sun_fraction_camera=fraction(r_chaser),
        solar_flux_w_m2=flux,
        earth_albedo_w_m2=earthlight.albedo_w_m2,
        earth_infrared_w_m2=earthlight.infrared_w_m2,
        earth_rotation_rad=earth_rotation_angle_rad(*epoch.ut1(motion.t_s)),
    )


def _turning(
    law: Callable[[Surroundings], FloatArray], around: Surroundings, v_chaser_rtn_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Attitude (F, 3, 3) by a law, and its rate (F, 3) in its own axes, by a central difference.

    What a law draws at random stays as it is: a camera's jitter is between frames, not within one.
    """

    def near(after_s: float) -> FloatArray:
        moved = dataclasses.replace(
            around,
            t_s=around.t_s + after_s,
            r_target_eci_m=around.r_target_eci_m + after_s * around.v_target_eci_m_s,
            r_chaser_rtn_m=around.r_chaser_rtn_m + after_s * v_chaser_rtn_m_s,
        )
        return law(moved)

    turn = np.swapaxes(near(-_RATE_STEP_S), -1, -2) @ near(_RATE_STEP_S)
    return law(around), rotation_vector_from_matrix(turn) / (2 * _RATE_STEP_S)


def frame_state(trajectory: Trajectory, index: int, constants: Constants) -> FrameState:
    """What a renderer and the sky need of frame ``index``, 0 … F−1."""
    t_s = trajectory.t_s[index]
    epoch = Epoch.from_iso(trajectory.epoch_utc)
    tt = epoch.tt(t_s)
    r_target, r_sun = trajectory.r_target_eci_m[index], trajectory.r_sun_eci_m[index]
    R_eci_from_cam = matrix_from_quaternion(trajectory.q_eci_from_camera[index])
    v_target, r_rtn = trajectory.v_target_eci_m_s[index], trajectory.r_chaser_rtn_m[index]
    R_cam_from_rtn = R_eci_from_cam.T @ R_eci_from_rtn(r_target, v_target)
    omega_rtn = np.array([0.0, 0.0, float(rtn_rate_rad_s(r_target, v_target))])
    v_rtn = trajectory.v_chaser_rtn_m_s[index] + np.cross(omega_rtn, r_rtn)
    return FrameState.of(
        index=index,
        sequence=int(trajectory.sequence[index]),
        t_s=float(t_s),
        epoch_jd_tt=float(tt[0] + tt[1]),
        R_cam_from_body=R_eci_from_cam.T @ matrix_from_quaternion(trajectory.q_eci_from_body[index]),
        # Not from the difference of the ECI positions, whose rounding is planetary.
        t_body_cam_m=-R_cam_from_rtn @ r_rtn,
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
            v_body_cam_m_s=-R_cam_from_rtn @ v_rtn,
            omega_body_rad_s=trajectory.omega_body_rad_s[index],
            omega_camera_rad_s=trajectory.omega_camera_rad_s[index],
        ),
    )


def save_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write ``.npz`` or ``.csv`` with the fields of :class:`Trajectory` by name (see ``tables``).

    Raises:
        InputError: the name ends otherwise.
    """
    write_table(path, trajectory.epoch_utc, {name: getattr(trajectory, name) for name in _FIELDS})


def load_trajectory(path: Path) -> Trajectory:
    """Read what :func:`save_trajectory` wrote, to the bit.

    Raises:
        InputError: the file is missing, of another kind, lacks a field, or has a value that is no
            finite number; the message names the file and the field.
    """
    table = read_table(path, _FIELDS)
    if table.epoch_utc is None:
        raise InputError(f"{path} has no 'epoch_utc'; files of 'posse propagate' have")
    arrays: dict[str, AnyArray] = {name: table[name] for name in _FIELDS}
    arrays["sequence"] = arrays["sequence"].astype(np.int64)
    return Trajectory(epoch_utc=table.epoch_utc, **arrays)


_FIELDS = tuple(field.name for field in dataclasses.fields(Trajectory) if field.name != "epoch_utc")
