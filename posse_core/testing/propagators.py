"""The conformance class for propagators."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from scipy.integrate import solve_ivp

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics.elements import state_from_keplerian
from posse_core._dynamics.start import Start, Target
from posse_core._environment.time import Epoch
from posse_core._frames import eci_from_rtn, rtn_from_eci
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion
from posse_core.testing.conformance import CHANGED, Conformance

PERIOD_S = 5900.0
"""Approximate period of the orbit of :meth:`PropagatorConformance.problem`."""


class PropagatorConformance(Conformance):
    """What every propagator must do. A subclass provides :meth:`propagator` and ``capabilities``.

    The problem is a low orbit with e = 1e-4 and a relative ellipse of about ten metres. For a propagator
    with another domain, override :meth:`problem`.
    """

    @abstractmethod
    def propagator(self) -> Propagator:
        """A new propagator."""

    def problem(self, t_s: FloatArray) -> PropagationProblem:
        """The motion to propagate at the times ``t_s`` (F,)."""
        a_e_i_raan_argp_mean = np.array([7.1e6, 1e-4, *np.radians([98.2, 334.0, 52.0, 318.0])])
        constants = Constants()
        state = state_from_keplerian(a_e_i_raan_argp_mean, constants.mu_earth_m3_s2)
        target = Target(*state, constants)
        start = Start.from_roe(target, np.array([0.0, 0.0, 15.0, -4.0, 12.0, 7.0]))
        epoch = Epoch.from_iso("2022-01-31T02:02:27.58")
        return PropagationProblem(epoch=epoch, target=target, starts=(start,), t_s=t_s)

    def test_shapes_and_numbers(self) -> None:
        t_s = np.linspace(0.0, PERIOD_S, 7)
        motion = self._motion(t_s)
        frames = len(motion.t_s)
        for name in (
            "r_target_eci_m",
            "v_target_eci_m_s",
            "r_chaser_rtn_m",
            "v_chaser_rtn_m_s",
        ):
            array = getattr(motion, name)
            assert array.shape == (frames, 3), name
            assert array.dtype == np.float64, name
            assert np.isfinite(array).all(), name
        for name, array in motion.extras.items():
            assert array.shape[:1] == (frames,), name
            assert np.isfinite(array).all(), name
        assert motion.sequence.shape == (frames,), "sequence has one number for each frame"
        assert np.issubdtype(motion.sequence.dtype, np.integer), "sequence numbers are integers"
        if "own-frames" in self.capabilities:
            assert set(motion.t_s.tolist()) <= set(t_s.tolist()), (
                "frames at times that were not requested"
            )
        else:
            np.testing.assert_array_equal(
                motion.t_s,
                t_s,
                err_msg=(
                    "frames are at other times than were asked for; that needs the capability 'own- "
                    "frames'"
                ),
            )

    def test_one_frame(self) -> None:
        assert np.isfinite(self._motion(np.zeros(1)).r_chaser_rtn_m).all(), (
            "one time alone gives numbers that are not finite: is a step or a derivative "
            "taken between times?"
        )

    def test_the_orbit_is_the_one_asked_for(self) -> None:
        """The semi-major axis from the vis-viva equation, within the size of short-period terms."""
        motion = self._motion(np.linspace(0.0, PERIOD_S, 7))
        r = np.linalg.norm(motion.r_target_eci_m, axis=-1)
        v = np.linalg.norm(motion.v_target_eci_m_s, axis=-1)
        a_m = 1 / (2 / r - v**2 / Constants().mu_earth_m3_s2)
        np.testing.assert_allclose(
            a_m,
            7.1e6,
            rtol=5e-3,
            err_msg=(
                "the semi-major axis is not that of the target: are positions metres and "
                "velocities m/s, both geocentric?"
            ),
        )

    def test_the_relative_orbit_has_the_size_asked_for(self) -> None:
        """With a·δe = 15.5 m and a·δi = 13.9 m at the start, the relative orbit is an ellipse of that
        size."""
        motion = self._motion(np.linspace(0.0, PERIOD_S, 25))
        first = motion.r_chaser_rtn_m[motion.sequence == motion.sequence[0]]
        assert 0.5 * 15.5 < np.abs(first[:, 0]).max() < 1.5 * 15.5, (
            "the relative orbit is of another radial size: are relative elements multiplied "
            "by a, and radial the first of RTN?"
        )
        assert 0.5 * 13.9 < np.abs(first[:, 2]).max() < 1.5 * 13.9, (
            "the relative orbit is of another size across the plane: is the third of RTN along r × v?"
        )

    def test_the_targets_velocity_is_the_derivative_of_its_position(self) -> None:
        t_s, step_s = 1000.0, 0.5
        motion = self._motion(t_s + step_s * np.arange(5.0))
        derivative = _five_point_derivative(motion.r_target_eci_m[:5], step_s)
        # The tolerance is 1e-5 of the speed, because mean-element models neglect the drift of the orbit
        # plane.
        np.testing.assert_allclose(
            motion.v_target_eci_m_s[2],
            derivative,
            atol=0.08,
            err_msg=(
                "the target's velocity is not the derivative of its position: other units, or "
                "another instant?"
            ),
        )

    def test_the_chasers_velocity_is_the_derivative_in_the_rotating_frame(self) -> None:
        t_s, step_s = 1000.0, 10.0
        motion = self._motion(t_s + step_s * np.arange(5.0))
        derivative = _five_point_derivative(motion.r_chaser_rtn_m[:5], step_s)
        # The tolerance is 1 % of the speed, because models may neglect terms of the order of e.
        speed = float(np.linalg.norm(derivative))
        np.testing.assert_allclose(
            motion.v_chaser_rtn_m_s[2],
            derivative,
            atol=0.01 * speed,
            err_msg=(
                "the chaser's velocity is not the derivative in the rotating RTN axes: is it "
                "the inertial one?"
            ),
        )

    def test_the_same_problem_gives_the_same_bits(self) -> None:
        t_s = np.linspace(0.0, PERIOD_S, 5)
        one, two = self._motion(t_s), self._motion(t_s)
        np.testing.assert_array_equal(
            one.r_chaser_rtn_m,
            two.r_chaser_rtn_m,
            err_msg="the same problem gives another motion: does it keep or draw something?",
        )
        np.testing.assert_array_equal(
            one.r_target_eci_m,
            two.r_target_eci_m,
            err_msg="the same problem gives another orbit: does it keep or draw something?",
        )

    def test_a_time_does_not_depend_on_the_others(self) -> None:
        """Additional times change a frame only by the effect of other integration steps."""
        t_s = np.linspace(0.0, PERIOD_S, 61)
        many, few = self._motion(t_s), self._motion(t_s[::2])
        first = many.sequence == many.sequence[0]
        some = few.sequence == few.sequence[0]
        np.testing.assert_allclose(
            many.r_chaser_rtn_m[first][::2],
            few.r_chaser_rtn_m[some],
            atol=1e-5,
            err_msg=(
                "a frame's relative position depends on which other times were asked for: is it "
                "differenced between them?"
            ),
        )
        np.testing.assert_allclose(
            many.r_target_eci_m[first][::2],
            few.r_target_eci_m[some],
            atol=10.0,
            err_msg="a frame's orbit depends on which other times were asked for",
        )

    def test_the_problem_is_left_alone(self) -> None:
        t_s = np.linspace(0.0, PERIOD_S, 5)
        problem = self.problem(t_s.copy())
        self.propagator().propagate(problem)
        np.testing.assert_array_equal(problem.t_s, t_s, err_msg=CHANGED)

    def test_two_body_motion_is_exact(self) -> None:
        """Capability ``exact-two-body``: both orbits against Newton's law, integrated by DOP853."""
        if "exact-two-body" not in self.capabilities:
            return
        motion = self._motion(np.linspace(0.0, PERIOD_S, 9))
        mu = Constants().mu_earth_m3_s2
        r_chaser, v_chaser = eci_from_rtn(
            motion.r_target_eci_m,
            motion.v_target_eci_m_s,
            motion.r_chaser_rtn_m,
            motion.v_chaser_rtn_m_s,
        )
        target = _newton(motion.r_target_eci_m[0], motion.v_target_eci_m_s[0], motion.t_s, mu)
        chaser = _newton(r_chaser[0], v_chaser[0], motion.t_s, mu)
        np.testing.assert_allclose(
            motion.r_target_eci_m,
            target[:, :3],
            atol=1e-3,
            err_msg=(
                "the target does not move by Newton's law; leave out 'exact-two-body', or solve "
                "Kepler's equation to rounding"
            ),
        )
        r_rtn, v_rtn = rtn_from_eci(target[:, :3], target[:, 3:], chaser[:, :3], chaser[:, 3:])
        np.testing.assert_allclose(
            motion.r_chaser_rtn_m,
            r_rtn,
            atol=1e-3,
            err_msg=(
                "the chaser does not move by Newton's law; leave out 'exact-two-body', which "
                "linear models are not"
            ),
        )
        np.testing.assert_allclose(
            motion.v_chaser_rtn_m_s,
            v_rtn,
            atol=1e-6,
            err_msg=(
                "the chaser's velocity is not that of Newton's law in rotating axes; leave out "
                "'exact-two-body'"
            ),
        )

    def _motion(self, t_s: FloatArray) -> Motion:
        return self.propagator().propagate(self.problem(t_s))


def _five_point_derivative(x: FloatArray, step: float) -> FloatArray:
    """(5, 3) values at equal steps → (3,) derivative at the middle one, with an error of order step⁴."""
    return np.asarray((x[0] - 8 * x[1] + 8 * x[3] - x[4]) / (12 * step))


def _newton(r_m: FloatArray, v_m_s: FloatArray, t_s: FloatArray, mu_m3_s2: float) -> FloatArray:
    """(F, 6) positions and velocities from t_s[0] on, by numerical integration in Cartesian
    coordinates."""

    def rate(_t: float, state: FloatArray) -> FloatArray:
        return np.concatenate([state[3:], -mu_m3_s2 * state[:3] / np.linalg.norm(state[:3]) ** 3])

    start = np.concatenate([r_m, v_m_s])
    solution = solve_ivp(
        rate, (t_s[0], t_s[-1]), start, "DOP853", t_s, rtol=1e-13, atol=[1e-6] * 3 + [1e-9] * 3
    )
    return np.asarray(solution.y.T)
