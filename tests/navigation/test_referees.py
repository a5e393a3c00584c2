"""The filters against other libraries: filterpy's Kalman filter, gtsam's smoother."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from rendezvous import CAMERA, POINTS_M, START_SIGMAS, World
from scipy.linalg import expm

from posse_core import PoseEstimate, Readings
from posse_core._frames import (
    R_eci_from_rtn,
    cross_matrix,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
)
from posse_core._navigation.kalman import EkfNavigator, UkfNavigator
from posse_core._navigation.options import KalmanOptions

N = np.sqrt(3.986004418e14 / 7.1e6**3)
HILL = np.zeros((6, 6))
HILL[:3, 3:] = np.eye(3)
HILL[3, 0], HILL[3, 4], HILL[4, 3], HILL[5, 2] = 3 * N**2, 2 * N, -2 * N, -(N**2)
"""Hill's equations of relative motion about a circular orbit, x' = HILL x."""


def van_loan(rates: np.ndarray, density: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition and process noise of x' = rates x + white noise (Van Loan 1978)."""
    n = len(rates)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -rates, density, rates.T
    grown = expm(block * h)
    transition = grown[n:, n:].T
    return transition, transition @ grown[:n, n:]


@pytest.mark.parametrize("kind", [EkfNavigator, UkfNavigator])
def test_positions_about_a_circular_orbit_are_filtered_as_by_filterpy(kind):
    """Poses whose rotation says nothing, at a few metres, where the motion is linear."""
    world = World(e=0.0, rtn=(1.0, -4.0, 2.0, 1e-3, -2e-3, 1e-3), t_s=np.arange(0.0, 600.0, 20.0))
    rng = np.random.default_rng(0)
    options = KalmanOptions(
        acceleration_m_s2_rthz=1e-4, adaptive=False, gate_probability=1e-12, iterations=1
    )
    sigma_m, problem = 0.05, world.problem(rng)
    navigator = kind(options)
    navigator.start(problem)
    density = np.diag([0, 0, 0, 1e-8, 1e-8, 1e-8])
    transition, noise = van_loan(HILL, density, 20.0)
    reference = KalmanFilter(dim_x=6, dim_z=3)
    reference.x = np.concatenate([problem.start.r_rtn_m, problem.start.v_rtn_m_s])
    reference.P = problem.start.covariance.copy()
    reference.F, reference.Q, reference.R = transition, noise, sigma_m**2 * np.eye(3)
    reference.H = np.eye(6)[:3]
    for k, state in enumerate(world.truth()):
        R_eci_rtn = R_eci_from_rtn(*(part[0] for part in world.target.two_body(np.array([state.t_s]))))
        position = state.r_rtn_m + sigma_m * rng.standard_normal(3)
        covariance = np.diag(np.repeat([1e3, sigma_m], 3) ** 2)
        pose = PoseEstimate(np.eye(3), -position, covariance, np.ones(11, bool), 1.0)
        q = quaternion_from_matrix(R_eci_rtn)  # the camera's axes are RTN axes
        navigator.update(Readings(k, state.t_s, state.t_s, q, pose=pose))
        if k > 0:
            reference.predict()
        reference.update(position)
        estimate = navigator.estimate(state.t_s)
        sigmas = np.sqrt(np.diag(reference.P))
        found = np.concatenate([estimate.r_rtn_m, estimate.v_rtn_m_s])
        np.testing.assert_allclose(found / sigmas, reference.x / sigmas, atol=3e-3)
        scaled = estimate.covariance[:6, :6] / np.outer(sigmas, sigmas)
        np.testing.assert_allclose(scaled, reference.P / np.outer(sigmas, sigmas), atol=3e-3)


