"""The conformance class for joint laws."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import fields, replace

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_LVLH_FROM_RTN, R_eci_from_rtn, R_with_z, unit
from posse_core._interfaces.joint_law import JointLaw, JointSurroundings
from posse_core._model.joints import Joint
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._trajectory.joints import RATE_STEP_S, checked_values
from posse_core.testing.attitude_laws import PERIOD_S, surroundings
from posse_core.testing.conformance import Conformance

WING = Joint(
    "wing",
    "revolute",
    origin_body_m=np.array([0.2, -0.6, 0.1]),
    axis_body=np.array([0.0, 1.0, 0.0]),
    facing_body=np.array([1.0, 0.0, 0.0]),
)
"""A joint that turns a solar wing about body y, without limits."""
_STEPS_S = (1.9, 0.475, 0.11875, 0.0296875, 0.0074, 0.0019)
"""Steps of the search for jumps. They are not round, so that a jump is not in the middle of a step."""
_SEARCHED = 500
"""Most steps of one length, after the first, that are searched for a jump."""


class JointLawConformance(Conformance):
    """What every joint law must do. A subclass provides :meth:`law`.

    The spacecraft points to the nadir on a circular orbit with a radius of 7,100 km and an inclination
    of 98°.

    Attributes:
        joint: what the law moves; a solar wing's, :data:`WING`, if a subclass has no other.
    """

    joint: Joint = WING

    @abstractmethod
    def law(self) -> JointLaw:
        """A new law, with the same options each time."""

    def test_it_gives_a_value_within_the_limits_for_each_frame(self) -> None:
        low, high = self.joint.limits
        for frames in (1, 25):
            around = joint_surroundings(np.linspace(0.0, PERIOD_S, frames), self.joint)
            values = checked_values(self.law().values(around), frames, type(self).__name__)
            assert np.all((low <= values) & (values <= high)), "a value is beyond the limits"

    def test_a_frame_does_not_depend_on_the_others(self) -> None:
        """To the bit: a frame alone, and frames in another order, are those of the whole."""
        around = joint_surroundings(np.linspace(0.0, PERIOD_S, 25), self.joint)
        whole = self.law().values(around)
        for rows in ([7], [24, 3, 11]):
            some = self.law().values(_rows(around, rows))
            np.testing.assert_array_equal(some, whole[rows], f"rows {rows} asked for alone")

    def test_the_same_frames_give_the_same_bits(self) -> None:
        """From another law of the same options, and from one that was asked for other frames before."""
        around = joint_surroundings(np.linspace(0.0, PERIOD_S, 25), self.joint)
        law = self.law()
        first = law.values(around)
        kept = first.copy()
        law.values(joint_surroundings(np.linspace(50.0, 90.0, 25), self.joint))
        np.testing.assert_array_equal(first, kept, "what was returned has changed afterwards")
        np.testing.assert_array_equal(law.values(around), kept, "asked again")
        np.testing.assert_array_equal(self.law().values(around), kept, "from another law")

    def test_the_surroundings_are_left_alone(self) -> None:
        t_s = np.linspace(0.0, PERIOD_S, 25)
        around, untouched = joint_surroundings(t_s, self.joint), joint_surroundings(t_s, self.joint)
        self.law().values(around)
        for key in fields(JointSurroundings):
            if key.name not in ("joint", "spacecraft"):
                given, before = getattr(around, key.name), getattr(untouched, key.name)
                np.testing.assert_array_equal(given, before, f"{key.name} was modified")

    def test_the_value_has_no_jumps(self) -> None:
        """Over an orbit, with the random numbers of one frame; whole turns are none.

        A step with a jump differs from the mean rate times the step however short it is. So steps that
        differ are divided until they are short. A law with rates of its own may jump.
        """
        if self.law().rates(joint_surroundings(np.zeros(1), self.joint)) is not None:
            return
        start_s = np.arange(0.0, PERIOD_S, _STEPS_S[0])
        largest_rate = float(np.abs(self._rates(start_s)).max())
        for step_s in _STEPS_S:
            mean_rate = (self._rates(start_s) + self._rates(start_s + step_s)) / 2
            change = self._values(start_s + step_s) - self._values(start_s)
            error = np.abs(self._within_half_a_turn(change - step_s * mean_rate))
            allowed = min(step_s * (2 * largest_rate + 1e-6) + 1e-9, 0.01)
            start_s = start_s[error > allowed][:_SEARCHED]
            if len(start_s) == 0:
                return
            found_s = float(start_s[0])
            start_s = (start_s[:, None] + step_s * np.arange(4) / 4).ravel()
        raise AssertionError(f"the value jumps near t_s = {found_s:.2f}")

    def test_rates_of_its_own_are_those_of_its_values(self) -> None:
        """At nine of ten instants, as there may be jumps and bends beside the others."""
        t_s = np.sort(np.random.default_rng(1).uniform(0.0, PERIOD_S, 2000))
        own = self.law().rates(joint_surroundings(t_s, self.joint))
        if own is not None:
            checked_values(own, len(t_s), type(self).__name__)
            off = np.abs(own - self._rates(t_s))
            assert np.mean(off > 1e-6 + 1e-3 * np.abs(own)) < 0.1, "the rates are not the values'"

    def _values(self, t_s: FloatArray) -> FloatArray:
        around = joint_surroundings(t_s, self.joint)
        return self.law().values(replace(around, indices=np.full(len(t_s), 100)))

    def _rates(self, t_s: FloatArray) -> FloatArray:
        change = self._values(t_s + RATE_STEP_S) - self._values(t_s - RATE_STEP_S)
        return self._within_half_a_turn(change) / (2 * RATE_STEP_S)

    def _within_half_a_turn(self, change: FloatArray) -> FloatArray:
        if self.joint.kind != "revolute":
            return change
        return np.asarray(change - 2 * np.pi * np.round(change / (2 * np.pi)))


def joint_surroundings(t_s: FloatArray, joint: Joint = WING) -> JointSurroundings:
    """Return the surroundings of a joint on the kit's orbit at the times (F,), with indices from 100
    on."""
    around = surroundings("target", t_s)
    r_m, v_m_s = around.r_target_eci_m, around.v_target_eci_m_s
    R_eci_from_body = np.asarray(R_eci_from_rtn(r_m, v_m_s) @ R_LVLH_FROM_RTN.T)
    sun_eci = unit(around.r_sun_eci_m - r_m)
    return JointSurroundings(
        joint=joint,
        group=(joint.name,),
        spacecraft=_plate(joint),
        purpose=f"joints.{joint.name}",
        epoch=around.epoch,
        seed=around.seed,
        t_s=around.t_s,
        indices=around.indices,
        sun_direction_carrier=np.einsum("fji,fj->fi", R_eci_from_body, sun_eci),
        R_eci_from_body=R_eci_from_body,
    )


def _plate(joint: Joint) -> Spacecraft:
    """A triangle beside a joint's axis that it carries, and nothing else."""
    beside = R_with_z(joint.axis_body).T
    corners_m = joint.origin_body_m + np.array([np.zeros(3), beside[0], 2.0 * beside[0] + beside[2]])
    normals = np.tile(beside[1], (3, 1)).astype(np.float32)
    faces, uv = np.array([[0, 1, 2]], dtype=np.int32), np.zeros((3, 2), dtype=np.float32)
    part = Part("plate", corners_m, faces, normals, uv, "grey", joint.name)
    return Spacecraft("plate", (part,), {"grey": Material("grey")}, joints=(joint,))


def _rows(around: JointSurroundings, rows: list[int]) -> JointSurroundings:
    return replace(
        around,
        t_s=around.t_s[rows],
        indices=around.indices[rows],
        sun_direction_carrier=around.sun_direction_carrier[rows],
        R_eci_from_body=around.R_eci_from_body[rows],
    )
