"""The conformance class for attitude laws."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._environment.ephemeris import sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._frames import (
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings
from posse_core._scenario.attitude import Subject
from posse_core._trajectory.attitude import by_law
from posse_core._trajectory.returned import checked_attitude
from posse_core.testing.conformance import Conformance

RADIUS_M = 7.1e6
INCLINATION_RAD = np.radians(98.0)
RATE_RAD_S = float(np.sqrt(Constants().mu_earth_m3_s2 / RADIUS_M**3))
PERIOD_S = 2 * np.pi / RATE_RAD_S
_STEPS_S = (1.9, 0.475, 0.11875, 0.0296875)
"""Steps of the search for jumps. They are not round, so that a jump is not in the middle of a step."""
_SEARCHED = 500
"""Most steps of one length, after the first, that are searched for a jump."""


class AttitudeLawConformance(Conformance):
    """What every attitude law must do. A subclass provides :meth:`law` and ``capabilities``.

    The target is on a circular orbit with a radius of 7,100 km and an inclination of 98°, and the chaser
    on an ellipse of 10 m by 20 m by 3 m about it. A law is tested for each of its capabilities
    ``target`` and ``camera``.
    """

    @abstractmethod
    def law(self) -> AttitudeLaw:
        """A new law, with the same options each time."""

    def test_it_can_orient_target_or_camera(self) -> None:
        assert {"target", "camera"} & self.capabilities, "give the capability target, camera or both"

    def test_it_gives_a_rotation_for_each_frame(self) -> None:
        for subject in self._subjects():
            for frames in (1, 25):
                around = surroundings(subject, np.linspace(0.0, PERIOD_S, frames))
                checked_attitude(self.law().attitude(around), around.indices, type(self).__name__)

    def test_a_frame_does_not_depend_on_the_others(self) -> None:
        """To the bit: a frame alone, and frames in another order, are those of the whole."""
        for subject in self._subjects():
            around, law = surroundings(subject, np.linspace(0.0, PERIOD_S, 25)), self.law()
            whole = law.attitude(around)
            for rows in ([7], [24, 3, 11]):
                some = self.law().attitude(_rows(around, rows))
                np.testing.assert_array_equal(some, whole[rows], f"rows {rows} asked for alone")

    def test_the_same_frames_give_the_same_bits(self) -> None:
        """From another law of the same options, and from one that was asked for other frames before."""
        for subject in self._subjects():
            around = surroundings(subject, np.linspace(0.0, PERIOD_S, 25))
            law = self.law()
            first = law.attitude(around)
            kept = first.copy()
            law.attitude(surroundings(subject, np.linspace(50.0, 90.0, 25)))
            np.testing.assert_array_equal(first, kept, "what was returned has changed afterwards")
            np.testing.assert_array_equal(law.attitude(around), kept, "asked again")
            np.testing.assert_array_equal(self.law().attitude(around), kept, "from another law")

    def test_the_surroundings_are_left_alone(self) -> None:
        for subject in self._subjects():
            t_s = np.linspace(0.0, PERIOD_S, 25)
            around, untouched = surroundings(subject, t_s), surroundings(subject, t_s)
            self.law().attitude(around)
            for key in fields(Surroundings):
                given, before = getattr(around, key.name), getattr(untouched, key.name)
                np.testing.assert_array_equal(given, before, f"{key.name} was modified")

    def test_attitude_and_rate_have_no_jumps(self) -> None:
        """Over an orbit, with the random errors of one frame.

        The attitude after a step agrees with the one before it and the mean angular velocity. For a
        smooth law the difference is of the order of the third power of the step, for a jump of the rate
        it is proportional to the step, and for a jump of the attitude it is constant. So steps with a
        difference are divided until they are short.
        """
        for subject in self._subjects():
            jumps = _jumps(self.law(), subject)
            assert jumps is None, f"the attitude or its rate jumps near t_s = {jumps:.2f} ({subject})"

    def _subjects(self) -> Iterator[Subject]:
        if "target" in self.capabilities:
            yield "target"
        if "camera" in self.capabilities:
            yield "camera"


def surroundings(subject: Subject, t_s: FloatArray) -> Surroundings:
    """Return the surroundings of the kit's motion at the times (F,), with indices from 100 on."""
    u = RATE_RAD_S * t_s[:, None]
    x = np.array([1.0, 0.0, 0.0])
    y = np.array([0.0, np.cos(INCLINATION_RAD), np.sin(INCLINATION_RAD)])
    epoch = Epoch.from_iso("2022-01-31T02:02:27.58")
    return Surroundings(
        subject=subject,
        epoch=epoch,
        seed=5,
        t_s=t_s.copy(),
        indices=np.arange(100, 100 + len(t_s)),
        r_target_eci_m=RADIUS_M * (np.cos(u) * x + np.sin(u) * y),
        v_target_eci_m_s=RADIUS_M * RATE_RAD_S * (np.cos(u) * y - np.sin(u) * x),
        r_sun_eci_m=sun_eci_m(*epoch.tdb(t_s)),
        r_sun_epoch_eci_m=sun_eci_m(*epoch.tdb(np.zeros(()))),
        r_chaser_rtn_m=np.hstack([10 * np.cos(u), -20 * np.sin(u), 3 * np.cos(u)]),
    )


def _rows(around: Surroundings, rows: list[int]) -> Surroundings:
    return replace(
        around,
        t_s=around.t_s[rows],
        indices=around.indices[rows],
        r_target_eci_m=around.r_target_eci_m[rows],
        v_target_eci_m_s=around.v_target_eci_m_s[rows],
        r_sun_eci_m=around.r_sun_eci_m[rows],
        r_chaser_rtn_m=around.r_chaser_rtn_m[rows],
    )


def _jumps(law: AttitudeLaw, subject: Subject) -> float | None:
    """Return the time of the first step that has a jump, or None."""

    def state(t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        around = replace(surroundings(subject, t_s), indices=np.full(len(t_s), 100))
        u = RATE_RAD_S * t_s[:, None]
        v_chaser = RATE_RAD_S * np.hstack([-10 * np.sin(u), -20 * np.cos(u), -3 * np.sin(u)])
        q, omega = by_law(law, around, v_chaser)
        return matrix_from_quaternion(q), omega

    start_s = np.arange(0.0, PERIOD_S, _STEPS_S[0])
    largest_rate = float(np.linalg.norm(state(start_s)[1], axis=-1).max())
    for step_s in _STEPS_S:
        (R, omega), (R_after, omega_after) = state(start_s), state(start_s + step_s)
        expected = R @ matrix_from_rotation_vector(step_s * (omega + omega_after) / 2)
        error = rotation_vector_from_matrix(np.swapaxes(expected, -1, -2) @ R_after)
        # The Sun stands still in the differences that give the rate; it moves by 2e-7 rad/s.
        allowed = min(step_s * (0.02 * largest_rate + 1e-6) + 1e-9, 0.01)
        start_s = start_s[np.linalg.norm(error, axis=-1) > allowed][:_SEARCHED]
        if len(start_s) == 0:
            return None
        found_s = float(start_s[0])
        start_s = (start_s[:, None] + step_s * np.arange(4) / 4).ravel()
    return found_s
