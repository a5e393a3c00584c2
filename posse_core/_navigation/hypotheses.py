"""A few beliefs side by side where the attitude is ambiguous.

A belief follows the poses that agree with it. A pose that agrees with none gives rise to another belief,
with a small weight; it gains weight as far as it predicts the frames to come better. What one frame can
say against a belief is bounded, as for any reading there is a chance that it is an outlier (Barfoot
2017, State Estimation for Robotics, section 5.3). A reading of a symmetric body is seen by each belief
as it fits best.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.navigator import Innovation, KeypointReading, NavigationProblem, Readings
from posse_core._navigation import biases
from posse_core._navigation.belief import NEW_ATTITUDE_RAD, Belief
from posse_core._navigation.filter import Filter, Outcome
from posse_core._navigation.kinematics import ATTITUDE, MOTION, POSITION, RATE, TURNING
from posse_core._navigation.measurements import Distance, Eye, Keypoints, Pose, Sight
from posse_core._navigation.options import KalmanOptions

LOST_GROWTH = 2.0
"""Factor by which the standard deviations of a doubted position grow with each frame."""
OUTLIER = 0.05
"""Probability that a frame's attitude is an outlier; also the weight of a new belief."""
LEAST_WEIGHT = 0.005
MIRRORED = 0.1
"""Weight of a mirrored attitude beside the one that fits better."""
_FIRST = 1e6
SAME_RAD = math.radians(2.0)
"""Attitudes nearer than this, or within three standard deviations of the likelier, are one."""
_PAIR_TURN_RAD = math.radians(120.0)
"""Turn between two poses up to which it is taken to be the shorter way."""
_PAIR_RAD, _PAIR_SHARE = 0.1, 0.3
"""Error of the turn between two poses, and of its rate as a share."""
_MIRROR_EXCESS = 3.0
"""How much larger a mirrored pose's root mean square of residuals may be, in standard deviations."""


@dataclass(frozen=True)
class Hypothesis:
    """A belief and its probability among the others."""

    belief: Belief
    weight: float


@dataclass(frozen=True)
class SeenAttitude:
    """An attitude by one frame alone."""

    t_s: float
    R_eci_from_body: FloatArray


