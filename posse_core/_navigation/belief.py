"""What a navigator knows at an instant, and its way through time and impulses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._dynamics.plan import Burn
from posse_core._interfaces.navigator import Estimate, NavigationProblem
from posse_core._navigation import impulses
from posse_core._navigation.dynamics import Dynamics, Instant
from posse_core._navigation.kinematics import MOTION, SIZE, TURNING, VELOCITY, Kinematics
from posse_core._navigation.linearisation import Linearisation, Tangents
from posse_core._navigation.options import DynamicsOptions

_LEAST_SIGMAS = np.repeat([1e-6, 1e-9], 3)
"""A micrometre, and a nanometre a second: nothing is taken to be known better at the start."""
NEW_ATTITUDE_RAD = 0.3
"""Standard deviation of a new attitude before the readings that it is from are used for it."""


@dataclass(frozen=True)
class Biases:
    """The slow parts of the keypoints' errors.

    Attributes:
        points_body_m: (M, 3) the keypoints, each known by its position.
        shares: (2 M,) the slow part of each coordinate, as a share of the target's diameter in the
            image.
        t_s: instant of the last frame with keypoints.
        R_cam_from_body: (3, 3) how the target was seen then.
        range_m: from how far.
    """

    points_body_m: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    shares: FloatArray = field(default_factory=lambda: np.empty(0))
    t_s: float = 0.0
    R_cam_from_body: FloatArray = field(default_factory=lambda: np.eye(3))
    range_m: float = 1.0


@dataclass(frozen=True)
class Scales:
    """Factors on covariances of noise, learnt on the way.

    Attributes:
        keypoints: on that of the keypoints.
        motion, turning: on the process noise of the relative motion and of the attitude.
        frames: number of frames that they were learnt from.
    """

    keypoints: float = 1.0
    motion: float = 1.0
    turning: float = 1.0
    frames: int = 0


@dataclass(frozen=True)
class Belief:
    """A Gaussian belief of the relative motion, the attitude and the keypoints' biases.

    Attributes:
        at: the instant, and the target's orbit.
        x: the mean; its attitude and rate mean nothing unless ``oriented``.
        covariance: (12 + 2 M, 12 + 2 M) of the errors of ``x``, then of the biases.
        oriented: whether the attitude is known.
        biases: of the keypoints.
        scales: of the noise.
        refused: number of frames in a row that were refused as a whole.
    """

    at: Instant
    x: Kinematics
    covariance: FloatArray
    oriented: bool = False
    biases: Biases = field(default_factory=Biases)
    scales: Scales = field(default_factory=Scales)
    refused: int = 0

    def estimate(self) -> Estimate:
        """The belief as the interface has it, in RTN axes."""
        to_rtn = self.at.rtn_from_eci
        rtn = to_rtn @ np.concatenate([self.x.dr_eci_m, self.x.dv_eci_m_s])
        motion, turning = self.covariance[MOTION, MOTION], self.covariance[TURNING, TURNING]
        if not self.oriented:
            return Estimate(self.at.t_s, rtn[:3], rtn[3:], _symmetric(to_rtn @ motion @ to_rtn.T))
        covariance = np.empty((SIZE, SIZE))
        covariance[MOTION, MOTION] = to_rtn @ motion @ to_rtn.T
        covariance[MOTION, TURNING] = to_rtn @ self.covariance[MOTION, TURNING]
        covariance[TURNING, MOTION] = covariance[MOTION, TURNING].T
        covariance[TURNING, TURNING] = turning
        return Estimate(
            self.at.t_s,
            rtn[:3],
            rtn[3:],
            _symmetric(covariance),
            frames.quaternion_from_matrix(self.x.R_eci_from_body),
            self.x.omega_body_rad_s,
        )


class Propagation:
    """Carries beliefs through time and impulses.

    Args:
        problem: what is known before the first reading.
        options: forces and process noise.
        rate_rad_s: standard deviation of the target's rate before it was seen to turn.
        linearisation: how.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        options: DynamicsOptions,
        rate_rad_s: float = 1.0,
        linearisation: Linearisation | None = None,
    ) -> None:
        self._dynamics = Dynamics(problem.target, problem.inertia_kg_m2, options)
        self._thrusters = problem.thrusters
        self._linearisation = linearisation or Tangents()
        self._unknown = np.diag(np.repeat([NEW_ATTITUDE_RAD, rate_rad_s], 3) ** 2)

    def belief(self, estimate: Estimate) -> Belief:
        """An estimate as a belief."""
        at = self._dynamics.instant(estimate.t_s)
        to_eci = np.linalg.inv(at.rtn_from_eci)
        state = to_eci @ np.concatenate([estimate.r_rtn_m, estimate.v_rtn_m_s])
        R, omega = np.eye(3), np.zeros(3)
        oriented = estimate.q_eci_from_body is not None and estimate.omega_body_rad_s is not None
        covariance = np.zeros((SIZE, SIZE))
        covariance[TURNING, TURNING] = self._unknown
        if estimate.q_eci_from_body is not None and estimate.omega_body_rad_s is not None:
            R = frames.matrix_from_quaternion(estimate.q_eci_from_body)
            omega = estimate.omega_body_rad_s
            covariance[TURNING, TURNING] = estimate.covariance[TURNING, TURNING]
            covariance[MOTION, TURNING] = to_eci @ estimate.covariance[MOTION, TURNING]
            covariance[TURNING, MOTION] = covariance[MOTION, TURNING].T
        known = estimate.covariance[MOTION, MOTION] + np.diag(_LEAST_SIGMAS**2)
        covariance[MOTION, MOTION] = to_eci @ known @ to_eci.T
        return Belief(at, Kinematics(state[:3], state[3:], R, omega), _symmetric(covariance), oriented)

    def disoriented(self, belief: Belief) -> Belief:
        """The belief without what it knew of the attitude."""
        covariance = belief.covariance.copy()
        covariance[TURNING, :] = covariance[:, TURNING] = 0.0
        covariance[TURNING, TURNING] = self._unknown
        x = replace(belief.x, R_eci_from_body=np.eye(3), omega_body_rad_s=np.zeros(3))
        return replace(belief, x=x, covariance=covariance, oriented=False)

    def later(self, belief: Belief, t_s: float, burns: Iterable[Burn], *, with_last: bool) -> Belief:
        """The belief at ``t_s``.

        Args:
            belief: at an instant, before any impulse at the same one.
            t_s: the instant, not before the belief's.
            burns: all impulses that were commanded; earlier ones than the belief are in it already.
            with_last: whether an impulse at ``t_s`` itself is included.
        """
        for burn in impulses.effective(burns, self._thrusters):
            if belief.at.t_s <= burn.t_s and (burn.t_s < t_s or (with_last and burn.t_s == t_s)):
                belief = self._kicked(self._coasted(belief, burn.t_s), burn.dv_rtn_m_s)
        return self._coasted(belief, t_s)

    def _coasted(self, belief: Belief, t_s: float) -> Belief:
        if t_s == belief.at.t_s:
            return belief
        flow = self._linearisation.flow(
            self._dynamics,
            belief.at,
            belief.x,
            belief.covariance[:SIZE, :SIZE],
            t_s,
            (belief.scales.motion, belief.scales.turning),
        )
        covariance = belief.covariance.copy()
        covariance[:SIZE] = flow.transition @ covariance[:SIZE]
        covariance[:, :SIZE] = covariance[:, :SIZE] @ flow.transition.T
        covariance[:SIZE, :SIZE] += flow.noise
        later = replace(belief, at=flow.at, x=flow.x, covariance=_symmetric(covariance))
        return later if belief.oriented else self.disoriented(later)

    def _kicked(self, belief: Belief, dv_rtn_m_s: FloatArray) -> Belief:
        R = belief.at.R_eci_from_rtn
        covariance = belief.covariance.copy()
        covariance[VELOCITY, VELOCITY] += R @ impulses.covariance(dv_rtn_m_s, self._thrusters) @ R.T
        x = replace(belief.x, dv_eci_m_s=belief.x.dv_eci_m_s + R @ dv_rtn_m_s)
        return replace(belief, x=x, covariance=covariance)


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray((matrix + matrix.T) / 2)
