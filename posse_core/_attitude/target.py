"""Attitude of the target: one function per law, for F frames at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._attitude.recorded import recorded_attitude
from posse_core._attitude.sight import R_rtn_by_sight
from posse_core._attitude.tumbling import torque_free_attitude
from posse_core._environment.ephemeris import ECLIPTIC_NORTH_ECI
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._frames import (
    R_LVLH_FROM_RTN,
    R_a_from_b_by_directions,
    R_eci_from_rtn,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    unit,
)
from posse_core._scenario.attitude import (
    BodyAxis,
    FileLaw,
    InertialLaw,
    NadirLaw,
    NedLaw,
    SpinLaw,
    SunPointingLaw,
    TargetLaw,
    TrackingLaw,
    TumblingLaw,
)

_POLE_ANGLE_RAD = 1e-9
"""Angle from the Earth's axis below which north is undefined."""


@dataclass(frozen=True)
class Surroundings:
    """The states that attitude laws depend on, for F frames; ECI means geocentric, GCRF axes.

    Attributes:
        epoch: the instant of t_s = 0.
        t_s: (F,) seconds after the epoch.
        indices: (F,) index of each frame, on which the random numbers of a law depend.
        r_target_eci_m, v_target_eci_m_s: (F, 3) state of the target.
        r_sun_eci_m: (F, 3) position of the Sun.
        r_sun_epoch_eci_m: (3,) position of the Sun at t_s = 0.
        r_chaser_rtn_m: (F, 3) position of the chaser relative to the target, target's RTN axes.
    """

    epoch: Epoch
    t_s: FloatArray
    indices: IntArray
    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    r_sun_eci_m: FloatArray
    r_sun_epoch_eci_m: FloatArray
    r_chaser_rtn_m: FloatArray


def R_eci_from_body(law: TargetLaw, around: Surroundings) -> FloatArray:
    """Return the target's attitude by the law that the scenario names: (F, 3, 3).

    Raises:
        InputError: The law is undefined at some frame; the message names a law to use instead.
    """
    match law:
        case NadirLaw():
            return nadir(around)
        case SunPointingLaw():
            return sun_pointing(law, around)
        case InertialLaw():
            return inertial(law, around)
        case SpinLaw():
            return spin(law, around)
        case NedLaw():
            return ned(law, around)
        case TrackingLaw():
            return tracking(law, around)
        case TumblingLaw():
            return torque_free_attitude(
                law.inertia_kg_m2,
                np.radians(law.rate_body_deg_s),
                matrix_from_quaternion(np.array(law.q_eci_from_body)),
                around.t_s,
            )
        case FileLaw():
            return recorded_attitude(law.path, "q_eci_from_body", around.epoch, around.t_s)
        case _:
            assert_never(law)


def nadir(around: Surroundings) -> FloatArray:
    """(F, 3, 3): body axes along the LVLH axes, +x V-bar, +y H-bar, +z R-bar."""
    return R_eci_from_rtn(around.r_target_eci_m, around.v_target_eci_m_s) @ R_LVLH_FROM_RTN.T


def sun_pointing(law: SunPointingLaw, around: Surroundings) -> FloatArray:
    """(F, 3, 3): ``law.body_axis`` towards the Sun, the next axis nearest to ecliptic north."""
    to_sun = around.r_sun_eci_m - around.r_target_eci_m
    axis, following = body_axes(law.body_axis)
    return R_a_from_b_by_directions(to_sun, ECLIPTIC_NORTH_ECI, axis, following)


def inertial(law: InertialLaw, around: Surroundings) -> FloatArray:
    """(F, 3, 3): the same inertial attitude at all frames."""
    q = np.array(law.q_eci_from_body)
    return np.tile(matrix_from_quaternion(q), (len(around.t_s), 1, 1))


def spin(law: SpinLaw, around: Surroundings) -> FloatArray:
    """(F, 3, 3): spinning at ``law.rate_rpm`` about an axis fixed by the Sun at the epoch."""
    sun = unit(around.r_sun_epoch_eci_m)
    north = unit(np.cross(np.cross(sun, ECLIPTIC_NORTH_ECI), sun))
    sun_angle = np.radians(law.sun_angle_deg)
    spin_axis_eci = np.cos(sun_angle) * sun + np.sin(sun_angle) * north
    axis, following = body_axes(law.body_axis)
    R_at_phase_0 = R_a_from_b_by_directions(spin_axis_eci, sun, axis, following)
    # Whole turns are dropped first, since the phase would lose digits in an angle of many turns.
    turns = np.mod(law.rate_rpm * around.t_s / 60 + law.phase_deg / 360, 1.0)
    return np.asarray(R_at_phase_0 @ matrix_from_rotation_vector(2 * np.pi * turns[:, None] * axis))


def ned(law: NedLaw, around: Surroundings) -> FloatArray:
    """(F, 3, 3): body axes along north, east and down.

    Raises:
        InputError: Down is along the Earth's axis, where north is undefined.
    """
    towards_sun = around.r_sun_eci_m - around.r_target_eci_m
    down = unit(-around.r_target_eci_m if law.down == "earth" else towards_sun)
    lost = np.hypot(down[:, 0], down[:, 1]) < _POLE_ANGLE_RAD
    if np.any(lost):
        raise InputError(
            f"attitude.target.law ned has no north at frame {around.indices[np.argmax(lost)]}, above"
            " the pole; use law nadir"
        )
    pole = np.array([0.0, 0.0, 1.0])
    return R_a_from_b_by_directions(down, pole, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))


def tracking(law: TrackingLaw, around: Surroundings) -> FloatArray:
    """(F, 3, 3): ``law.body_axis`` towards the chaser, the next axis nearest to the orbit's normal.

    Raises:
        InputError: The chaser is at the target.
    """
    R_eci_rtn = R_eci_from_rtn(around.r_target_eci_m, around.v_target_eci_m_s)
    return R_eci_rtn @ R_rtn_by_sight(around.r_chaser_rtn_m, *body_axes(law.body_axis), around.indices)


def body_axes(name: BodyAxis) -> tuple[FloatArray, FloatArray]:
    """(3,), (3,): the named body axis, and the positive axis that follows it in the order x, y, z, x."""
    index = "xyz".index(name[1])
    unit_vectors = np.eye(3)
    return unit_vectors[index] * float(f"{name[0]}1"), unit_vectors[(index + 1) % 3]
