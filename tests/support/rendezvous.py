"""A rendezvous without images: true motion, true attitude, and keypoints by projection plus noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from posse_core._attitude.camera import looking_at_target
from posse_core._attitude.tumbling import torque_free_attitude
from posse_core._constants import Constants
from posse_core._detection.pnp import solve_pose
from posse_core._dynamics.elements import state_from_keplerian
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Start, Target
from posse_core._environment.time import Epoch
from posse_core._frames import (
    R_eci_from_rtn,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
    rotation_vector_from_matrix,
    unit,
)
from posse_core._interfaces.navigator import (
    Estimate,
    KeypointReading,
    LineOfSight,
    NavigationProblem,
    RangeReading,
    Readings,
    ThrusterErrors,
)
from posse_core._interfaces.propagator import PropagationProblem
from posse_core._model.camera import Camera
from posse_core._plugins.options import NoOptions
from posse_core._propagators.roe import RoePropagator

CAMERA = Camera(1024, 1024, 1500.0, 1500.0, 511.5, 511.5, 0.01)
POINTS_M = np.array(
    [[x, y, z] for x in (-1.2, 1.2) for y in (-1.0, 1.0) for z in (-1.5, 1.5)]
    + [[0.0, 3.0, 0.4], [0.3, -3.0, -0.4], [0.6, 0.2, 2.4]]
)
INERTIA = np.diag([1.0, 1.6, 2.1])
START_SIGMAS = np.repeat([2.0, 0.01], 3)


@dataclass(frozen=True)
class World:
    """A flight of which everything is known.

    Attributes:
        e: the target's eccentricity; it starts at perigee.
        rtn: (6,) the chaser's true state at the epoch, RTN axes.
        rate_body_rad_s: (3,) the target's at the epoch.
        inertia: (3, 3).
        t_s: (F,) the frames.
        burns: as carried out.
        sigma_px: standard deviation of the keypoints.
        bias_share: (K, 2) of the target's diameter in the image, added to the keypoints.
        known: what the navigator is told beside or instead of the truth.
    """

    e: float = 0.001
    rtn: Sequence[float] = (10.0, -60.0, 15.0, 0.002, -0.01, 0.001)
    rate_body_rad_s: Sequence[float] = (0.004, -0.003, 0.006)
    inertia: np.ndarray = field(default_factory=lambda: INERTIA)
    t_s: np.ndarray = field(default_factory=lambda: np.arange(0.0, 300.0, 10.0))
    burns: tuple[Burn, ...] = ()
    sigma_px: float = 1.0
    camera_attitude_rad: float = 0.0
    R_start: np.ndarray = field(default_factory=lambda: matrix_from_rotation_vector([0.5, -1.0, 0.3]))

    @property
    def target(self) -> Target:
        """At the epoch."""
        a = 7.1e6 / (1 - self.e)
        state = state_from_keplerian(np.array([a, self.e, 1.2, 0.4, 0.9, 0.0]), 3.986004418e14)
        return Target(*state, Constants())

    def truth(self, t_s: np.ndarray | None = None) -> list[Estimate]:
        """The true states at instants, the frames' if none are given; they have no covariance."""
        t_s = self.t_s if t_s is None else np.asarray(t_s, float)
        target = self.target
        start = Start.from_rtn(target, np.array(self.rtn[:3]), np.array(self.rtn[3:]))
        motion = RoePropagator(NoOptions()).propagate(
            PropagationProblem(EPOCH, target, (start,), t_s, burns=self.burns)
        )
        R = self.attitude(t_s)
        # Rates by central differences of the closed form.
        h = 1e-3
        turn = np.swapaxes(self.attitude(t_s - h), -1, -2) @ self.attitude(t_s + h)
        omega = rotation_vector_from_matrix(turn) / (2 * h)
        return [
            Estimate(
                float(t),
                motion.r_chaser_rtn_m[k],
                motion.v_chaser_rtn_m_s[k],
                np.zeros((12, 12)),
                quaternion_from_matrix(R[k]),
                omega[k],
            )
            for k, t in enumerate(t_s)
        ]

    def attitude(self, t_s: np.ndarray) -> np.ndarray:
        """(F, 3, 3) R_eci_from_body."""
        return torque_free_attitude(
            np.asarray(self.inertia), np.array(self.rate_body_rad_s), self.R_start, np.asarray(t_s)
        )

    def problem(self, rng: np.random.Generator, **known) -> NavigationProblem:
        """What the navigator is told: the start with random errors of START_SIGMAS."""
        start = Estimate(
            0.0,
            np.array(self.rtn[:3]) + START_SIGMAS[:3] * rng.standard_normal(3),
            np.array(self.rtn[3:]) + START_SIGMAS[3:] * rng.standard_normal(3),
            np.diag(START_SIGMAS**2),
        )
        made = NavigationProblem(
            EPOCH,
            self.target,
            start,
            CAMERA,
            radius_m=3.0,
            inertia_kg_m2=self.inertia,
            camera_attitude_rad=self.camera_attitude_rad,
        )
        return replace(made, **known)

    def readings(
        self,
        rng: np.random.Generator,
        *,
        what: str = "keypoints",
        bias_share: np.ndarray | float = 0.0,
        sigma_m: float = 0.01,
        delay_s: float = 0.0,
        R_label: np.ndarray | None = None,
    ) -> list[Readings]:
        """The readings of all frames: keypoints with the pose of each frame, pose, sight or range.

        ``R_label`` (F, 3, 3) are rotations by which the keypoints are mistaken for each other.
        """
        truth = self.truth()
        r_eci = [self.target.two_body(np.array([s.t_s])) for s in truth]
        made = []
        for k, state in enumerate(truth):
            R_eci_rtn = R_eci_from_rtn(r_eci[k][0][0], r_eci[k][1][0])
            R_eci_cam = R_eci_rtn @ looking_at_target(state.r_rtn_m[None], np.array([k]))[0]
            R_cam_body = R_eci_cam.T @ self.attitude(np.array([state.t_s]))[0]
            origin = -R_eci_cam.T @ R_eci_rtn @ state.r_rtn_m
            label = np.eye(3) if R_label is None else R_label[k]
            points = POINTS_M @ label.T @ R_cam_body.T + origin
            size_px = CAMERA.fx_px * 6.0 / np.linalg.norm(origin)
            px = CAMERA.project(points) + bias_share * size_px
            px = px + self.sigma_px * rng.standard_normal(px.shape)
            error = matrix_from_rotation_vector(self.camera_attitude_rad * rng.standard_normal(3))
            read = KeypointReading(POINTS_M, px, np.full(len(px), self.sigma_px))
            sight = unit(origin + 0.0)
            made.append(
                Readings(
                    k,
                    state.t_s,
                    state.t_s + delay_s,
                    quaternion_from_matrix(R_eci_cam @ error),
                    keypoints=read if what == "keypoints" else None,
                    pose=solve_pose(POINTS_M, px, read.sigma_px, CAMERA)
                    if what in ("keypoints", "pose")
                    else None,
                    line_of_sight=LineOfSight(sight, 1e-4) if what == "sight+range" else None,
                    range=RangeReading(
                        float(np.linalg.norm(origin) + sigma_m * rng.standard_normal()), sigma_m
                    )
                    if what == "sight+range"
                    else None,
                )
            )
        return made


EPOCH = Epoch.from_iso("2022-01-31T02:02:27.58")
EXACT = ThrusterErrors()


def errors(truth: Estimate, estimate: Estimate) -> np.ndarray:
    """(12,) or (6,) truth minus estimate, in the order of the covariance."""
    motion = np.concatenate([truth.r_rtn_m - estimate.r_rtn_m, truth.v_rtn_m_s - estimate.v_rtn_m_s])
    if estimate.q_eci_from_body is None:
        return motion
    from posse_core._frames import matrix_from_quaternion

    turn = matrix_from_quaternion(estimate.q_eci_from_body).T @ matrix_from_quaternion(
        truth.q_eci_from_body
    )
    rate = truth.omega_body_rad_s - estimate.omega_body_rad_s
    return np.concatenate([motion, rotation_vector_from_matrix(turn), rate])


def nees(truth: Estimate, estimate: Estimate, part: slice = slice(None)) -> float:
    """Normalised estimation error squared."""
    error = errors(truth, estimate)[part]
    return float(error @ np.linalg.solve(estimate.covariance[part, part], error))
