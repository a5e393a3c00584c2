"""Builds a trajectory: a propagator's motion with attitude and illumination added."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np

from posse_core._arrays import AnyArray, FloatArray, IntArray, evenly_spread
from posse_core._constants import Constants
from posse_core._environment.earth import R_cirs_from_gcrf, earth_rotation_angle_rad
from posse_core._environment.earthlight import earthlight_on_plate
from posse_core._environment.eclipse import solar_flux_w_m2, sun_fraction
from posse_core._environment.ephemeris import moon_eci_m, sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import ComponentError
from posse_core._frames import eci_from_rtn
from posse_core._interfaces.attitude_law import Surroundings
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion, Trajectory
from posse_core._plugins.registry import Registry
from posse_core._scenario.attitude import Subject
from posse_core._scenario.component import create
from posse_core._scenario.model import Scenario, TimesConfig
from posse_core._trajectory.attitude import GivenAttitude, Laws, as_given, by_law
from posse_core._trajectory.problem import orbit_period_s, resolve
from posse_core._trajectory.returned import propagated

_EXTRA = re.compile("[a-z][a-z0-9_]*")


def make_trajectory(scenario: Scenario, registry: Registry) -> Trajectory:
    """Return the trajectory of a scenario's frames.

    Raises:
        InputError: see :func:`posse_core._trajectory.problem.resolve` and :func:`build_trajectory`.
        ComponentError: see :func:`build_trajectory`.
    """
    name = scenario.propagator.name
    propagator: Propagator = create(registry, "propagator", scenario.propagator)
    trajectory = build_trajectory(
        propagator=propagator,
        problem=frames_problem(scenario, propagator),
        laws=Laws.of(scenario.attitude, registry),
        seed=scenario.seed,
        name=name,
        own_frames="own-frames" in registry.spec("propagator", name).capabilities,
    )
    if scenario.frames is None:
        return trajectory
    return trajectory.rows(evenly_spread(len(trajectory), scenario.frames))


def scenario_problem(scenario: Scenario, propagator: Propagator, t_s: FloatArray) -> PropagationProblem:
    """Return what a propagator is handed of a scenario.

    Args:
        t_s: (F,) seconds after the scenario's epoch.

    Raises:
        InputError: see :func:`posse_core._trajectory.problem.resolve`.
    """
    return resolve(
        scenario.orbit,
        scenario.relative,
        t_s,
        scenario.constants,
        needs_starts=propagator.needs_starts,
        turns_plane=propagator.turns_plane,
    )


def frames_problem(scenario: Scenario, propagator: Propagator) -> PropagationProblem:
    """Return what a propagator is handed for the scenario's frames.

    Raises:
        InputError: see :func:`posse_core._trajectory.problem.resolve`.
    """
    times = scenario.times or TimesConfig(duration_orbits=1.0, count=101)
    is_recorded = not propagator.needs_starts
    if is_recorded and (scenario.times is None or times.recorded_rate_hz is not None):
        t_s = np.zeros(1)  # the orbit of a recorded motion need not have a period
    else:
        t_s = times.seconds(partial(orbit_period_s, scenario.orbit, scenario.constants))
    problem = scenario_problem(scenario, propagator, t_s)
    rate_hz = times.recorded_rate_hz if is_recorded else None
    return replace(problem, requested=scenario.times is not None, recorded_rate_hz=rate_hz)


def build_trajectory(
    *,
    propagator: Propagator,
    problem: PropagationProblem,
    laws: Laws,
    seed: int,
    name: str,
    own_frames: bool = False,
) -> Trajectory:
    """Propagate, and add attitude and illumination. The same arguments give results equal to the bit.

    Args:
        propagator: computes the motion.
        problem: what it propagates.
        laws: attitude laws of target and camera.
        seed: of the run.
        name: of the propagator.
        own_frames: whether its motion may have other times than the problem.

    Raises:
        ComponentError: The propagator failed, or did not return a complete motion; or an attitude law
            failed, or did not return rotations.
        InputError: The problem is outside the propagator's domain or the ephemeris, the target
            passes below the Earth's surface, or an attitude law is undefined at a frame.
    """
    motion = propagated(propagator, problem, name, own_frames=own_frames)
    return trajectory_of(
        motion,
        epoch=problem.epoch,
        laws=laws,
        constants=problem.constants,
        seed=seed,
        indices=np.arange(len(motion.t_s)),
    )


def trajectory_of(
    motion: Motion,
    *,
    epoch: Epoch,
    laws: Laws,
    constants: Constants,
    seed: int,
    indices: IntArray,
    given: GivenAttitude | None = None,
) -> Trajectory:
    """Add attitude and illumination to a motion; each frame depends on its own row alone.

    Args:
        motion: of F frames.
        epoch: the instant of t_s = 0.
        laws: of the attitudes that are not given.
        constants: of the Earth and the Sun.
        seed: of the run.
        indices: (F,) index of each frame, 0 or more, on which its random pointing error depends.
        given: attitudes that replace those of the laws.

    Raises:
        InputError: The motion is outside the ephemeris, the target passes below the Earth's surface,
            an attitude law is undefined at a frame, or a given attitude is not a rotation.
        ComponentError: The motion's extras are not as :class:`Motion` defines them; or a law failed, or
            did not return rotations.
    """
    given = given or GivenAttitude()
    r_target, v_target = motion.r_target_eci_m, motion.v_target_eci_m_s
    r_chaser, v_chaser = eci_from_rtn(
        r_target,
        v_target,
        motion.r_chaser_rtn_m,
        motion.v_chaser_rtn_m_s,
        motion.plane_turn_rad_s,
    )
    tdb = epoch.tdb(motion.t_s)
    r_sun = sun_eci_m(*tdb)
    r_sun_epoch = sun_eci_m(*epoch.tdb(np.zeros(())))

    def around(subject: Subject) -> Surroundings:
        return Surroundings(
            subject=subject,
            epoch=epoch,
            seed=seed,
            t_s=motion.t_s,
            indices=indices,
            r_target_eci_m=r_target,
            v_target_eci_m_s=v_target,
            r_sun_eci_m=r_sun,
            r_sun_epoch_eci_m=r_sun_epoch,
            r_chaser_rtn_m=motion.r_chaser_rtn_m,
        )

    if given.q_eci_from_body is None:
        q_body, omega_body = by_law(laws.target, around("target"), motion.v_chaser_rtn_m_s)
    else:
        q_body, omega_body = as_given(given.q_eci_from_body, given.omega_body_rad_s, "q_eci_from_body")
    if given.q_eci_from_camera is None:
        q_camera, omega_camera = by_law(laws.camera, around("camera"), motion.v_chaser_rtn_m_s)
    else:
        q_camera, omega_camera = as_given(
            given.q_eci_from_camera, given.omega_camera_rad_s, "q_eci_from_camera"
        )
    tt = epoch.tt(motion.t_s)
    pole = R_cirs_from_gcrf(*tt)[..., 2, :]

    def fraction(r_eci_m: AnyArray) -> AnyArray:
        return sun_fraction(
            r_eci_m,
            r_sun,
            earth_radius_m=constants.earth_radius_m,
            sun_radius_m=constants.sun_radius_m,
            flattening=constants.eclipse_flattening,
            earth_pole_eci=pole,
        )

    # These come first, since they refuse what is below the ground.
    sun_fraction_target, sun_fraction_camera = fraction(r_target), fraction(r_chaser)
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
        q_eci_from_body=q_body,
        q_eci_from_camera=q_camera,
        omega_body_rad_s=omega_body,
        omega_camera_rad_s=omega_camera,
        r_sun_eci_m=r_sun,
        r_moon_eci_m=moon_eci_m(*tdb),
        sun_fraction_target=sun_fraction_target,
        sun_fraction_camera=sun_fraction_camera,
        solar_flux_w_m2=flux,
        earth_albedo_w_m2=earthlight.albedo_w_m2,
        earth_infrared_w_m2=earthlight.infrared_w_m2,
        earth_rotation_rad=earth_rotation_angle_rad(*epoch.ut1(motion.t_s)),
        extras={name: _extra(name, array, len(motion.t_s)) for name, array in motion.extras.items()},
    )


def _extra(name: str, array: AnyArray, frames: int) -> FloatArray:
    """Check one of a motion's extras."""
    if not _EXTRA.fullmatch(name):
        raise ComponentError(
            f"the propagator's extra {name!r} needs a name of lower-case letters, digits and _"
        )
    numbers = np.asarray(array)
    if numbers.dtype.kind not in "fiu" or numbers.shape[:1] != (frames,) or numbers.size == 0:
        raise ComponentError(
            f"the propagator's extra {name!r} is {numbers.dtype} of shape {numbers.shape}; it must be"
            f" numbers of shape ({frames}, ...)"
        )
    if not np.all(np.isfinite(numbers)):
        raise ComponentError(f"the propagator's extra {name!r} has a value that is not a finite number")
    return numbers.astype(np.float64)
