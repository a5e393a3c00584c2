"""The loop of a flight: truth, frame, readings, estimate, impulse, and again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.plan import Burn
from posse_core._flight.chaser import Chaser, as_known, carried_out, disturbed
from posse_core._flight.expected import expected
from posse_core._flight.eye import Eye
from posse_core._flight.problem import FlightProblem
from posse_core._flight.returned import commanded
from posse_core._flight.watch import Step, Watch
from posse_core._frames import matrix_from_quaternion, quaternion_from_matrix
from posse_core._interfaces.controller import Controller
from posse_core._interfaces.navigator import Estimate, Readings
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.component import failures_named
from posse_core._plugins.registry import Registry
from posse_core._randomness import random_generator
from posse_core._scenario.component import create
from posse_core._scenario.model import Scenario
from posse_core._simulator.frame import Frame
from posse_core._simulator.simulator import Simulator
from posse_core._simulator.states import States


class Flight:
    """A flight of one seed. It may be flown once."""

    def __init__(
        self,
        scenario: Scenario,
        problem: FlightProblem,
        simulator: Simulator,
        eye: Eye,
        registry: Registry,
        expecting: Simulator | None = None,
    ) -> None:
        """expecting: makes the frames that the chaser expects to see, if it compares them."""
        config = problem.config
        self._problem, self._simulator, self._eye = problem, simulator, eye
        self._expecting = expecting
        self._states = States(scenario, simulator.scene, registry, None)
        self._chaser = Chaser(problem.propagator, problem.motion, problem.start)
        self._watch = Watch(config.navigator, registry, problem.navigation)
        self._controller: Controller = create(registry, "controller", config.controller)

    def steps(self, known: Mapping[int, Readings]) -> Iterator[Step]:
        """Fly, and yield each frame with its consequences.

        Args:
            known: index of a frame → its readings, of an earlier attempt; no image is rendered for them.
        """
        problem, config = self._problem, self._problem.config
        with failures_named("controller", config.controller.name):
            self._controller.start(problem.control)
        last_read_s = 0.0
        below_m = config.end.below_m or problem.navigation.radius_m
        for index, t_s in enumerate(problem.frames_s.tolist()):
            step = self._step(index, t_s, known.get(index), last=index == len(problem.frames_s) - 1)
            yield step
            if _has_readings(step.readings):
                last_read_s = t_s
            unread_s = config.end.without_readings_s
            if unread_s is not None and t_s - last_read_s >= unread_s:
                return
            if np.linalg.norm(step.row.r_chaser_rtn_m[0]) < below_m:
                return

    def _step(self, index: int, t_s: float, known: Readings | None, *, last: bool) -> Step:
        problem, config = self._problem, self._problem.config
        aim = self._watch.estimate(t_s)
        row, R_eci_from_camera_known = self._pointed(index, t_s, aim)
        frame = None
        readings = known
        if readings is None:
            frame = self._simulator.frame(self._states.of_row(row, index))
            q_known = quaternion_from_matrix(R_eci_from_camera_known)
            expects = expected(aim, row, q_known, self._expected_frame(index, aim, q_known))
            readings = self._eye.read(frame.labels, frame.image, q_known, expects)
        self._watch.read(readings, row)
        burn_s = t_s + config.burn_after_s
        innovations = self._watch.deliver(burn_s)
        estimate = self._watch.estimate(t_s)
        dv_commanded = dv = np.zeros(3)
        decided = self._watch.estimate(burn_s)
        if decided is not None and not last:
            dv_commanded = commanded(self._controller, config.controller.name, decided)
            if np.any(dv_commanded):
                generator = random_generator(problem.seed, index, "thrusters")
                dv = carried_out(dv_commanded, problem.control.thrusters, generator)
                self._chaser.fire(Burn(burn_s, dv))
                self._watch.burned(Burn(burn_s, dv_commanded))
        return Step(row, frame, readings, estimate, innovations, burn_s, dv_commanded, dv)

    def _expected_frame(
        self, index: int, aim: Estimate | None, q_eci_from_camera: FloatArray
    ) -> Frame | None:
        """The frame that the chaser expects to see, as its own renderer makes it."""
        if self._expecting is None or aim is None or aim.q_eci_from_body is None:
            return None
        state = self._expecting.state(
            index,
            t_s=aim.t_s,
            r_rtn_m=aim.r_rtn_m,
            v_rtn_m_s=aim.v_rtn_m_s,
            q_eci_from_body=aim.q_eci_from_body,
            q_eci_from_camera=q_eci_from_camera,
        )
        return self._expecting.frame(state)

    def _pointed(self, index: int, t_s: float, aim: Estimate | None) -> tuple[Trajectory, FloatArray]:
        """The true state with the camera as its law points it by what the chaser knows of its motion.

        Returns:
            One row, and the camera's attitude (3, 3) as the chaser knows it, R_eci_from_camera.
        """
        errors, seed = self._problem.config.errors, self._problem.seed
        aimed = self._row(
            index,
            t_s,
            r_rtn_m=None if aim is None else aim.r_rtn_m,
            v_rtn_m_s=None if aim is None else aim.v_rtn_m_s,
        )
        R_true = disturbed(
            matrix_from_quaternion(aimed.q_eci_from_camera[0]),
            float(np.radians(errors.pointing_deg)),
            random_generator(seed, index, "camera-pointing"),
        )
        R_known = as_known(R_true, errors.camera_attitude_deg, seed, index)
        rtn = self._chaser.at(t_s)
        row = self._row(
            index,
            t_s,
            r_rtn_m=rtn[:3],
            v_rtn_m_s=rtn[3:],
            q_eci_from_camera=quaternion_from_matrix(R_true),
            omega_camera_rad_s=aimed.omega_camera_rad_s[0],
        )
        return row, R_known

    def _row(
        self,
        index: int,
        t_s: float,
        *,
        r_rtn_m: FloatArray | None,
        v_rtn_m_s: FloatArray | None,
        q_eci_from_camera: FloatArray | None = None,
        omega_camera_rad_s: FloatArray | None = None,
    ) -> Trajectory:
        return self._states.row(
            index,
            t_s=t_s,
            r_rtn_m=r_rtn_m,
            v_rtn_m_s=v_rtn_m_s,
            q_eci_from_body=None,
            q_eci_from_camera=q_eci_from_camera,
            omega_body_rad_s=None,
            omega_camera_rad_s=omega_camera_rad_s,
        )


def _has_readings(readings: Readings) -> bool:
    return any((readings.keypoints, readings.pose, readings.line_of_sight, readings.range))
