"""States to take frames at: those of a scenario's frames, and those that a caller gives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import FloatArray, IntArray, evenly_spread
from posse_core._errors import InputError
from posse_core._interfaces.propagator import Propagator
from posse_core._model.scene import FrameState, Onward, Scene
from posse_core._model.trajectory import PLANE_TURN, Motion, Trajectory
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import create
from posse_core._scenario.model import Scenario
from posse_core._spacecraft.variation import RandomFinishes
from posse_core._trajectory.attitude import GivenAttitude, Laws
from posse_core._trajectory.bodies import OtherBodies
from posse_core._trajectory.build import (
    frames_problem,
    make_trajectory,
    scenario_problem,
    trajectory_of,
)
from posse_core._trajectory.joints import BY_LAW, BodyMotion, GivenJoints, JointLaws
from posse_core._trajectory.problem import orbit_epoch
from posse_core._trajectory.returned import propagated
from posse_core._trajectory.state import frame_state

_SAME_INSTANT_S = 1e-6
"""Times that are nearer to each other than this are one instant."""


class States:
    """The states of one scenario."""

    def __init__(
        self, scenario: Scenario, scene: Scene, registry: Registry, trajectory: Trajectory | None
    ) -> None:
        """Keep what states are made of; nothing is computed yet.

        Args:
            scenario: whose states they are.
            scene: of the scenario.
            registry: the components that are installed.
            trajectory: the scenario's, where it has been computed already.
        """
        self._scenario = scenario
        self._scene = scene
        self._registry = registry
        if trajectory is not None:
            self.trajectory = trajectory

    @cached_property
    def trajectory(self) -> Trajectory:
        """The motion over the scenario's frames."""
        return make_trajectory(self._scenario, self._registry)

    def row(
        self,
        index: int,
        *,
        t_s: float | None,
        r_rtn_m: ArrayLike | None,
        v_rtn_m_s: ArrayLike | None,
        q_eci_from_body: ArrayLike | None,
        q_eci_from_camera: ArrayLike | None,
        omega_body_rad_s: ArrayLike | None,
        omega_camera_rad_s: ArrayLike | None,
    ) -> Trajectory:
        """The trajectory's one row at a state; the arguments are those of
        :meth:`posse_core.Simulator.state`."""
        if index < 0:
            raise InputError(f"state: index is {index}; frames are numbered from 0")
        r = _row("r_rtn_m", r_rtn_m, 3)
        v = _row("v_rtn_m_s", v_rtn_m_s, 3)
        given = GivenAttitude(
            q_eci_from_body=_row("q_eci_from_body", q_eci_from_body, 4),
            q_eci_from_camera=_row("q_eci_from_camera", q_eci_from_camera, 4),
            omega_body_rad_s=_row("omega_body_rad_s", omega_body_rad_s, 3),
            omega_camera_rad_s=_row("omega_camera_rad_s", omega_camera_rad_s, 3),
        )
        if v is not None and r is None:
            raise InputError("state: v_rtn_m_s is given without r_rtn_m; give both")
        for name, q, omega in (
            ("body", given.q_eci_from_body, given.omega_body_rad_s),
            ("camera", given.q_eci_from_camera, given.omega_camera_rad_s),
        ):
            if omega is not None and q is None:
                raise InputError(
                    f"state: omega_{name}_rad_s is given without q_eci_from_{name}; give both"
                )
        by_law = given.q_eci_from_body is None and given.q_eci_from_camera is None
        if t_s is None and r is None and by_law:
            self._refuse_beyond_the_end(index)
            return self.trajectory.rows(np.array([index]))
        motion = self._motion(index, t_s, any_chaser=r is not None)
        if r is not None:
            at_rest = np.zeros_like(r)
            motion = replace(motion, r_chaser_rtn_m=r, v_chaser_rtn_m_s=at_rest if v is None else v)
        return self._by_laws(motion, index, given)

    def _by_laws(self, motion: Motion, index: int, given: GivenAttitude | None = None) -> Trajectory:
        """One row of motion with its attitudes, as frame ``index``."""
        return trajectory_of(
            motion,
            epoch=orbit_epoch(self._scenario.orbit),
            laws=self._laws,
            constants=self._scenario.constants,
            seed=self._scenario.seed,
            indices=np.array([index]),
            given=GivenAttitude() if given is None else given,
        )

    def onward(self, index: int, state: FrameState, *, own_frame: bool) -> FrameState:
        """A state of the scenario's own motion, with how it goes on.

        Args:
            index: of the frame whose random errors the attitudes have.
            state: at that frame, or at another time.
            own_frame: the state is that of the frame.
        """
        after_s, following = 0.0, None
        if own_frame and index + 1 < len(self.trajectory):
            ends = self.trajectory.rows(np.array([index, index + 1]))
            if ends.sequence[0] == ends.sequence[1]:
                after_s = float(ends.t_s[1] - ends.t_s[0])
                following = index + 1

        def at(later_s: float) -> FrameState:
            motion = self._motion_near(state.t_s + later_s, state.sequence)
            if motion is None:
                return state.after(later_s)
            drawn = int(self._indices_of_draws[index]) if own_frame else index
            return self.of_row(self._by_laws(motion, drawn), index, drawn=drawn)

        def next_frame() -> FrameState | None:
            if following is None:
                return None
            return self.onward(following, self.own(following), own_frame=True)

        return replace(state, onward=Onward(after_s, at, next_frame))

    @cached_property
    def _indices_of_draws(self) -> IntArray:
        """(F,) index of each frame before the scenario's choice of ``frames``, which its random errors
        and its joints have."""
        if self._scenario.frames is None:
            return np.arange(len(self.trajectory))
        return evenly_spread(self._frames_of_all(), self._scenario.frames)

    def _frames_of_all(self) -> int:
        """Number of frames that those of the scenario are chosen from."""
        name = self._scenario.propagator.name
        if "own-frames" in self._registry.spec("propagator", name).capabilities:
            return len(self._own_motion.t_s)
        problem = frames_problem(self._scenario, self._propagator)
        return len(problem.t_s) * max(1, len(problem.starts))

    def _motion_near(self, t_s: float, sequence: int) -> Motion | None:
        """The motion of one relative orbit at a time; None where the propagator has none."""
        for row in self._motions(t_s):
            if row.sequence[0] == sequence:
                return row
        return None

    def own(self, index: int, given: GivenJoints = BY_LAW) -> FrameState:
        """The state of the scenario's own frame ``index``, without how it goes on.

        Args:
            given: joints that are set in place of their laws.
        """
        row = self.trajectory.rows(np.array([index]))
        drawn = int(self._indices_of_draws[index])
        return self._of_row(row, index, drawn, given, every_t_s=self.trajectory.t_s)

    def of_row(
        self, row: Trajectory, index: int, *, drawn: int | None = None, given: GivenJoints = BY_LAW
    ) -> FrameState:
        """The state of a trajectory's one row, at any time, as frame ``index``.

        Args:
            drawn: index of the frame whose random errors it has; None for ``index``.
            given: joints that are set in place of their laws.
        """
        return self._of_row(row, index, index if drawn is None else drawn, given, every_t_s=None)

    @cached_property
    def joint_laws(self) -> JointLaws:
        """The laws of the target's joints."""
        return JointLaws.of(
            self._scene.spacecraft,
            self._scenario.joints,
            self._registry,
            epoch=orbit_epoch(self._scenario.orbit),
            seed=self._scenario.seed,
        )

    def check_joints(self) -> None:
        """Ask for the target's joints at every frame of the scenario, and for those of the bodies beside
        it at the first.

        Raises:
            InputError: A law cannot move its joint, or moves it beyond the limits.
            ComponentError: A law failed.
        """
        if self._scenario.joints:
            motion = BodyMotion.of_target(self.trajectory, self._indices_of_draws)
            self.joint_laws.values_and_rates(motion)
        if any(body.joints for body in self._scenario.bodies.values()):
            self.own(0)

    def _of_row(
        self,
        row: Trajectory,
        index: int,
        drawn: int,
        given: GivenJoints,
        *,
        every_t_s: FloatArray | None,
    ) -> FrameState:
        motion = BodyMotion.of_target(row, np.array([drawn]))
        joints = self.joint_laws.articulation(motion, given)
        state = replace(frame_state(row, 0, self._scenario.constants, joints), index=index)
        if self._finishes is not None:
            finishes = self._finishes.of_frame(drawn)
            state = replace(state, craft=replace(state.craft, finishes=finishes))
        if not self._scenario.bodies:
            return state
        others = self._others.states(row, drawn, every_t_s)
        return replace(state, craft=replace(state.craft, others=others))

    @cached_property
    def _finishes(self) -> RandomFinishes | None:
        """What varies of the target's materials from frame to frame, if anything does."""
        variation = self._scenario.variation
        if variation is None or variation.per == "run":
            return None
        return RandomFinishes(self._scene.spacecraft, variation, self._scenario.seed)

    @cached_property
    def _others(self) -> OtherBodies:
        return OtherBodies(self._scenario, self._scene, self._registry)

    def _motion(self, index: int, t_s: float | None, *, any_chaser: bool) -> Motion:
        """One row: the scenario's motion at a time, or at the time of its frame ``index``.

        Args:
            any_chaser: only the target's motion is of interest.
        """
        if t_s is None:
            self._refuse_beyond_the_end(index)
            return _row_of(self.trajectory, index)
        if not np.isfinite(t_s):
            raise InputError(f"state: t_s is {t_s}; give seconds since the scenario's epoch")
        rows = self._motions(float(t_s))
        if not rows:
            own_s, name = self._own_motion.t_s, self._scenario.propagator.name
            raise InputError(
                f"state: t_s is {t_s:g}, and the motion of propagator {name!r} is from"
                f" {own_s.min():g} to {own_s.max():g} s; give a time within"
            )
        if len(rows) > 1 and not any_chaser:
            raise InputError(
                f"state: the scenario has {len(rows)} relative orbits at t_s = {t_s:g}; give r_rtn_m,"
                " or take one of its frames by the index alone"
            )
        return rows[0]

    def _motions(self, t_s: float) -> list[Motion]:
        """The motion at a time, one row for each relative orbit; none beyond a propagator's own
        frames."""
        name = self._scenario.propagator.name
        if "own-frames" in self._registry.spec("propagator", name).capabilities:
            return list(_interpolated(self._own_motion, t_s))
        problem = scenario_problem(self._scenario, self._propagator, np.array([t_s]))
        motion = propagated(self._propagator, problem, name, own_frames=False)
        return [_row_of(motion, i) for i in range(len(motion.t_s))]

    def _refuse_beyond_the_end(self, index: int) -> None:
        if index >= len(self.trajectory):
            raise InputError(
                f"state: the scenario has {len(self.trajectory)} frames, so none of index {index};"
                " give t_s for another time"
            )

    @cached_property
    def _propagator(self) -> Propagator:
        made: Propagator = create(self._registry, "propagator", self._scenario.propagator)
        return made

    @cached_property
    def _laws(self) -> Laws:
        return Laws.of(self._scenario.attitude, self._registry)

    @cached_property
    def _own_motion(self) -> Motion:
        """All frames of a propagator that has frames of its own."""
        problem = frames_problem(self._scenario, self._propagator)
        name = self._scenario.propagator.name
        return propagated(self._propagator, problem, name, own_frames=True)


