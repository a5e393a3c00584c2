"""Attitude laws of the target's body, except recorded attitudes."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._attitude.options import (
    BodyAxis,
    InertialOptions,
    NedOptions,
    SpinOptions,
    SunPointingOptions,
    TrackingOptions,
    TumblingOptions,
)
from posse_core._attitude.sight import R_rtn_by_sight
from posse_core._attitude.tumbling import torque_free_attitude
from posse_core._environment.ephemeris import ECLIPTIC_NORTH_ECI
from posse_core._errors import InputError
from posse_core._frames import (
    R_LVLH_FROM_RTN,
    R_a_from_b_by_directions,
    R_eci_from_rtn,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    unit,
)
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings
from posse_core._plugins.options import NoOptions
from posse_core._randomness import random_generator

_POLE_ANGLE_RAD = 1e-9
"""Angle from the Earth's axis below which north is undefined."""


class NadirLaw(AttitudeLaw[NoOptions]):
    """LVLH axes: body +x V-bar, +y H-bar (against the orbit's normal), +z R-bar (to the Earth)."""

    def attitude(self, around: Surroundings) -> FloatArray:
        return R_eci_from_rtn(around.r_target_eci_m, around.v_target_eci_m_s) @ R_LVLH_FROM_RTN.T


class SunPointingLaw(AttitudeLaw[SunPointingOptions]):
    """A body axis points at the Sun; the next one (x, y, z, x) as near as possible to ecliptic north."""

    def attitude(self, around: Surroundings) -> FloatArray:
        to_sun = around.r_sun_eci_m - around.r_target_eci_m
        axis, following = body_axes(self.options.body_axis)
        return R_a_from_b_by_directions(to_sun, ECLIPTIC_NORTH_ECI, axis, following)


class InertialLaw(AttitudeLaw[InertialOptions]):
    """An attitude fixed in inertial axes."""

    def attitude(self, around: Surroundings) -> FloatArray:
        q = np.array(self.options.q_eci_from_body)
        return np.tile(matrix_from_quaternion(q), (len(around.t_s), 1, 1))


class SpinLaw(AttitudeLaw[SpinOptions]):
    """A steady spin about an axis that is fixed in inertial axes.

    At the epoch the axis is ``sun_angle_deg`` from the direction of the Sun, on the side of ecliptic
    north. At 90° it is the ecliptic's north pole, and the angle stays the same all year.
    """

    def attitude(self, around: Surroundings) -> FloatArray:
        options = self.options
        sun = unit(around.r_sun_epoch_eci_m)
        north = unit(np.cross(np.cross(sun, ECLIPTIC_NORTH_ECI), sun))
        sun_angle = np.radians(options.sun_angle_deg)
        spin_axis_eci = np.cos(sun_angle) * sun + np.sin(sun_angle) * north
        axis, following = body_axes(options.body_axis)
        R_at_phase_0 = R_a_from_b_by_directions(spin_axis_eci, sun, axis, following)
        # Whole turns are dropped first, since the phase would lose digits in an angle of many turns.
        turns = np.mod(options.rate_rpm * around.t_s / 60 + options.phase_deg / 360, 1.0)
        angle_rad = 2 * np.pi * turns[:, None] * axis
        return np.asarray(R_at_phase_0 @ matrix_from_rotation_vector(angle_rad))


class NedLaw(AttitudeLaw[NedOptions]):
    """The thesis' axes (equations 2.1 to 2.4): body +x north, +y east, +z down.

    Down is towards the Earth or the Sun; north and east refer to the GCRF equator. The thesis takes
    east from the spacecraft's longitude even where down is the Sun's direction, which gives no rotation
    matrix; here east is perpendicular to down.
    """

    def attitude(self, around: Surroundings) -> FloatArray:
        """See :meth:`AttitudeLaw.attitude`.

        Raises:
            InputError: Down is along the Earth's axis, where north is undefined.
        """
        towards_sun = around.r_sun_eci_m - around.r_target_eci_m
        down = unit(-around.r_target_eci_m if self.options.down == "earth" else towards_sun)
        lost = np.hypot(down[:, 0], down[:, 1]) < _POLE_ANGLE_RAD
        if np.any(lost):
            raise InputError(
                f"attitude.target.law ned has no north at frame {around.indices[np.argmax(lost)]}, above"
                " the pole; use law nadir"
            )
        x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        return R_a_from_b_by_directions(down, z, z, x)


class TrackingLaw(AttitudeLaw[TrackingOptions]):
    """A body axis points at the chaser; the next one (x, y, z, x) nearly along the orbit's normal."""

    def attitude(self, around: Surroundings) -> FloatArray:
        """See :meth:`AttitudeLaw.attitude`.

        Raises:
            InputError: The chaser is at the target.
        """
        R_eci_rtn = R_eci_from_rtn(around.r_target_eci_m, around.v_target_eci_m_s)
        axes = body_axes(self.options.body_axis)
        return R_eci_rtn @ R_rtn_by_sight(around.r_chaser_rtn_m, *axes, around.indices)


class RandomLaw(AttitudeLaw[NoOptions]):
    """Another attitude in each frame, all rotations equally likely.

    A Gaussian quaternion has no preferred direction, so it is uniform over rotations once normalised.
    """

    def attitude(self, around: Surroundings) -> FloatArray:
        q = [
            random_generator(around.seed, int(i), "attitude").standard_normal(4) for i in around.indices
        ]
        return matrix_from_quaternion(unit(np.array(q)))


class TumblingLaw(AttitudeLaw[TumblingOptions]):
    """Torque-free motion of a rigid body from an attitude and an angular rate at the epoch."""

    def attitude(self, around: Surroundings) -> FloatArray:
        return torque_free_attitude(
            self.options.inertia_kg_m2,
            np.radians(self.options.rate_body_deg_s),
            matrix_from_quaternion(np.array(self.options.q_eci_from_body)),
            around.t_s,
        )


def body_axes(name: BodyAxis) -> tuple[FloatArray, FloatArray]:
    """(3,), (3,): the named body axis, and the positive axis that follows it in the order x, y, z, x."""
    index = "xyz".index(name[1])
    unit_vectors = np.eye(3)
    return unit_vectors[index] * float(f"{name[0]}1"), unit_vectors[(index + 1) % 3]