class Bank:
    """The beliefs, and what readings do to them.

    Args:
        problem: what is known before the first reading.
        options: of the filter.
        estimator: of each belief.
        belief: the first one.
    """

    def __init__(
        self, problem: NavigationProblem, options: KalmanOptions, estimator: Filter, belief: Belief
    ) -> None:
        self._problem, self._options, self._filter = problem, options, estimator
        self._symmetries = np.concatenate([np.eye(3)[None], problem.symmetries])
        self._unexplained: SeenAttitude | None = None
        self.hypotheses: tuple[Hypothesis, ...] = (Hypothesis(belief, 1.0),)

    @property
    def best(self) -> Belief:
        """The belief with the largest weight."""
        return self.hypotheses[0].belief

    def replace(self, beliefs: Sequence[Belief]) -> None:
        """Put others in the places of the beliefs, such as the same ones at a later time."""
        self.hypotheses = tuple(
            replace(h, belief=belief) for h, belief in zip(self.hypotheses, beliefs, strict=True)
        )

    def update(self, readings: Readings) -> Innovation | None:
        """Use a frame's readings, whose instant is the beliefs'."""
        R = frames.matrix_from_quaternion(readings.q_eci_from_camera).T
        eye = Eye(self._problem.camera, R, self._problem.camera_attitude_rad)
        innovation = None
        if readings.keypoints is not None or readings.pose is not None:
            innovation = self._use_attitude(eye, readings)
        refused = readings.keypoints is None and readings.pose is None
        found = [self._use_position(eye, readings, h, refused) for h in self.hypotheses]
        self.hypotheses = tuple(hypothesis for hypothesis, _ in found)
        return _joined(innovation, found[0][1])

    def _use_attitude(self, eye: Eye, readings: Readings) -> Innovation | None:
        """Keypoints or pose: update the beliefs, weigh them, and make new ones."""
        outcomes = [
            self._outcome(eye, readings, h.belief) if h.belief.oriented else None
            for h in self.hypotheses
        ]
        likelihoods = [o.log_likelihood for o in outcomes if o is not None and o.accepted]
        new = []
        if likelihoods:
            self._unexplained = None
        else:
            new = self._new(eye, readings)
        weighed = []
        for h, o in zip(self.hypotheses, outcomes, strict=True):
            factor = OUTLIER if likelihoods else 1.0
            if o is None:
                belief = self._counted(h.belief, bool(new))
            else:
                belief = self._counted(o.belief, o.accepted)
                if o.accepted:
                    factor += (1 - OUTLIER) * math.exp(o.log_likelihood - max(likelihoods))
            weighed.append(Hypothesis(belief, h.weight * factor))
        self.hypotheses = self._sorted(weighed + new)
        return None if outcomes[0] is None else outcomes[0].innovation

    def _counted(self, belief: Belief, accepted: bool) -> Belief:
        """The belief with its count of refused frames.

        After many in a row the position may be wrong, so its covariance grows with each further one
        until a frame is accepted, but not beyond the range.
        """
        belief = replace(belief, refused=0 if accepted else belief.refused + 1)
        wide = np.trace(belief.covariance[POSITION, POSITION]) > np.sum(belief.x.dr_eci_m**2)
        if belief.refused < self._options.lost_frames or wide:
            return belief
        covariance = belief.covariance.copy()
        covariance[MOTION, :] *= LOST_GROWTH
        covariance[:, MOTION] *= LOST_GROWTH
        return replace(belief, covariance=covariance)

    def _outcome(self, eye: Eye, readings: Readings, belief: Belief) -> Outcome:
        """Update by the keypoints, or by the pose if there are none, as the symmetry fits best."""
        read, pose = readings.keypoints, readings.pose
        symmetry = np.eye(3)
        if pose is not None:
            symmetry = self._nearest_symmetry(eye.R_cam_from_body(belief.x), pose.R_cam_from_body)
        if read is None:
            assert pose is not None
            return self._filter.update(
                belief, Pose.of(eye, pose, symmetry, self._options.pose_inflation)
            )
        points = np.asarray(read.points_body_m, dtype=np.float64)
        belief, slots = biases.renewed(belief, points, eye.R_cam_from_body(belief.x), self._options)
        turned = KeypointReading(points @ symmetry.T, read.points_px, read.sigma_px)
        scale, diameter_m = belief.scales.keypoints, 2 * self._problem.radius_m
        outcome = self._filter.update(belief, Keypoints(eye, turned, slots, scale, diameter_m))
        after = outcome.belief
        return replace(outcome, belief=biases.seen(after, eye.R_cam_from_body(after.x)))

    def _nearest_symmetry(self, R: FloatArray, R_read: FloatArray) -> FloatArray:
        """The symmetry S with which ``R_read`` · Sᵀ is nearest to R."""
        alike = np.einsum("ij,sij->s", R.T @ R_read, self._symmetries)
        return np.asarray(self._symmetries[int(np.argmax(alike))])

    def _new(self, eye: Eye, readings: Readings) -> list[Hypothesis]:
        """Beliefs that a pose gives rise to, with which none that is there agrees."""
        pose = readings.pose
        if pose is None:
            return []
        seen = SeenAttitude(readings.t_s, eye.R_cam_from_eci.T @ pose.R_cam_from_body)
        born = self._born(eye, readings, seen)
        self._unexplained = seen
        if born is None:
            return []
        if any(h.belief.oriented for h in self.hypotheses):
            return [Hypothesis(born, OUTLIER)]
        mirrored = self._mirrored(eye, readings, pose, born)
        # Without any attitude before, the weight of what is there does not count.
        found = [Hypothesis(born, _FIRST)]
        return found if mirrored is None else [*found, Hypothesis(mirrored, _FIRST * MIRRORED)]

    def _alike(self, belief: Belief, R_eci_from_body: FloatArray) -> bool:
        """Whether an attitude, or one that looks the same, agrees with a belief's."""
        symmetry = self._nearest_symmetry(belief.x.R_eci_from_body, R_eci_from_body)
        return _agrees(belief, R_eci_from_body @ symmetry.T)

    def _born(self, eye: Eye, readings: Readings, seen: SeenAttitude) -> Belief | None:
        """A belief with the attitude of a pose, updated by the frame that the pose is from."""
        parent = self.best
        rate, sigma = self._first_rate(seen, parent)
        covariance = parent.covariance.copy()
        covariance[TURNING, :] = covariance[:, TURNING] = 0.0
        covariance[ATTITUDE, ATTITUDE] = NEW_ATTITUDE_RAD**2 * np.eye(3)
        covariance[RATE, RATE] = sigma**2 * np.eye(3)
        x = replace(parent.x, R_eci_from_body=seen.R_eci_from_body, omega_body_rad_s=rate)
        outcome = self._outcome(
            eye, readings, replace(parent, x=x, covariance=covariance, oriented=True, refused=0)
        )
        return outcome.belief if outcome.accepted else None

    def _first_rate(self, seen: SeenAttitude, parent: Belief) -> tuple[FloatArray, float]:
        """Rate of a new belief, body axes, and its standard deviation."""
        wide = math.radians(self._options.rate_deg_s)
        before = self._unexplained
        if before is not None and seen.t_s > before.t_s:
            symmetry = self._nearest_symmetry(before.R_eci_from_body, seen.R_eci_from_body)
            turn = frames.rotation_vector_from_matrix(
                before.R_eci_from_body.T @ seen.R_eci_from_body @ symmetry.T
            )
            angle, span_s = float(np.linalg.norm(turn)), seen.t_s - before.t_s
            if angle < _PAIR_TURN_RAD:
                rate = symmetry.T @ turn / span_s
                return rate, math.hypot(_PAIR_RAD, _PAIR_SHARE * angle) / span_s
        if parent.oriented:
            # It is the same body, so its angular velocity in inertial axes is the parent's.
            rate = seen.R_eci_from_body.T @ parent.x.R_eci_from_body @ parent.x.omega_body_rad_s
            return rate, min(wide, float(np.linalg.norm(rate)) + 0.1 * wide)
        return np.zeros(3), wide

    def _mirrored(self, eye: Eye, readings: Readings, pose: PoseEstimate, born: Belief) -> Belief | None:
        """The belief with the attitude mirrored in depth, if the keypoints fit it nearly as well.

        Seen from afar, points near a plane look the same if the plane leans as far the other way.
        """
        read = readings.keypoints
        if read is None:
            return None
        points = np.asarray(read.points_body_m) - np.mean(read.points_body_m, axis=0)
        normal = np.linalg.svd(points)[2][2]
        sight = frames.unit(pose.t_body_cam_m)
        R = _reflection(sight) @ pose.R_cam_from_body @ _reflection(normal)
        seen = SeenAttitude(readings.t_s, eye.R_cam_from_eci.T @ R)
        flipped = replace(readings, pose=replace(pose, R_cam_from_body=R))
        belief = self._born(eye, flipped, seen)
        if belief is None or self._alike(born, belief.x.R_eci_from_body):
            return None
        own = Keypoints(eye, read, np.empty(0, dtype=np.int64), 1.0, 0.0)
        sigma = np.repeat(np.asarray(read.sigma_px), 2)

        def rms(of: Belief) -> float:
            return float(np.sqrt(np.mean((own.residual(of.x) / sigma) ** 2)))

        return belief if rms(belief) < rms(born) + _MIRROR_EXCESS else None

    def _use_position(
        self, eye: Eye, readings: Readings, h: Hypothesis, alone: bool
    ) -> tuple[Hypothesis, Innovation | None]:
        """Range; and line of sight where the frame gave no attitude to this belief."""
        belief, innovation = h.belief, None
        if readings.line_of_sight is not None and (alone or belief.refused or not belief.oriented):
            outcome = self._filter.update(belief, Sight(eye, readings.line_of_sight))
            belief, innovation = outcome.belief, outcome.innovation
            if alone:
                belief = self._counted(belief, outcome.accepted)
        if readings.range is not None:
            outcome = self._filter.update(belief, Distance(readings.range))
            belief, innovation = outcome.belief, _joined(innovation, outcome.innovation)
        return replace(h, belief=belief), innovation

    def _sorted(self, found: list[Hypothesis]) -> tuple[Hypothesis, ...]:
        """The likeliest beliefs, each attitude once, weights of sum one."""
        kept: list[Hypothesis] = []
        for h in sorted(found, key=lambda h: -h.weight):
            for k, other in enumerate(kept):
                if h.belief.oriented == other.belief.oriented and (
                    not h.belief.oriented or self._alike(other.belief, h.belief.x.R_eci_from_body)
                ):
                    kept[k] = replace(other, weight=other.weight + h.weight)
                    break
            else:
                kept.append(h)
        total = sum(h.weight for h in kept[: self._options.hypotheses])
        normed = [replace(h, weight=h.weight / total) for h in kept[: self._options.hypotheses]]
        likely = [h for h in normed if h.weight >= LEAST_WEIGHT]
        return tuple(sorted(likely, key=lambda h: -h.weight))


def _agrees(belief: Belief, R_eci_from_body: FloatArray) -> bool:
    """Whether an attitude agrees with a belief's."""
    turn = frames.rotation_vector_from_matrix(belief.x.R_eci_from_body.T @ R_eci_from_body)
    within = turn @ np.linalg.solve(belief.covariance[ATTITUDE, ATTITUDE], turn) <= 3.0**2
    return bool(within or np.linalg.norm(turn) <= SAME_RAD)


def _reflection(normal: FloatArray) -> FloatArray:
    return np.asarray(np.eye(3) - 2 * np.outer(normal, normal))


def _joined(one: Innovation | None, other: Innovation | None) -> Innovation | None:
    if one is None or other is None:
        return one or other
    return Innovation(one.nis + other.nis, one.dof + other.dof, one.rejected + other.rejected)
