"""One Kalman filter: an update by a reading, with outliers refused.

The update is iterated: a reading is made linear about the motion that it leads to (Bell and Cathey 1993,
IEEE Trans. Automatic Control 38, 294; with sigma points García-Fernández et al. 2015, IEEE Trans. Signal
Processing 63, 5561). Errors of the attitude are rotations on the right of the mean, and the covariance
is moved to the tangent space of the new mean.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

from posse_core._arrays import BoolArray, FloatArray
from posse_core._interfaces.navigator import Innovation
from posse_core._navigation import adaptation
from posse_core._navigation.belief import Belief, Scales
from posse_core._navigation.kinematics import ATTITUDE, SIZE, Kinematics, moved_tangent
from posse_core._navigation.linearisation import Linearisation, Reading
from posse_core._navigation.measurements import Keypoints
from posse_core._navigation.options import KalmanOptions

_LEAST_POINTS = 3
_LARGEST_INFLATION = 16.0
_STILL = 0.05
"""Iterations end when a step is below this part of the standard deviations."""


class NoisyReading(Reading, Protocol):
    """A reading whose noise is known."""

    def noise(self, x: Kinematics) -> FloatArray:
        """(m, m) covariance of the residual's noise."""


@dataclass(frozen=True)
class Outcome:
    """What a reading did to a belief.

    Attributes:
        belief: after it; as before if the reading was refused.
        innovation: how the reading agreed with the belief before; None where it could not be compared.
        accepted: whether it was used.
        log_likelihood: of the reading, up to a number that is the same for all beliefs. No keypoint
            counts for less than one at the gate.
    """

    belief: Belief
    innovation: Innovation | None
    accepted: bool
    log_likelihood: float


