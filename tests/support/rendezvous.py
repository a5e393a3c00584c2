"""A rendezvous without images: true motion, true attitude, and keypoints by projection plus noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

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
    R_with_z,
    matrix_from_quaternion,
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
RADIUS_M = 3.0
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
        camera_attitude_rad: standard deviation of the camera's known attitude about each axis.
        R_start: the target's attitude at the epoch, R_eci_from_body.
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
            radius_m=RADIUS_M,
            inertia_kg_m2=self.inertia,
            camera_attitude_rad=self.camera_attitude_rad,
        )
        return replace(made, **known)

    @cached_property
    def views(self) -> list[View]:
        """How the camera sees the target at the frames; its boresight is at the target's origin."""
        made = []
        for k, (state, R_eci_body) in enumerate(zip(self.truth(), self.attitude(self.t_s), strict=True)):
            r, v = self.target.two_body(np.array([state.t_s]))
            R_eci_rtn = R_eci_from_rtn(r[0], v[0])
            R_eci_cam = R_eci_rtn @ looking_at_target(state.r_rtn_m[None], np.array([k]))[0]
            origin = -R_eci_cam.T @ R_eci_rtn @ state.r_rtn_m
            made.append(View(R_eci_cam, R_eci_cam.T @ R_eci_body, origin))
        return made

    def biases(
        self, rng: np.random.Generator, share: float, time_s: float, angle_rad: float
    ) -> np.ndarray:
        """(F, K, 2) errors of the keypoints that change slowly with time and view, in shares of the
        target's diameter in the image: a Gauss–Markov process of standard deviation ``share``."""
        views = self.views
        bias = share * rng.standard_normal((len(POINTS_M), 2))
        made = [bias]
        for k in range(1, len(views)):
            turn = views[k - 1].R_cam_from_body.T @ views[k].R_cam_from_body
            angle = np.linalg.norm(rotation_vector_from_matrix(turn))
            kept = np.exp(-(self.t_s[k] - self.t_s[k - 1]) / time_s - angle / angle_rad)
            bias = kept * bias + np.sqrt(1 - kept**2) * share * rng.standard_normal(bias.shape)
            made.append(bias)
        return np.array(made)

    def readings(
        self,
        rng: np.random.Generator,
        *,
        what: str = "keypoints",
        poses: int | None = None,
        bias_share: np.ndarray | float = 0.0,
        sigma_m: float = 0.01,
        delay_s: float = 0.0,
        R_label: np.ndarray | None = None,
    ) -> list[Readings]:
        """The readings of all frames.

        Args:
            rng: of the noise.
            what: ``keypoints``, ``pose`` or ``sight+range``.
            poses: number of first frames that have the pose beside the keypoints; None for all.
            bias_share: errors of the keypoints beside the noise, broadcast to (F, K, 2), in shares of
                the target's diameter in the image.
            sigma_m: of the ranges.
            delay_s: of the arrival.
            R_label: (F, 3, 3) rotations of the body by which the keypoints are mistaken for others.
        """
        made = []
        shares = np.broadcast_to(bias_share, (len(self.t_s), len(POINTS_M), 2))
        for k, view in enumerate(self.views):
            R_label_k = np.eye(3) if R_label is None else R_label[k]
            points = POINTS_M @ (view.R_cam_from_body @ R_label_k).T + view.origin_cam_m
            distance = float(np.linalg.norm(view.origin_cam_m))
            px = CAMERA.project(points) + shares[k] * CAMERA.fx_px * 2 * RADIUS_M / distance
            px = px + self.sigma_px * rng.standard_normal(px.shape)
            sigma_px = np.full(len(px), self.sigma_px)
            error = matrix_from_rotation_vector(self.camera_attitude_rad * rng.standard_normal(3))
            wanted = what == "pose" or (what == "keypoints" and (poses is None or k < poses))
            sight, range_ = None, None
            if what == "sight+range":
                across = R_with_z(unit(view.origin_cam_m)) @ np.append(1e-4 * rng.standard_normal(2), 0)
                sight = LineOfSight(unit(unit(view.origin_cam_m) + across), 1e-4)
                range_ = RangeReading(distance + sigma_m * rng.standard_normal(), sigma_m)
            made.append(
                Readings(
                    k,
                    float(self.t_s[k]),
                    float(self.t_s[k]) + delay_s,
                    quaternion_from_matrix(view.R_eci_from_cam @ error),
                    KeypointReading(POINTS_M, px, sigma_px) if what == "keypoints" else None,
                    solve_pose(POINTS_M, px, sigma_px, CAMERA) if wanted else None,
                    sight,
                    range_,
                )
            )
        return made


@dataclass(frozen=True)
class View:
    """The target in a frame: camera's attitude, target's attitude and position in camera axes."""

    R_eci_from_cam: np.ndarray
    R_cam_from_body: np.ndarray
    origin_cam_m: np.ndarray


EPOCH = Epoch.from_iso("2022-01-31T02:02:27.58")


def errors(truth: Estimate, estimate: Estimate) -> np.ndarray:
    """(12,) or (6,) truth minus estimate, in the order of the covariance."""
    motion = np.concatenate([truth.r_rtn_m - estimate.r_rtn_m, truth.v_rtn_m_s - estimate.v_rtn_m_s])
    if estimate.q_eci_from_body is None:
        return motion
    turn = matrix_from_quaternion(estimate.q_eci_from_body).T @ matrix_from_quaternion(
        truth.q_eci_from_body
    )
    rate = truth.omega_body_rad_s - estimate.omega_body_rad_s
    return np.concatenate([motion, rotation_vector_from_matrix(turn), rate])


def nees(truth: Estimate, estimate: Estimate, part: slice = slice(None)) -> float:
    """Normalised estimation error squared."""
    error = errors(truth, estimate)[part]
    return float(error @ np.linalg.solve(estimate.covariance[part, part], error))
