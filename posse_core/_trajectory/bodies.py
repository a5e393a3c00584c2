"""The motion and the attitudes of the bodies beside the target."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.start import Start
from posse_core._environment.ephemeris import sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._frames import (
    by_plane_turn,
    eci_from_rtn,
    matrix_from_quaternion,
    rtn_from_eci,
    unit,
)
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.craft_state import BodyState, Rates
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.registry import Registry
from posse_core._randomness import derived_seed, random_generator
from posse_core._scenario.attitude import check_law
from posse_core._scenario.bodies import BodyConfig
from posse_core._scenario.component import ComponentChoice, create
from posse_core._scenario.model import Scenario
from posse_core._trajectory.attitude import by_law
from posse_core._trajectory.joints import BodyMotion, JointLaws
from posse_core._trajectory.problem import orbit_epoch, resolve
from posse_core._trajectory.returned import CheckedLaw, propagated
from posse_core._trajectory.state import seen_from_chaser


class OtherBodies:
    """The bodies beside a scenario's target."""

    def __init__(self, scenario: Scenario, scene: Scene, registry: Registry) -> None:
        """Make the laws and the propagators.

        Args:
            scenario: with its bodies.
            scene: of the scenario; its bodies have the joints that laws move.
            registry: the components that are installed.

        Raises:
            InputError: a law or a propagator cannot be used for a body.
        """
        spacecraft = {body.name: body.spacecraft for body in scene.others}
        self._bodies = [
            body
            for name, config in scenario.bodies.items()
            for body in _members(name, config, scenario, spacecraft, registry)
        ]

    def states(self, row: Trajectory, index: int, every_t_s: FloatArray | None) -> tuple[BodyState, ...]:
        """The bodies at a trajectory's one row.

        Args:
            row: of target and chaser.
            index: of the frame whose random errors the attitudes have.
            every_t_s: (F,) times of the scenario's frames, of which the row is one and for which the
                motion is computed together; None for a row at any other time.

        Raises:
            InputError: a body cannot be propagated, or its law is undefined.
        """
        return tuple(body.state(row, index, every_t_s) for body in self._bodies)


def _members(
    name: str,
    config: BodyConfig,
    scenario: Scenario,
    spacecraft: Mapping[str, Spacecraft],
    registry: Registry,
) -> Iterator[_Carried | _Flying]:
    """The bodies of one key, from their spacecraft by name."""

    def joint_laws(member: str) -> JointLaws:
        return JointLaws.of(
            spacecraft[member],
            config.joints,
            registry,
            epoch=orbit_epoch(scenario.orbit),
            seed=scenario.seed,
            where=f"bodies.{member}.joints",
        )

    if config.mount is not None:
        mount = config.mount.mount()
        yield _Carried(mount.R_camera_from_sensor, mount.position_m, joint_laws(name))
        return
    where = f"bodies.{name}"
    check_law(registry, config.attitude, "target", f"{where}.attitude.law")
    choice = scenario.propagator if config.propagator is None else config.propagator
    propagator: Propagator = create(registry, "propagator", choice)
    if config.propagator is None and not propagator.needs_starts:
        raise InputError(
            f"{where}.propagator: the scenario's propagator {choice.name!r} reads recorded motion;"
            " name one for this body, such as roe"
        )
    for member, _ in config.members(name):
        law = CheckedLaw(create(registry, "attitude-law", config.attitude), config.attitude.name)
        laws = law, joint_laws(member)
        yield _Flying(member, where, config, scenario, propagator, choice, *laws, registry, {})


@dataclass(frozen=True)
class _Carried:
    """A body that is fixed to the chaser."""

    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
    joint_laws: JointLaws

    def state(self, row: Trajectory, index: int, every_t_s: FloatArray | None) -> BodyState:
        """See :meth:`OtherBodies.states`."""
        omega_camera_rad_s = row.omega_camera_rad_s[0]
        omega_body_rad_s = self.R_cam_from_body.T @ omega_camera_rad_s
        R_eci_from_body = matrix_from_quaternion(row.q_eci_from_camera[0]) @ self.R_cam_from_body
        articulation = self.joint_laws.articulation(
            BodyMotion(
                t_s=row.t_s,
                indices=np.array([index]),
                R_eci_from_body=R_eci_from_body[None],
                omega_body_rad_s=omega_body_rad_s[None],
                sun_direction_eci=unit(row.r_sun_eci_m - row.r_chaser_eci_m),
            )
        )
        swing_m_s = np.cross(omega_camera_rad_s, self.t_body_cam_m)
        rates = Rates(swing_m_s, omega_body_rad_s, omega_camera_rad_s)
        return BodyState(self.R_cam_from_body, self.t_body_cam_m, rates, articulation, is_carried=True)


