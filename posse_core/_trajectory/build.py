"""From a propagator's motion to a trajectory: attitude and light added."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from posse_core._arrays import AnyArray, FloatArray, IntArray, evenly_spread
from posse_core._attitude.camera import R_eci_from_camera
from posse_core._attitude.target import R_eci_from_body, Surroundings
from posse_core._constants import Constants
from posse_core._environment.earth import R_cirs_from_gcrf, earth_rotation_angle_rad
from posse_core._environment.earthlight import earthlight_on_plate
from posse_core._environment.eclipse import solar_flux_w_m2, sun_fraction
from posse_core._environment.ephemeris import moon_eci_m, sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import ComponentError, InputError
from posse_core._frames import eci_from_rtn, quaternion_from_matrix, rotation_vector_from_matrix
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion, Trajectory
from posse_core._plugins.registry import Registry
from posse_core._scenario.attitude import AttitudeConfig
from posse_core._scenario.component import create
from posse_core._scenario.model import Scenario
from posse_core._trajectory.problem import orbit_period_s, resolve
from posse_core._trajectory.returned import propagated

_RATE_STEP_S = 1e-3
"""Half the step of rates of turn; a steady turn comes out exact, whatever the step."""
_LARGEST_NORM_ERROR = 1e-3
"""Of a quaternion that is given: further from a length of one, it is a mistake and not rounding."""
_EXTRA = re.compile("[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class GivenAttitude:
    """Attitudes that are given for F frames; where one is None, the scenario's law holds.

    Attributes:
        q_eci_from_body, q_eci_from_camera: (F, 4) of length one, scalar first, or None.
        omega_body_rad_s, omega_camera_rad_s: (F, 3) rate of turn against GCRF axes, in the axes of the
            body and of the camera; None is at rest. Only an attitude that is given has a given rate.
    """

    q_eci_from_body: FloatArray | None = None
    q_eci_from_camera: FloatArray | None = None
    omega_body_rad_s: FloatArray | None = None
    omega_camera_rad_s: FloatArray | None = None


def make_trajectory(scenario: Scenario, registry: Registry) -> Trajectory:
    """The trajectory of a scenario's frames.

    Raises:
        InputError: see :func:`posse_core._trajectory.problem.resolve` and :func:`build_trajectory`.
        ComponentError: see :func:`build_trajectory`.
    """
    name = scenario.propagator.name
    propagator: Propagator = create(registry, "propagator", scenario.propagator)
    problem = resolve(
        scenario.orbit,
        scenario.relative,
        times_s(scenario),
        scenario.constants,
        needs_starts=propagator.needs_starts,
    )
    trajectory = build_trajectory(
        propagator=propagator,
        problem=problem,
        attitude=scenario.attitude,
        seed=scenario.seed,
        name=name,
        own_frames="own-frames" in registry.spec("propagator", name).capabilities,
    )
    if scenario.frames is None:
        return trajectory
    return trajectory.rows(evenly_spread(len(trajectory), scenario.frames))


def times_s(scenario: Scenario) -> FloatArray:
    """(T,) seconds after the epoch at which the scenario asks for frames."""
    return scenario.times.seconds(partial(orbit_period_s, scenario.orbit, scenario.constants))


def build_trajectory(
    *,
    propagator: Propagator,
    problem: PropagationProblem,
    attitude: AttitudeConfig,
    seed: int,
    name: str,
    own_frames: bool = False,
) -> Trajectory:
    """Propagate, and add attitude and light by the laws. The same arguments give the same bits.

    Args:
        name: of the propagator.
        own_frames: its motion may have other times than the problem's.

    Raises:
        ComponentError: the propagator failed, or did not return a whole motion.
        InputError: the problem is outside the propagator's domain or the ephemeris, the target
            passes below the Earth's surface, or an attitude law is undetermined at a frame.
    """
    motion = propagated(propagator, problem, name, own_frames=own_frames)
    return trajectory_of(
        motion,
        epoch=problem.epoch,
        attitude=attitude,
        constants=problem.constants,
        seed=seed,
        indices=np.arange(len(motion.t_s)),
    )


def trajectory_of(
    motion: Motion,
    *,
    epoch: Epoch,
    attitude: AttitudeConfig,
    constants: Constants,
    seed: int,
    indices: IntArray,
    given: GivenAttitude | None = None,
) -> Trajectory:
    """A motion with attitude and light added; each frame depends on its own row alone.

    Args:
        epoch: of t_s = 0.
        attitude: laws of the attitudes that are not given.
        seed: of the run.
        indices: (F,) the number that each frame draws its random pointing by, 0 or more.
        given: attitudes in the place of the laws'.

    Raises:
        InputError: the motion is outside the ephemeris, the target passes below the Earth's surface,
            an attitude law is undetermined at a frame, or a given attitude is no rotation.
        ComponentError: the motion's extras are not as :class:`Motion` has them.
    """
    given = given or GivenAttitude()
    r_target, v_target = motion.r_target_eci_m, motion.v_target_eci_m_s
    r_chaser, v_chaser = eci_from_rtn(r_target, v_target, motion.r_chaser_rtn_m, motion.v_chaser_rtn_m_s)
    tdb = epoch.tdb(motion.t_s)
    r_sun = sun_eci_m(*tdb)
    around = Surroundings(
        epoch=epoch,
        t_s=motion.t_s,
        indices=indices,
        r_target_eci_m=r_target,
        v_target_eci_m_s=v_target,
        r_sun_eci_m=r_sun,
        r_sun_epoch_eci_m=sun_eci_m(*epoch.tdb(np.zeros(()))),
        r_chaser_rtn_m=motion.r_chaser_rtn_m,
    )
    if given.q_eci_from_body is None:
        q_body, omega_body = _by_law(
            lambda near: R_eci_from_body(attitude.target, near), around, motion.v_chaser_rtn_m_s
        )
    else:
        q_body, omega_body = _as_given(given.q_eci_from_body, given.omega_body_rad_s, "q_eci_from_body")
    if given.q_eci_from_camera is None:
        q_camera, omega_camera = _by_law(
            lambda near: R_eci_from_camera(attitude.camera, near, seed), around, motion.v_chaser_rtn_m_s
        )
    else:
        q_camera, omega_camera = _as_given(
            given.q_eci_from_camera, given.omega_camera_rad_s, "q_eci_from_camera"
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
        q_eci_from_body=q_body,
        q_eci_from_camera=q_camera,
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
        extras={name: _extra(name, array, len(motion.t_s)) for name, array in motion.extras.items()},
    )


def _by_law(
    law: Callable[[Surroundings], FloatArray], around: Surroundings, v_chaser_rtn_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Attitude (F, 4) by a law, and its rate (F, 3) in its own axes, by a central difference.

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
    q = quaternion_from_matrix(law(around))
    return q, rotation_vector_from_matrix(turn) / (2 * _RATE_STEP_S)


def _as_given(q: FloatArray, omega_rad_s: FloatArray | None, name: str) -> tuple[FloatArray, FloatArray]:
    """A given attitude (F, 4), of length one and w ≥ 0 to rounding, and its rate (F, 3)."""
    q = np.asarray(q, dtype=np.float64)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(np.abs(length - 1) < _LARGEST_NORM_ERROR):
        raise InputError(f"{name}: a quaternion is not of length one; give w, x, y, z of a rotation")
    # What is of length one already, such as a trajectory's own attitude, stays the same to the bit.
    q = np.where(np.abs(length - 1) < 4 * np.finfo(float).eps, q, q / length)
    rate = np.zeros((len(q), 3)) if omega_rad_s is None else np.asarray(omega_rad_s, dtype=np.float64)
    return np.where(q[:, :1] < 0, -q, q), rate


def _extra(name: str, array: AnyArray, frames: int) -> FloatArray:
    """One of a motion's extras, checked."""
    if not _EXTRA.fullmatch(name):
        raise ComponentError(
            f"the propagator's extra {name!r} needs a name of lower-case letters, digits and _"
        )
    numbers = np.asarray(array)
    if numbers.dtype.kind not in "fiu" or numbers.shape[:1] != (frames,) or numbers.size == 0:
        raise ComponentError(
            f"the propagator's extra {name!r} is {numbers.dtype} of shape {numbers.shape}; it has to be"
            f" numbers of shape ({frames}, ...)"
        )
    if not np.all(np.isfinite(numbers)):
        raise ComponentError(f"the propagator's extra {name!r} has a value that is no finite number")
    return numbers.astype(np.float64)