def _row(name: str, value: ArrayLike | None, size: int) -> FloatArray | None:
    """(1, size) of what a caller gave."""
    if value is None:
        return None
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"state: {name} is {value!r}; {size} finite numbers are needed")
    return array[None]


def _row_of(motion: Motion | Trajectory, i: int) -> Motion:
    """Row ``i`` alone."""
    return Motion(
        t_s=motion.t_s[[i]],
        r_target_eci_m=motion.r_target_eci_m[[i]],
        v_target_eci_m_s=motion.v_target_eci_m_s[[i]],
        r_chaser_rtn_m=motion.r_chaser_rtn_m[[i]],
        v_chaser_rtn_m_s=motion.v_chaser_rtn_m_s[[i]],
        sequence=motion.sequence[[i]],
        extras=_turn(motion, motion.plane_turn_rad_s[[i]]),
    )


def _turn(motion: Motion | Trajectory, plane_turn_rad_s: FloatArray) -> Mapping[str, FloatArray]:
    """The extra that velocities in RTN need, if the motion has it."""
    return {PLANE_TURN: plane_turn_rad_s} if PLANE_TURN in motion.extras else {}


def _interpolated(motion: Motion, t_s: float) -> Iterator[Motion]:
    """A row for each relative orbit that holds the time: a frame of its own where there is one, else by
    cubic Hermite polynomials through positions and velocities."""
    for number in np.unique(motion.sequence):
        own = np.flatnonzero(motion.sequence == number)
        own = own[np.argsort(motion.t_s[own], kind="stable")]
        times_s = motion.t_s[own]
        nearest = int(np.argmin(np.abs(times_s - t_s)))
        if abs(times_s[nearest] - t_s) <= _SAME_INSTANT_S:
            yield _row_of(motion, own[nearest])
        elif times_s[0] < t_s < times_s[-1]:
            after = int(np.searchsorted(times_s, t_s))
            ends = own[after - 1 : after + 1]
            states = np.hstack([motion.r_target_eci_m, motion.r_chaser_rtn_m])[ends]
            rates = np.hstack([motion.v_target_eci_m_s, motion.v_chaser_rtn_m_s])[ends]
            from scipy.interpolate import CubicHermiteSpline  # slow to import, and seldom needed

            curve = CubicHermiteSpline(motion.t_s[ends], states, rates)
            (r_target, r_chaser), (v_target, v_chaser) = (
                np.split(curve([t_s], order), 2, axis=1) for order in (0, 1)
            )
            turn = np.interp([t_s], motion.t_s[ends], motion.plane_turn_rad_s[ends])
            yield Motion(
                np.array([t_s]),
                r_target,
                v_target,
                r_chaser,
                v_chaser,
                np.array([number]),
                _turn(motion, turn),
            )