@dataclass(frozen=True)
class _Flying:
    """A body in an orbit beside the target's.

    Attributes:
        name: of the body, which its random draws have in their purpose.
        where: its key, for messages.
        known: time → RTN position (3,) and velocity (3,).
    """

    name: str
    where: str
    config: BodyConfig
    scenario: Scenario
    propagator: Propagator
    choice: ComponentChoice
    law: AttitudeLaw
    joint_laws: JointLaws
    registry: Registry
    known: dict[float, tuple[FloatArray, FloatArray]]

    def state(self, row: Trajectory, index: int, every_t_s: FloatArray | None) -> BodyState:
        """See :meth:`OtherBodies.states`."""
        t_s = float(row.t_s[0])
        r_rtn_m, v_m_s = self._motion(t_s, every_t_s)
        v_rtn_m_s = v_m_s - by_plane_turn(row.plane_turn_rad_s[0], r_rtn_m)
        t_body_cam_m, v_body_cam_m_s = seen_from_chaser(row, 0, r_rtn_m, v_rtn_m_s)
        r_eci_m, v_eci_m_s = eci_from_rtn(
            row.r_target_eci_m,
            row.v_target_eci_m_s,
            r_rtn_m[None],
            v_rtn_m_s[None],
            row.plane_turn_rad_s,
        )
        R_eci_from_body, omega_body_rad_s = self._attitude(row, index, r_eci_m, v_eci_m_s)
        articulation = self.joint_laws.articulation(
            BodyMotion(
                t_s=row.t_s,
                indices=np.array([index]),
                R_eci_from_body=R_eci_from_body[None],
                omega_body_rad_s=omega_body_rad_s[None],
                sun_direction_eci=unit(row.r_sun_eci_m - r_eci_m),
            )
        )
        R_eci_from_cam = matrix_from_quaternion(row.q_eci_from_camera[0])
        return BodyState(
            R_cam_from_body=R_eci_from_cam.T @ R_eci_from_body,
            t_body_cam_m=t_body_cam_m,
            rates=Rates(v_body_cam_m_s, omega_body_rad_s, row.omega_camera_rad_s[0]),
            articulation=articulation,
        )

    def _motion(self, t_s: float, every_t_s: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """RTN position and velocity (3,) at a time."""
        if every_t_s is None:
            return self._propagated(np.array([t_s]))[t_s]
        if not self.known:
            self.known.update(self._propagated(np.unique(every_t_s)))
        return self.known[t_s]

    def _propagated(self, t_s: FloatArray) -> Mapping[float, tuple[FloatArray, FloatArray]]:
        """Time → position, and velocity in axes that leave out the turn of the plane, at (F,) times."""
        own_frames = "own-frames" in self.registry.spec("propagator", self.choice.name).capabilities
        try:
            motion = propagated(
                self.propagator, self._problem(t_s), self.choice.name, own_frames=own_frames
            )
        except InputError as error:
            raise InputError(f"{self.where}: {error}") from None
        if motion.sequence.min() != motion.sequence.max():
            raise InputError(f"{self.where}.relative: is several relative orbits; a body has one")
        v_m_s = motion.v_chaser_rtn_m_s + by_plane_turn(motion.plane_turn_rad_s, motion.r_chaser_rtn_m)
        rows = zip(motion.r_chaser_rtn_m, v_m_s, strict=True)
        return dict(zip(motion.t_s.tolist(), rows, strict=True))

    def _problem(self, t_s: FloatArray) -> PropagationProblem:
        scenario, relative = self.scenario, self.config.relative
        assert relative is not None  # else the body is carried
        problem = resolve(
            scenario.orbit,
            relative,
            t_s,
            scenario.constants,
            needs_starts=self.propagator.needs_starts,
            turns_plane=self.propagator.turns_plane,
        )
        problem = replace(problem, requested=True)
        draw = random_generator(scenario.seed, -1, f"body {self.name}: spread")
        dr_m, dv_m_s = draw.normal(size=(2, 3)) * (self.config.spread_m, self.config.spread_m_s)
        if not problem.starts or not (dr_m.any() or dv_m_s.any()):
            return problem
        if problem.forced is not None:
            moved = problem.forced.rtn + np.concatenate([dr_m, dv_m_s])
            return replace(problem, forced=replace(problem.forced, rtn=moved))
        return replace(problem, starts=tuple(_moved(each, dr_m, dv_m_s) for each in problem.starts))

    def _attitude(
        self, row: Trajectory, index: int, r_eci_m: FloatArray, v_eci_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """R_eci_from_body (3, 3) and the angular velocity (3,), body axes, at a state (1, 3)."""
        r_chaser_m, v_chaser_m_s = rtn_from_eci(
            r_eci_m, v_eci_m_s, row.r_chaser_eci_m, row.v_chaser_eci_m_s, row.plane_turn_rad_s
        )
        epoch = Epoch.from_iso(row.epoch_utc)
        around = Surroundings(
            subject="target",
            epoch=epoch,
            seed=derived_seed(self.scenario.seed, -1, f"body {self.name}: attitude"),
            t_s=row.t_s,
            indices=np.array([index]),
            r_target_eci_m=r_eci_m,
            v_target_eci_m_s=v_eci_m_s,
            r_sun_eci_m=row.r_sun_eci_m,
            r_sun_epoch_eci_m=sun_eci_m(*epoch.tdb(np.zeros(()))),
            r_chaser_rtn_m=r_chaser_m,
        )
        q, omega = by_law(self.law, around, v_chaser_m_s)
        R, omega_rad_s = matrix_from_quaternion(q[0]), omega[0]
        if self.config.count > 1:
            turn = random_generator(self.scenario.seed, -1, f"body {self.name}: turn").normal(size=4)
            R_law_from_body = matrix_from_quaternion(turn)
            R, omega_rad_s = R @ R_law_from_body, R_law_from_body.T @ omega_rad_s
        return R, omega_rad_s


def _moved(start: Start, dr_rtn_m: FloatArray, dv_rtn_m_s: FloatArray) -> Start:
    """A start that is displaced in the target's RTN axes, (3,) m and m/s."""
    target = start.target
    R = target.R_eci_from_rtn
    return Start(
        target,
        start.dr_eci_m + R @ dr_rtn_m,
        start.dv_eci_m_s + R @ (dv_rtn_m_s + np.cross(target.spin_rtn_rad_s, dr_rtn_m)),
        where=start.where,
    )
