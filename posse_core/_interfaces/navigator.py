"""Navigators: from what the chaser's sensors read to an estimate of the relative state."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Target
from posse_core._environment.time import Epoch
from posse_core._interfaces.detector import PoseEstimate
from posse_core._model.camera import Camera
from posse_core._plugins.component import Component, OptionsT


@dataclass(frozen=True)
class Estimate:
    """What the chaser knows of its motion relative to the target, and of the target's attitude.

    Attributes:
        t_s: seconds since the scenario's epoch.
        r_rtn_m, v_rtn_m_s: (3,) the chaser's position relative to the target and its derivative in the
            rotating axes, target's RTN axes.
        covariance: (12, 12) of the errors of position (m), velocity (m/s), attitude (rad) and rate
            (rad/s), in this order; (6, 6), of position and velocity alone, where no attitude is
            estimated. The error of the attitude is the small rotation θ in body axes with
            R_eci_from_body = R_estimate · exp(θ×).
        q_eci_from_body: (4,) the target's attitude, unit quaternion, scalar first; None if it is not
            estimated.
        omega_body_rad_s: (3,) its angular velocity relative to GCRF axes, body axes; None likewise.
    """

    t_s: float
    r_rtn_m: FloatArray
    v_rtn_m_s: FloatArray
    covariance: FloatArray
    q_eci_from_body: FloatArray | None = None
    omega_body_rad_s: FloatArray | None = None

    @property
    def range_m(self) -> float:
        """Distance between chaser and target."""
        return float(np.linalg.norm(self.r_rtn_m))


@dataclass(frozen=True)
class KeypointReading:
    """Keypoints of the target in an image.

    Attributes:
        points_body_m: (K, 3) the keypoints on the spacecraft, body axes.
        points_px: (K, 2) where they were found.
        sigma_px: (K,) standard deviation of each coordinate.
    """

    points_body_m: FloatArray
    points_px: FloatArray
    sigma_px: FloatArray


@dataclass(frozen=True)
class LineOfSight:
    """The direction to the target, as the middle of its box gives it.

    Attributes:
        direction_cam: (3,) unit vector, camera axes.
        sigma_rad: standard deviation across the direction, in each of two axes.
    """

    direction_cam: FloatArray
    sigma_rad: float


@dataclass(frozen=True)
class RangeReading:
    """The distance to the target's origin, and its standard deviation."""

    range_m: float
    sigma_m: float


@dataclass(frozen=True)
class Readings:
    """What the chaser read at one instant; what it did not read is None.

    Attributes:
        index: number of the frame.
        t_s: the instant, seconds since the scenario's epoch.
        arrives_s: when the readings reach the navigator, ``t_s`` or later.
        q_eci_from_camera: (4,) attitude of the camera as the chaser knows it, scalar first.
        keypoints: found in the image.
        pose: of the target in camera axes. Beside ``keypoints`` it is computed from them, so it is not a
            second measurement.
        line_of_sight: to the target.
        range: to the target.
        truth: the true state, for a navigator with the capability ``truth``; None for all others.
        pose_alone: the pose by the image alone; another than ``pose`` where the keypoints were corrected
            by what was known before. It is there to compare with, and not a measurement either.
    """

    index: int
    t_s: float
    arrives_s: float
    q_eci_from_camera: FloatArray
    keypoints: KeypointReading | None = None
    pose: PoseEstimate | None = None
    line_of_sight: LineOfSight | None = None
    range: RangeReading | None = None
    truth: Estimate | None = None
    pose_alone: PoseEstimate | None = None


@dataclass(frozen=True)
class Innovation:
    """How well the readings of one instant agree with what the navigator expected.

    Attributes:
        nis: normalised innovation squared, before anything was rejected by it; its expected value is
            ``dof``.
        dof: number of scalar measurements.
        rejected: number of scalar measurements that were rejected as outliers.
    """

    nis: float
    dof: int
    rejected: int = 0


@dataclass(frozen=True)
class ThrusterErrors:
    """Standard deviations of an impulse's errors, and the least impulse.

    Attributes:
        size: of the size, relative.
        direction_rad: of the direction, about each of two axes across it.
        least_m_s: smaller impulses are not carried out.
    """

    size: float = 0.0
    direction_rad: float = 0.0
    least_m_s: float = 0.0


_EXACT = ThrusterErrors()


@dataclass(frozen=True)
class NavigationProblem:
    """What the chaser knows before its first reading.

    Attributes:
        epoch: the instant of t_s = 0.
        target: the target's orbit at the epoch.
        start: the chaser's motion as planned, at the epoch, with the covariance of what is not known of
            it; it has no attitude.
        camera: the camera.
        radius_m: of the target about its origin.
        symmetries: (S, 3, 3) rotations that leave the target's appearance unchanged, without the
            identity; (0, 3, 3) for most spacecraft.
        inertia_kg_m2: (3, 3) of the target in body axes, known up to a factor; None if it is unknown.
        thrusters: errors of the chaser's impulses.
        camera_attitude_rad: standard deviation of the camera's known attitude, about each axis.
        period_s: time from one frame to the next.
    """

    epoch: Epoch
    target: Target
    start: Estimate
    camera: Camera
    radius_m: float
    symmetries: FloatArray = field(default_factory=lambda: np.empty((0, 3, 3)))
    inertia_kg_m2: FloatArray | None = None
    thrusters: ThrusterErrors = _EXACT
    camera_attitude_rad: float = 0.0
    period_s: float = 10.0


class Navigator(Component[OptionsT]):
    """Estimates the motion of the chaser relative to the target.

    Calls come in this order: :meth:`start` once; then :meth:`update` for the readings of each frame when
    they arrive, :meth:`burned` for each impulse when it is commanded, and :meth:`estimate` for instants
    not before those of the last reading and the last impulse. Readings may arrive after an impulse that
    is later than they are. Readings at the instant of an impulse are from before it, an estimate at that
    instant is from after it.
    """

    @abstractmethod
    def start(self, problem: NavigationProblem) -> None:
        """Begin a flight."""

    @abstractmethod
    def burned(self, burn: Burn) -> None:
        """Take note of an impulse that was commanded; how it was carried out is not known."""

    @abstractmethod
    def update(self, readings: Readings) -> Innovation | None:
        """Take the readings of one frame, in order of their instants.

        Returns:
            How they agree with what was expected; None where nothing was compared.
        """

    @abstractmethod
    def estimate(self, t_s: float) -> Estimate | None:
        """The estimate at an instant; None while there is none.

        Asking changes nothing: the same question twice has the same answer.
        """