class Smoother:
    """All frames of a flight at once, with gtsam: Hill's motion in RTN axes, a free constant rate, and
    pixels by our camera's projection; derivatives by differences."""

    def __init__(self, world: World, options: KalmanOptions) -> None:
        self.graph, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        h = world.t_s[1] - world.t_s[0]
        density = options.acceleration_m_s2_rthz**2 * np.diag([0, 0, 0, 1, 1, 1])
        self.transition, motion_noise = van_loan(HILL, density, h)
        density = np.radians(options.angular_acceleration_deg_s2_rthz) ** 2
        turning_noise = density * np.kron([[h**3 / 3, h**2 / 2], [h**2 / 2, h]], np.eye(3))
        self.h = h
        self.motion_noise = gtsam.noiseModel.Gaussian.Covariance(motion_noise)
        self.turning_noise = gtsam.noiseModel.Gaussian.Covariance(turning_noise)

    def key(self, letter: str, k: int) -> int:
        return gtsam.symbol(letter, k)

    def _custom(self, noise, keys, error, shapes) -> None:
        """A factor by a function of local changes of its variables, differentiated by differences."""

        def call(_this, values, jacobians):
            here = error(values, *[np.zeros(n) for n in shapes])
            if jacobians is not None:
                for i, n in enumerate(shapes):
                    step = 1e-6
                    columns = []
                    for j in range(n):
                        changes = [np.zeros(m) for m in shapes]
                        changes[i][j] = step
                        plus = error(values, *changes)
                        changes[i][j] = -step
                        columns.append((plus - error(values, *changes)) / (2 * step))
                    jacobians[i] = np.asfortranarray(np.array(columns).T)
            return here

        self.graph.add(gtsam.CustomFactor(noise, keys, call))

    def prior(self, rtn, R, sigma_R, sigma_w) -> None:
        diagonal = gtsam.noiseModel.Diagonal.Sigmas
        self.graph.add(gtsam.PriorFactorVector(self.key("x", 0), rtn, diagonal(START_SIGMAS)))
        self.graph.add(
            gtsam.PriorFactorRot3(self.key("r", 0), gtsam.Rot3(R), diagonal(np.full(3, sigma_R)))
        )
        self.graph.add(
            gtsam.PriorFactorVector(self.key("w", 0), np.zeros(3), diagonal(np.full(3, sigma_w)))
        )

    def step(self, k: int) -> None:
        x0, x1, r0, r1, w0, w1 = (self.key(s, i) for s in "xrw" for i in (k - 1, k))

        def motion(values, a, b):
            return values.atVector(x1) + b - self.transition @ (values.atVector(x0) + a)

        def turning(values, a, b, c, d):
            before = (
                values.atRot3(r0)
                .retract(a)
                .compose(gtsam.Rot3.Expmap(self.h * (values.atVector(w0) + c)))
            )
            turn = gtsam.Rot3.Logmap(before.between(values.atRot3(r1).retract(b)))
            return np.concatenate([turn, values.atVector(w1) + d - values.atVector(w0) - c])

        self._custom(self.motion_noise, [x0, x1], motion, (6, 6))
        self._custom(self.turning_noise, [r0, r1, w0, w1], turning, (3, 3, 3, 3))

    def keypoints(self, k: int, readings: Readings, R_rtn_eci: np.ndarray) -> None:
        x, r = self.key("x", k), self.key("r", k)
        R_cam_eci = matrix_from_quaternion(readings.q_eci_from_camera).T
        sigmas = np.repeat(readings.keypoints.sigma_px, 2)

        def away(values, a, b):
            R = R_cam_eci @ values.atRot3(r).retract(b).matrix()
            origin = -R_cam_eci @ R_rtn_eci.T @ (values.atVector(x) + a)[:3]
            return (CAMERA.project(POINTS_M @ R.T + origin) - readings.keypoints.points_px).ravel()

        self._custom(gtsam.noiseModel.Diagonal.Sigmas(sigmas), [x, r], away, (6, 3))

    def guess(self, k: int, rtn, R, w) -> None:
        self.values.insert(self.key("x", k), np.asarray(rtn))
        self.values.insert(self.key("r", k), gtsam.Rot3(R))
        self.values.insert(self.key("w", k), np.asarray(w))

    def solved(self) -> tuple[gtsam.Values, gtsam.Marginals]:
        found = gtsam.LevenbergMarquardtOptimizer(self.graph, self.values).optimize()
        return found, gtsam.Marginals(self.graph, found)


@pytest.mark.parametrize("kind", [EkfNavigator, UkfNavigator])
def test_the_last_estimate_is_that_of_a_smoother_over_all_frames(kind):
    """A filter loses nothing against all readings at once, except where it is linearised."""
    world = World(
        e=0.0,
        rtn=(4.0, -30.0, 8.0, 1e-3, -3e-3, 2e-3),
        rate_body_rad_s=(0.004, -0.009, 0.006),
        inertia=np.eye(3),
        t_s=np.arange(0.0, 120.0, 10.0),
    )
    options = KalmanOptions(
        acceleration_m_s2_rthz=1e-4,
        angular_acceleration_deg_s2_rthz=0.01,
        tumbling_share=0.0,
        bias_share=0.0,
        adaptive=False,
        gate_probability=1e-9,
        rate_deg_s=1.0,
    )
    rng = np.random.default_rng(5)
    problem = replace(world.problem(rng), inertia_kg_m2=None)
    read = world.readings(rng, poses=1)
    navigator = kind(options)
    navigator.start(problem)
    for readings in read:
        navigator.update(readings)
    smoother = Smoother(world, options)
    rtn = np.concatenate([problem.start.r_rtn_m, problem.start.v_rtn_m_s])
    first = matrix_from_quaternion(read[0].q_eci_from_camera) @ read[0].pose.R_cam_from_body
    smoother.prior(rtn, first, 0.3, np.radians(1.0))
    truth = world.truth()
    for k, state in enumerate(truth):
        R_eci_rtn = R_eci_from_rtn(*(part[0] for part in world.target.two_body(np.array([state.t_s]))))
        smoother.keypoints(k, read[k], R_eci_rtn.T)
        near = matrix_from_quaternion(state.q_eci_from_body) @ matrix_from_rotation_vector(
            0.02 * rng.standard_normal(3)
        )
        smoother.guess(k, np.r_[state.r_rtn_m + 0.2, state.v_rtn_m_s], near, state.omega_body_rad_s)
        if k > 0:
            smoother.step(k)
    values, marginals = smoother.solved()
    last = len(truth) - 1
    estimate = navigator.estimate(truth[-1].t_s)
    motion = values.atVector(smoother.key("x", last))
    turn = gtsam.Rot3.Logmap(
        values.atRot3(smoother.key("r", last)).between(
            gtsam.Rot3(matrix_from_quaternion(estimate.q_eci_from_body))
        )
    )
    rate = values.atVector(smoother.key("w", last))
    away = np.concatenate(
        [
            estimate.r_rtn_m - motion[:3],
            estimate.v_rtn_m_s - motion[3:],
            turn,
            estimate.omega_body_rad_s - rate,
        ]
    )
    keys = [smoother.key(letter, last) for letter in "xrw"]
    blocks = [marginals.marginalCovariance(key) for key in keys]
    sigmas = np.sqrt(np.concatenate([np.diag(block) for block in blocks]))
    assert np.all(np.abs(away) < 0.3 * sigmas)
    np.testing.assert_allclose(np.sqrt(np.diag(estimate.covariance)), sigmas, rtol=0.05)
    assert np.linalg.norm(cross_matrix(turn)) < 0.01