class Filter:
    """Updates beliefs.

    Args:
        linearisation: how readings are made linear.
        options: of the filter.
    """

    def __init__(self, linearisation: Linearisation, options: KalmanOptions) -> None:
        self._linearisation = linearisation
        self._options = options

    def update(self, belief: Belief, reading: NoisyReading) -> Outcome:
        """Use a reading of the belief's instant."""
        keypoints = isinstance(reading, Keypoints)
        prior = belief.covariance
        residual, J, excess = self._linear(belief, reading)
        noise = reading.noise(belief.x)
        S = J @ prior @ J.T + excess + noise
        if not (np.isfinite(S).all() and np.isfinite(residual).all()):
            # Part of the target would be behind the camera, or beyond its lens.
            return self._refused(belief, None, -np.inf)
        group = 2 if keypoints else len(residual)
        limit = float(chi2.isf(self._options.gate_probability, group))
        distances, log_dets = _group_distances(residual, S, group)
        likelihood = -0.5 * float(np.sum(np.minimum(distances, limit) + log_dets))
        kept = np.repeat(distances <= limit, group)
        nis, dof = _nis(residual, S), len(residual)
        inflation = 1.0
        if kept.sum() >= max(dof / 2, group * (_LEAST_POINTS if keypoints else 1)):
            inflation = self._inflation(residual[kept], S[np.ix_(kept, kept)])
        else:
            inflation = np.inf
        innovation = Innovation(nis, dof, int((~kept).sum()) if np.isfinite(inflation) else dof)
        if not np.isfinite(inflation):
            return self._refused(belief, innovation, likelihood)
        after = self._updated(belief, reading, kept, inflation)
        if after is None:
            return self._refused(belief, replace(innovation, rejected=dof), likelihood)
        return Outcome(after, innovation, True, likelihood)

    @staticmethod
    def _refused(belief: Belief, innovation: Innovation | None, likelihood: float) -> Outcome:
        return Outcome(belief, innovation, False, likelihood)

    def _inflation(self, residual: FloatArray, S: FloatArray) -> float:
        """Factor on the noise of readings that agree less than chance allows (Chang 2014, J. Geodesy 88,
        391); infinite if they do not agree at all."""
        nis, dof = _nis(residual, S), len(residual)
        if nis <= float(chi2.isf(self._options.gate_probability, dof)):
            return 1.0
        factor = nis / dof
        return factor if factor <= _LARGEST_INFLATION else np.inf

    def _linear(
        self, belief: Belief, reading: NoisyReading
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Residual, its derivative by all states, and the excess of noise."""
        linear = self._linearisation.reading(reading, belief.x, belief.covariance[:SIZE, :SIZE])
        residual, jacobian = linear.value, np.zeros((len(linear.value), len(belief.covariance)))
        jacobian[:, :SIZE] = linear.jacobian
        if isinstance(reading, Keypoints) and len(belief.biases.shares):
            jacobian[:, SIZE:] = reading.by_biases(belief.x, len(belief.biases.points_body_m))
            residual = residual + jacobian[:, SIZE:] @ belief.biases.shares
        return residual, jacobian, linear.excess

    def _updated(
        self, belief: Belief, reading: NoisyReading, kept: BoolArray, inflation: float
    ) -> Belief | None:
        """The belief after the numbers ``kept`` of a reading; None if the iteration leaves what the
        camera can see."""
        prior = belief.covariance
        step = np.zeros(len(prior))
        now = belief
        for _ in range(self._options.iterations):
            residual, J, excess = (part[kept] for part in self._linear(now, reading))
            if not np.isfinite(np.column_stack([residual, J, excess])).all():
                return None
            noise = inflation * reading.noise(now.x)[np.ix_(kept, kept)] + excess[:, kept]
            # About the prior's mean in place of the present one.
            J = J @ moved_tangent(step[ATTITUDE], len(prior))
            S = cho_factor(J @ prior @ J.T + noise)
            gain = cho_solve(S, J @ prior).T
            before, step = step, -gain @ (residual - J @ step)
            left = np.eye(len(prior)) - gain @ J
            covariance = left @ prior @ left.T + gain @ noise @ gain.T
            tangent = moved_tangent(step[ATTITUDE], len(prior))
            now = _shifted(belief, step, tangent @ covariance @ tangent.T)
            if np.all(np.abs(step - before) <= _STILL * np.sqrt(np.diag(covariance))):
                break
        if not self._options.adaptive:
            return now
        return replace(now, scales=self._scales(belief, now, step, reading, kept))

    def _scales(
        self, before: Belief, after: Belief, step: FloatArray, reading: NoisyReading, kept: BoolArray
    ) -> Scales:
        scales = before.scales
        frames = min(self._options.adaptive_frames, scales.frames + adaptation.FIRST_FRAMES)
        gained = before.covariance[:SIZE, :SIZE] - after.covariance[:SIZE, :SIZE]
        motion, turning = adaptation.process_scales(scales, step[:SIZE], gained, before.oriented, frames)
        scale = scales.keypoints
        if isinstance(reading, Keypoints):
            residual, J, _ = (part[kept] for part in self._linear(after, reading))
            found = residual**2 + np.sum((J @ after.covariance) * J, axis=1)
            expected = np.diag(reading.noise(after.x))[kept]
            scale = adaptation.keypoint_scale(scale, found, expected, frames)
        return Scales(scale, motion, turning, scales.frames + 1)


def _shifted(belief: Belief, step: FloatArray, covariance: FloatArray) -> Belief:
    biases = replace(belief.biases, shares=belief.biases.shares + step[SIZE:])
    symmetric = (covariance + covariance.T) / 2
    return replace(belief, x=belief.x.plus(step[:SIZE]), covariance=symmetric, biases=biases)


def _nis(residual: FloatArray, S: FloatArray) -> float:
    return float(residual @ np.linalg.solve(S, residual))


def _group_distances(residual: FloatArray, S: FloatArray, group: int) -> tuple[FloatArray, FloatArray]:
    """Squared Mahalanobis distance and log-determinant of each group of ``group`` numbers, by its own
    block of the covariance S."""
    count = len(residual) // group
    blocks = S.reshape(count, group, count, group)[np.arange(count), :, np.arange(count), :]
    parts = residual.reshape(count, group, 1)
    distances = (np.swapaxes(parts, 1, 2) @ np.linalg.solve(blocks, parts))[:, 0, 0]
    return distances, np.linalg.slogdet(blocks)[1]
