"""The conformance class for controllers."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics.elements import state_from_keplerian
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Start, Target
from posse_core._environment.time import Epoch
from posse_core._interfaces.controller import Controller, ControlProblem, Waypoint
from posse_core._interfaces.navigator import Estimate
from posse_core._interfaces.propagator import PropagationProblem
from posse_core._plugins.options import NoOptions
from posse_core._propagators.roe import RoePropagator
from posse_core.testing.conformance import CHANGED, Conformance

_EPOCH = Epoch.from_iso("2022-01-31T02:02:27.58")
_START = np.array([4.0, -30.0, 3.0, 0.0, 0.01, 0.0])
_SIGMAS = np.repeat([0.01, 0.0002, 0.02, 0.001], 3)


class ControllerConformance(Conformance):
    """What every controller must do. A subclass provides :meth:`controller` and ``capabilities``.

    The flight is from 30 m behind a target on a low orbit with e = 1e-4 to 10 m behind it, within 300 s,
    with an impulse possible every 10 s. For a controller with another domain, override :meth:`problem`.
    """

    @abstractmethod
    def controller(self) -> Controller:
        """A new controller."""

    def problem(self) -> ControlProblem:
        """The task; its plan is of two impulses that lead roughly to the waypoint."""
        constants = Constants()
        elements = np.array([7.1e6, 1e-4, *np.radians([98.2, 334.0, 52.0, 318.0])])
        target = Target(*state_from_keplerian(elements, constants.mu_earth_m3_s2), constants)
        return ControlProblem(
            _EPOCH,
            target,
            (Waypoint(300.0, 400.0, np.array([0.0, -10.0, 0.0]), np.zeros(3)),),
            np.arange(0.0, 401.0, 10.0),
            plan=(
                Burn(0.0, np.array([-0.02, 0.06, -0.01])),
                Burn(300.0, np.array([-0.02, -0.06, 0.0])),
            ),
        )

    def test_commands_are_three_finite_numbers(self) -> None:
        problem = self.problem()
        for dv in self._commands(self.controller(), problem):
            assert isinstance(dv, np.ndarray), (
                "a command is an array; return np.array([...]) with m/s along R, T and N"
            )
            assert dv.shape == (3,), "a command has three numbers: m/s along R, T and N"
            assert dv.dtype == np.float64, (
                "a command is of float64; is it computed in single precision or from integers?"
            )
            assert np.isfinite(dv).all(), (
                "a command is not a number: is something divided by zero, or the programme "
                "without solution not handled?"
            )

    def test_no_impulse_is_above_the_limit(self) -> None:
        problem = replace(self.problem(), largest_m_s=0.01)
        sizes = np.linalg.norm(self._commands(self.controller(), problem), axis=1)
        assert sizes.max() <= 0.01 * (1 + 1e-9), (
            "an impulse is above ControlProblem.largest_m_s; is the limit applied to each "
            "axis, and not to the size?"
        )

    def test_the_same_flight_gives_the_same_bits(self) -> None:
        """Also for a controller that has flown before: a start leaves nothing of the last flight."""
        problem, controller = self.problem(), self.controller()
        one = self._commands(controller, problem)
        np.testing.assert_array_equal(
            self._commands(controller, problem),
            one,
            err_msg=(
                "the second flight of a controller differs from its first: start() leaves "
                "something of the last flight"
            ),
        )
        np.testing.assert_array_equal(
            self._commands(self.controller(), problem),
            one,
            err_msg=(
                "a new controller commands something else: does it draw, or share a state with others?"
            ),
        )

    def test_what_it_is_given_is_left_alone(self) -> None:
        problem, untouched = self.problem(), self.problem()
        controller = self.controller()
        controller.start(problem)
        estimate, copy = self._estimate(0.0, _START), self._estimate(0.0, _START)
        controller.command(estimate)
        for name in ("r_rtn_m", "v_rtn_m_s", "covariance"):
            np.testing.assert_array_equal(getattr(estimate, name), getattr(copy, name), err_msg=CHANGED)
        np.testing.assert_array_equal(problem.burns_s, untouched.burns_s, err_msg=CHANGED)
        for given, kept in zip(problem.waypoints, untouched.waypoints, strict=True):
            np.testing.assert_array_equal(given.r_rtn_m, kept.r_rtn_m, err_msg=CHANGED)
            np.testing.assert_array_equal(given.v_rtn_m_s, kept.v_rtn_m_s, err_msg=CHANGED)
        for burn, same in zip(problem.plan, untouched.plan, strict=True):
            np.testing.assert_array_equal(burn.dv_rtn_m_s, same.dv_rtn_m_s, err_msg=CHANGED)

    def test_a_command_given_is_not_changed_later(self) -> None:
        """A controller that returns its own array would rewrite the record of the flight."""
        problem, controller = self.problem(), self.controller()
        controller.start(problem)
        first = controller.command(self._estimate(0.0, _START))
        kept = first.copy()
        for t_s in problem.burns_s[1:4]:
            controller.command(self._estimate(float(t_s), 1.1 * _START))
        np.testing.assert_array_equal(
            first,
            kept,
            err_msg=(
                "a command that was given changed later: it is the controller's own array; return a copy"
            ),
        )

    def test_the_attitude_may_be_known_or_not(self) -> None:
        """A covariance (12, 12), and (6, 6) where the navigator estimates no attitude."""
        unknown = self._estimate(0.0, _START)
        known = replace(
            unknown,
            covariance=np.diag(_SIGMAS**2),
            q_eci_from_body=np.array([1.0, 0.0, 0.0, 0.0]),
            omega_body_rad_s=np.array([0.0, 0.0, 0.01]),
        )
        for estimate in (known, unknown):
            controller = self.controller()
            controller.start(self.problem())
            assert np.isfinite(controller.command(estimate)).all(), (
                "a command is not a number with a covariance of (12, 12) or (6, 6); are its "
                "rows taken as position and velocity first?"
            )

    def test_there_need_not_be_an_estimate_at_every_instant(self) -> None:
        problem, controller = self.problem(), self.controller()
        controller.start(problem)
        for t_s in problem.burns_s[2::3]:
            assert np.isfinite(controller.command(self._estimate(float(t_s), _START))).all(), (
                "a command is not a number where estimates of some instants are missing; does "
                "it count on each of them?"
            )

    def test_it_brings_the_chaser_to_the_waypoint(self) -> None:
        """Without errors, to within a tenth of the way; not asked of ``no-waypoints``."""
        if "no-waypoints" in self.capabilities:
            return
        problem = self.problem()
        (goal,) = problem.waypoints
        states = self._flight(self.controller(), problem)[1]
        held = states[problem.burns_s >= goal.t_s, :3]
        away_m = np.linalg.norm(held - goal.r_rtn_m, axis=1)
        assert away_m.max() < 0.1 * np.linalg.norm(_START[:3] - goal.r_rtn_m), (
            "the chaser is not at the waypoint when it should be; are the axes R, T, N, and "
            "velocities those in the rotating frame?"
        )

    def test_it_needs_no_goal(self) -> None:
        """Capability ``no-waypoints``."""
        if "no-waypoints" not in self.capabilities:
            return
        commands = self._commands(self.controller(), replace(self.problem(), waypoints=()))
        assert np.isfinite(commands).all(), (
            "a command is not a number without waypoints; leave out the capability 'no- waypoints'"
        )

    def _commands(self, controller: Controller, problem: ControlProblem) -> FloatArray:
        return self._flight(controller, problem)[0]

    def _flight(self, controller: Controller, problem: ControlProblem) -> tuple[FloatArray, FloatArray]:
        """(B, 3) commands and (B, 6) RTN states after them; all is known, thrusters are exact."""
        controller.start(problem)
        state, commands, states = _START, [], []
        for k, t_s in enumerate(problem.burns_s):
            if k:
                state = _later(problem.target, float(problem.burns_s[k - 1]), state, float(t_s))
            dv = controller.command(self._estimate(float(t_s), state))
            state = state + np.concatenate([np.zeros(3), dv])
            commands.append(dv)
            states.append(state)
        return np.array(commands), np.array(states)

    def _estimate(self, t_s: float, rtn: FloatArray) -> Estimate:
        return Estimate(t_s, rtn[:3].copy(), rtn[3:].copy(), np.diag(_SIGMAS[:6] ** 2))


def _later(target: Target, t_s: float, rtn: FloatArray, then_s: float) -> FloatArray:
    """(6,) RTN state at an instant → (6,) at a later one, by exact two-body motion."""
    r, v = target.two_body(np.array([t_s]))
    now = Target(r[0], v[0], target.constants)
    motion = RoePropagator(NoOptions()).propagate(
        PropagationProblem(
            _EPOCH, now, (Start.from_rtn(now, rtn[:3], rtn[3:]),), np.array([then_s - t_s])
        )
    )
    return np.concatenate([motion.r_chaser_rtn_m[0], motion.v_chaser_rtn_m_s[0]])
