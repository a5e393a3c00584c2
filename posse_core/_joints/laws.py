"""The built-in joint laws."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.reading import check_file
from posse_core._files.tables import Table, read_table
from posse_core._frames import unit
from posse_core._interfaces.joint_law import JointLaw, JointSurroundings
from posse_core._joints.options import (
    AnimationOptions,
    FixedOptions,
    RandomOptions,
    RateOptions,
    TableOptions,
)
from posse_core._joints.units import given_for, in_radians, value_of
from posse_core._model.joints import Joint
from posse_core._plugins.options import NoOptions, nearest
from posse_core._randomness import random_generator

_ALONG_THE_AXIS = 1e-9
"""Sine of the angle from the axis below which turning about it does not change a direction."""


class FixedLaw(JointLaw[FixedOptions]):
    """The same value always."""

    def values(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.values`.

        Raises:
            InputError: The value is in metres for a joint that turns, or in degrees for one that slides.
        """
        options = self.options
        value = value_of(around.joint, value_deg=options.value_deg, value_m=options.value_m)
        return np.full(len(around.t_s), value)


class RateLaw(JointLaw[RateOptions]):
    """A steady rate from a value at the epoch."""

    def values(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.values`.

        Raises:
            InputError: An option is in metres for a joint that turns, or in degrees for one that slides.
        """
        options, joint = self.options, around.joint
        rate = value_of(joint, rate_deg_s=options.rate_deg_s, rate_m_s=options.rate_m_s)
        start = value_of(joint, start_deg=options.start_deg, start_m=options.start_m)
        return np.asarray(start + rate * around.t_s)


class TableLaw(JointLaw[TableOptions]):
    """Values of a file, interpolated. Before its first and after its last row the joint rests there.

    Cubic polynomials are those of Fritsch and Butland (1984): where the rows rise the values rise, so
    none is beyond the rows' own. The file is read when the first value is asked for.
    """

    def values(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.values`.

        Raises:
            InputError: The file cannot be used, or has no values that fit the joint.
        """
        name = "value_deg" if around.joint.kind == "revolute" else "value_m"
        times_s, rows = self._table["t_s"], in_radians(around.joint, self._table[name])
        if self._table.epoch_utc is not None:
            times_s = times_s + around.epoch.seconds_until(Epoch.from_iso(self._table.epoch_utc))
        if np.any(np.diff(times_s) <= 0):
            raise InputError(
                f"{self.options.path}: its times do not increase; sort them and remove duplicates"
            )
        within_s = np.clip(around.t_s, times_s[0], times_s[-1])
        if self.options.interpolation == "linear" or len(times_s) == 1:
            return np.interp(within_s, times_s, rows)
        from scipy.interpolate import PchipInterpolator  # slow to import, and seldom needed

        return np.asarray(PchipInterpolator(times_s, rows)(within_s))

    @cached_property
    def _table(self) -> Table:
        check_file(self.options.path)
        names = ("t_s", "value_deg", "value_m")
        return read_table(self.options.path, names, guide="docs/joints.md")


class AnimationLaw(JointLaw[AnimationOptions]):
    """The joint's motion in an animation of the spacecraft's file."""

    def values(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.values`.

        Raises:
            InputError: The joint has no animation, or none of that name.
        """
        return self._played(around)[0]

    def rates(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.rates`; the derivatives, as an animation may jump."""
        return self._played(around)[1]

    def _played(self, around: JointSurroundings) -> tuple[FloatArray, FloatArray]:
        joint, name = around.joint, self.options.animation
        if not joint.animations:
            raise InputError(
                f"animation: the joint {joint.name} has no animation; take the law fixed, rate or table"
            )
        if name is not None and name not in joint.animations:
            hint = nearest(name, joint.animations) or f"; it has {', '.join(joint.animations)}"
            raise InputError(f"animation: the joint {joint.name} has no animation {name!r}{hint}")
        curve = joint.animations[name or next(iter(joint.animations))]
        t_s = around.t_s - self.options.start_s
        if self.options.repeat and curve.end_s > 0:
            t_s = np.mod(t_s, curve.end_s)
        return curve.at(t_s)


class SunTrackingLaw(JointLaw[NoOptions]):
    """Turns what faces the Sun as near to it as axis and limits allow.

    Of the angles that do so, it is the one nearest to the middle of the joint's limits, or to zero if it
    has none. Where turning changes nothing, since the Sun or the facing direction is along the axis, it
    is the value within the limits that is nearest to zero.
    """

    def values(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.values`.

        Raises:
            InputError: The joint does not turn, or nothing on it faces the Sun.
        """
        joint = around.joint
        if joint.kind != "revolute" or joint.facing_body is None:
            lacks = "no facing_body" if joint.kind == "revolute" else "no axis to turn about"
            raise InputError(
                f"sun-tracking: the joint {joint.name} has {lacks}, so it can turn nothing to the Sun;"
                " take the law fixed, rate or table"
            )
        # The angle about the axis from the facing direction to the Sun's.
        axis, facing, sun = joint.axis_body, unit(joint.facing_body), around.sun_direction_carrier
        along = np.sum(axis * sun, axis=-1)
        sine = np.sum(np.cross(axis, facing) * sun, axis=-1)
        cosine = np.sum(facing * sun, axis=-1) - np.sum(axis * facing) * along
        angle_rad = np.arctan2(sine, cosine)
        low, high = joint.limits
        middle = _middle(low, high)
        # Within half a turn of the middle, the nearer one of the limits is that on the value's side.
        value = middle + np.mod(angle_rad - middle + np.pi, 2 * np.pi) - np.pi
        value = np.clip(value, low, high)
        lost = np.hypot(sine, cosine) < _ALONG_THE_AXIS
        return np.asarray(np.where(lost, np.clip(0.0, low, high), value))


def _middle(low: float, high: float) -> float:
    """The middle of a joint's limits, rad; half a turn within the only limit, or 0 without any."""
    if np.isfinite(low):
        return (low + high) / 2 if np.isfinite(high) else low + np.pi
    return high - np.pi if np.isfinite(high) else 0.0


class RandomLaw(JointLaw[RandomOptions]):
    """A value drawn evenly from a range, for each frame or for the run."""

    def values(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.values`.

        Raises:
            InputError: The range is in metres for a joint that turns or in degrees for one that slides,
                or a joint that slides has neither range nor limits.
        """
        low, high = self._range(around.joint)
        indices = np.full(len(around.t_s), -1) if self.options.every == "run" else around.indices
        purpose = f"{around.purpose}: random"
        return np.array(
            [random_generator(around.seed, int(i), purpose).uniform(low, high) for i in indices]
        )

    def _range(self, joint: Joint) -> tuple[float, float]:
        options = self.options
        given = {"range_deg": options.range_deg, "range_m": options.range_m}
        name = given_for(joint, **given)
        own = given[name]
        if own is not None:
            low, high = in_radians(joint, np.array(own)).tolist()
            return low, high
        low, high = joint.limits
        if np.isfinite(low) and np.isfinite(high):
            return low, high
        if joint.kind == "revolute" and not (np.isfinite(low) or np.isfinite(high)):
            return -np.pi, np.pi
        raise InputError(f"random: the joint {joint.name} has no limits; give {name}")
