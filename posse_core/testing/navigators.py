"""The conformance class for navigators."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._attitude.camera import looking_at_target
from posse_core._constants import Constants
from posse_core._dynamics.elements import state_from_keplerian
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Start, Target
from posse_core._environment.time import Epoch
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.navigator import (
    Estimate,
    Innovation,
    KeypointReading,
    LineOfSight,
    NavigationProblem,
    Navigator,
    RangeReading,
    Readings,
)
from posse_core._interfaces.propagator import PropagationProblem
from posse_core._model.camera import Camera
from posse_core._plugins.options import NoOptions
from posse_core._propagators.roe import RoePropagator
from posse_core._randomness import random_generator
from posse_core.testing.conformance import CHANGED, Conformance

_START_SIGMAS = np.repeat([1.0, 0.005], 3)
_POSE_SIGMAS = np.array([0.01, 0.01, 0.01, 0.02, 0.02, 0.2])
_RADIUS_M = 2.0
_CORNERS_M = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-0.8, 0.8) for z in (-1.2, 1.2)])
_RATE_BODY_RAD_S = np.array([0.002, -0.001, 0.004])
_CAMERA = Camera(1024, 1024, 1500.0, 1500.0, 511.5, 511.5, 0.01)
_DV_M_S = np.array([0.02, 0.05, -0.03])


@dataclass(frozen=True)
class _Flight:
    """A flight of which everything is known: 60 m behind a target that turns slowly, a frame each 10 s.

    Attributes:
        with_truth: whether the readings hold the true state.
    """

    with_truth: bool

    @cached_property
    def t_s(self) -> FloatArray:
        return np.arange(0.0, 300.0, 10.0)

    @cached_property
    def target(self) -> Target:
        constants = Constants()
        elements = np.array([7.1e6, 1e-4, *np.radians([98.2, 334.0, 52.0, 318.0])])
        return Target(*state_from_keplerian(elements, constants.mu_earth_m3_s2), constants)

    def truth(self, t_s: FloatArray, burns: Sequence[Burn] = ()) -> list[Estimate]:
        """The true states, with a covariance of zeros."""
        start = Start.from_rtn(self.target, np.array([6.0, -60.0, 10.0]), np.array([0.0, -0.01, 2e-3]))
        motion = RoePropagator(NoOptions()).propagate(
            PropagationProblem(_EPOCH, self.target, (start,), t_s, burns=tuple(burns))
        )
        first = frames.matrix_from_rotation_vector(np.array([0.4, -0.9, 0.2]))
        q = frames.quaternion_from_matrix(
            first @ frames.matrix_from_rotation_vector(t_s[:, None] * _RATE_BODY_RAD_S)
        )
        return [
            Estimate(float(t), r, v, np.zeros((12, 12)), q_eci_from_body, _RATE_BODY_RAD_S)
            for t, r, v, q_eci_from_body in zip(
                t_s, motion.r_chaser_rtn_m, motion.v_chaser_rtn_m_s, q, strict=True
            )
        ]

    def problem(self) -> NavigationProblem:
        """What the navigator knows: a start with errors of one standard deviation or less."""
        error = _START_SIGMAS * np.array([0.8, -0.6, 0.5, -0.7, 0.4, 0.9])
        (first,) = self.truth(np.zeros(1))
        start = Estimate(
            0.0, first.r_rtn_m + error[:3], first.v_rtn_m_s + error[3:], np.diag(_START_SIGMAS**2)
        )
        return NavigationProblem(_EPOCH, self.target, start, _CAMERA, _RADIUS_M)

    def readings(self, burns: Sequence[Burn] = ()) -> list[Readings]:
        """Keypoints, pose, line of sight and range of each frame, with small errors."""
        made = []
        for k, state in enumerate(self.truth(self.t_s, burns)):
            draw = random_generator(0, k, "navigator conformance")
            target = self.target.two_body(np.array([state.t_s]))
            R_eci_rtn = frames.R_eci_from_rtn(target[0][0], target[1][0])
            R_eci_cam = R_eci_rtn @ looking_at_target(state.r_rtn_m[None], np.array([k]))[0]
            assert state.q_eci_from_body is not None, "the kit's flight has attitudes"
            R = R_eci_cam.T @ frames.matrix_from_quaternion(state.q_eci_from_body)
            t = -R_eci_cam.T @ R_eci_rtn @ state.r_rtn_m
            px = _CAMERA.project(_CORNERS_M @ R.T + t)
            error = _POSE_SIGMAS * draw.standard_normal(6)
            pose = PoseEstimate(
                frames.matrix_from_rotation_vector(error[:3]) @ R,
                t + error[3:],
                np.diag(_POSE_SIGMAS**2),
                np.ones(len(px), dtype=np.bool_),
                1.0,
            )
            made.append(
                Readings(
                    k,
                    state.t_s,
                    state.t_s,
                    frames.quaternion_from_matrix(R_eci_cam),
                    KeypointReading(
                        _CORNERS_M, px + 0.5 * draw.standard_normal(px.shape), np.full(len(px), 0.5)
                    ),
                    pose,
                    LineOfSight(frames.unit(t), 1e-3),
                    RangeReading(float(np.linalg.norm(t)) + 0.5 * draw.standard_normal(), 0.5),
                    state if self.with_truth else None,
                )
            )
        return made


_EPOCH = Epoch.from_iso("2022-01-31T02:02:27.58")


class NavigatorConformance(Conformance):
    """What every navigator must do. A subclass provides :meth:`navigator` and ``capabilities``.

    It flies 60 m behind a target on a nearly circular orbit that turns at 0.26 °/s. Frames of 10 s have
    keypoints, pose, line of sight and range; a navigator uses what it can.
    """

    @abstractmethod
    def navigator(self) -> Navigator:
        """A new navigator."""

    def test_an_estimate_is_of_the_instant_asked_for_and_well_formed(self) -> None:
        navigator, flight = self._started()
        for readings in flight.readings():
            navigator.update(readings)
            for t_s in (readings.t_s, readings.t_s + 7.5):
                estimate = navigator.estimate(t_s)
                if estimate is not None:
                    fault = _fault(estimate, t_s)
                    assert fault is None, fault
        assert estimate is not None, "there is no estimate after all readings"

    def test_the_error_is_as_small_as_the_covariance_says(self) -> None:
        """Within five standard deviations and a millimetre, for position, velocity, attitude, rate."""
        navigator, flight = self._started()
        for readings in flight.readings():
            navigator.update(readings)
        for t_s in (flight.t_s[-1], flight.t_s[-1] + 100.0):
            (truth,) = flight.truth(np.array([t_s]))
            estimate = _asked(navigator, float(t_s))
            error, sigmas = _errors(truth, estimate), np.sqrt(np.diag(estimate.covariance))
            allowed = 5 * sigmas + np.repeat([1e-3, 1e-5, 1e-5, 1e-6], 3)[: len(sigmas)]
            assert np.all(np.abs(error) < allowed), f"errors {error}, standard deviations {sigmas}"

    def test_asking_changes_nothing(self) -> None:
        one, flight = self._started()
        other, _ = self._started()
        burn = Burn(105.0, _DV_M_S)
        for readings in flight.readings([burn]):
            one.update(readings)
            other.update(readings)
            if readings.t_s == 100.0:
                one.burned(burn)
                other.burned(burn)
            for t_s in (readings.t_s + 900.0, readings.t_s + 6.0, readings.t_s + 900.0):
                other.estimate(t_s)
        _assert_same(_asked(one, 400.0), _asked(other, 400.0))
        _assert_same(_asked(other, 400.0), _asked(other, 400.0))

    def test_an_impulse_changes_the_velocity_from_its_instant_on(self) -> None:
        one, flight = self._started()
        other, _ = self._started()
        for readings in flight.readings()[:10]:
            one.update(readings)
            other.update(readings)
        burn = Burn(95.0, _DV_M_S)
        other.burned(burn)
        for t_s in (95.0, 96.0, 110.0):
            before, after = _asked(one, t_s), _asked(other, t_s)
            (coasts,) = flight.truth(np.array([t_s]))
            (burns,) = flight.truth(np.array([t_s]), [burn])
            if t_s == 95.0:
                np.testing.assert_allclose(
                    after.r_rtn_m,
                    before.r_rtn_m,
                    atol=1e-9,
                    err_msg="the position changed at an impulse, which changes velocity alone",
                )
                np.testing.assert_allclose(
                    after.v_rtn_m_s - before.v_rtn_m_s,
                    _DV_M_S,
                    atol=1e-6,
                    err_msg=(
                        "the velocity did not change by the impulse: is it applied once, in RTN axes, "
                        "at its own instant?"
                    ),
                )
            else:
                np.testing.assert_allclose(
                    after.r_rtn_m - before.r_rtn_m,
                    burns.r_rtn_m - coasts.r_rtn_m,
                    atol=1e-3,
                    err_msg=(
                        "after an impulse the estimate does not move as the true motion does: is it "
                        "applied twice, or at the wrong instant?"
                    ),
                )
        assert np.linalg.norm(_asked(other, 93.0).v_rtn_m_s - _asked(one, 93.0).v_rtn_m_s) < 1e-9, (
            "an impulse acts before its instant"
        )

    def test_readings_that_arrive_after_a_later_impulse_count_as_if_in_time(self) -> None:
        burn = Burn(95.0, _DV_M_S)
        results = []
        for late in (False, True):
            navigator, flight = self._started()
            all_readings = flight.readings([burn])
            for readings in all_readings[:9]:
                navigator.update(readings)
            if not late:
                navigator.update(all_readings[9])
            navigator.burned(burn)
            navigator.estimate(99.0)
            if late:
                navigator.update(all_readings[9])
            navigator.update(all_readings[10])
            results.append(_asked(navigator, 130.0))
        np.testing.assert_allclose(
            results[1].r_rtn_m,
            results[0].r_rtn_m,
            atol=1e-6,
            err_msg=(
                "readings that arrive after a later impulse give another position than in time: "
                "keep the state at the last reading, and the impulses since"
            ),
        )
        np.testing.assert_allclose(
            results[1].v_rtn_m_s,
            results[0].v_rtn_m_s,
            atol=1e-8,
            err_msg=(
                "readings that arrive after a later impulse give another velocity than in time: "
                "keep the state at the last reading, and the impulses since"
            ),
        )

    def test_what_is_not_seen_is_known_less_and_less(self) -> None:
        navigator, flight = self._started()
        for readings in flight.readings():
            navigator.update(readings)
        t_s = float(flight.t_s[-1])
        sizes = [
            float(np.trace(_asked(navigator, t).covariance[:3, :3]))
            for t in (t_s, t_s + 300.0, t_s + 1800.0)
        ]
        assert sizes[0] <= sizes[1], f"variances of the position {sizes}"
        assert sizes[0] < sizes[2], f"variances of the position {sizes}"

    def test_a_frame_in_which_nothing_was_read_is_taken(self) -> None:
        navigator, flight = self._started()
        everything = flight.readings()
        for readings in everything[:5]:
            navigator.update(readings)
        empty = Readings(5, 50.0, 50.0, everything[5].q_eci_from_camera, truth=everything[5].truth)
        assert navigator.update(empty) is None, (
            "a frame in which nothing was read has no innovation; return None"
        )
        fault = _fault(_asked(navigator, 50.0), 50.0)
        assert fault is None, fault

    def test_innovations_are_well_formed(self) -> None:
        navigator, flight = self._started()
        for readings in flight.readings():
            innovation = navigator.update(readings)
            if innovation is not None:
                assert isinstance(innovation, Innovation), "update() must return an Innovation or None"
                assert 0 <= innovation.nis < np.inf, (
                    "an innovation's nis is negative or not finite: is its covariance not positive?"
                )
                assert 0 <= innovation.rejected <= innovation.dof, (
                    "an innovation rejects more numbers than there are"
                )
                assert innovation.dof > 0, "an innovation of no numbers is none; return None"

    def test_a_flight_begins_anew(self) -> None:
        """A second flight of the same navigator equals the first to the bit."""
        navigator, flight = self._started()
        results = []
        for _ in range(2):
            navigator.start(flight.problem())
            for readings in flight.readings()[:8]:
                navigator.update(readings)
            navigator.burned(Burn(75.0, _DV_M_S))
            results.append(_asked(navigator, 80.0))
        _assert_same(results[0], results[1])

    def test_what_it_is_given_is_left_alone(self) -> None:
        navigator, flight = self._started()
        problem, kept = flight.problem(), flight.problem()
        navigator.start(problem)
        for readings, same in zip(flight.readings()[:3], flight.readings()[:3], strict=True):
            navigator.update(readings)
            assert readings.keypoints is not None, "the kit's readings have keypoints"
            assert same.keypoints is not None, "the kit's readings have keypoints"
            np.testing.assert_array_equal(
                readings.keypoints.points_px, same.keypoints.points_px, err_msg=CHANGED
            )
            assert readings.pose is not None, "the kit's readings have a pose"
            assert same.pose is not None, "the kit's readings have a pose"
            np.testing.assert_array_equal(
                readings.pose.covariance, same.pose.covariance, err_msg=CHANGED
            )
            np.testing.assert_array_equal(
                readings.q_eci_from_camera, same.q_eci_from_camera, err_msg=CHANGED
            )
        np.testing.assert_array_equal(problem.start.covariance, kept.start.covariance, err_msg=CHANGED)
        np.testing.assert_array_equal(problem.start.r_rtn_m, kept.start.r_rtn_m, err_msg=CHANGED)

    def _started(self) -> tuple[Navigator, _Flight]:
        flight = _Flight(with_truth="truth" in self.capabilities)
        navigator = self.navigator()
        navigator.start(flight.problem())
        return navigator, flight


def _asked(navigator: Navigator, t_s: float) -> Estimate:
    estimate = navigator.estimate(t_s)
    assert estimate is not None, f"there is no estimate at {t_s} s"
    return estimate


def _errors(truth: Estimate, estimate: Estimate) -> FloatArray:
    """(6,) or (12,) truth minus estimate, in the order of the covariance."""
    parts = [truth.r_rtn_m - estimate.r_rtn_m, truth.v_rtn_m_s - estimate.v_rtn_m_s]
    if estimate.q_eci_from_body is not None and estimate.omega_body_rad_s is not None:
        assert truth.q_eci_from_body is not None, "the kit's flight has attitudes"
        assert truth.omega_body_rad_s is not None, "the kit's flight has rates"
        found = frames.matrix_from_quaternion(estimate.q_eci_from_body)
        turn = found.T @ frames.matrix_from_quaternion(truth.q_eci_from_body)
        parts += [
            frames.rotation_vector_from_matrix(turn),
            truth.omega_body_rad_s - estimate.omega_body_rad_s,
        ]
    return np.concatenate(parts)


def _fault(estimate: Estimate, t_s: float) -> str | None:
    """What is wrong with the form of an estimate."""
    if estimate.t_s != t_s:
        return f"the estimate is of {estimate.t_s} s, and {t_s} s was asked for"
    q, omega = estimate.q_eci_from_body, estimate.omega_body_rad_s
    if (q is None) != (omega is None):
        return "of attitude and rate one is None"
    size = 6 if q is None else 12
    shapes = {
        "r_rtn_m": (estimate.r_rtn_m, (3,)),
        "v_rtn_m_s": (estimate.v_rtn_m_s, (3,)),
        "covariance": (estimate.covariance, (size, size)),
    }
    if q is not None and omega is not None:
        shapes |= {"q_eci_from_body": (q, (4,)), "omega_body_rad_s": (omega, (3,))}
        if np.shape(q) == (4,) and abs(np.linalg.norm(q) - 1) > 1e-9:
            return f"the quaternion's length is {np.linalg.norm(q)}"
    for name, (array, shape) in shapes.items():
        if np.shape(array) != shape:
            return f"{name} has the shape {np.shape(array)} in place of {shape}"
        if not np.isfinite(array).all():
            return f"{name} has numbers that are not finite"
    covariance = estimate.covariance
    if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=1e-18):
        return "the covariance is not symmetric"
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scaled = covariance / np.maximum(np.outer(sigmas, sigmas), 1e-30)
    if np.any(np.diag(covariance) < 0) or np.linalg.eigvalsh(scaled)[0] < -1e-8:
        return "the covariance is not positive"
    return None


def _assert_same(one: Estimate, other: Estimate) -> None:
    for name in ("t_s", "r_rtn_m", "v_rtn_m_s", "covariance", "q_eci_from_body", "omega_body_rad_s"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert (mine is None) == (theirs is None), name
        if mine is not None:
            np.testing.assert_array_equal(mine, theirs, err_msg=name)
