"""Options of the built-in navigators, separate from their code so that importing them is quick."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core._plugins.options import Options


class DynamicsOptions(Options):
    """What a navigator takes the motion to be."""

    dynamics: Literal["two-body", "j2"] = Field("two-body", description="the Earth's gravity")
    acceleration_m_s2_rthz: float = Field(
        1e-6,
        ge=0,
        description="relative accelerations that the dynamics leave out: root of the power spectral"
        " density of white noise, m/s²/√Hz",
    )
    tumbling_share: float = Field(
        0.03,
        ge=0,
        description="angular acceleration of a target whose inertia is not known, as a share of the"
        " square of its rate; 0 for one that spins steadily",
    )
    angular_acceleration_deg_s2_rthz: float = Field(
        5e-4,
        ge=0,
        description="the target's angular accelerations that the dynamics leave out: root of the power"
        " spectral density of white noise, °/s²/√Hz",
    )


class KalmanOptions(DynamicsOptions):
    """Options of ``ekf`` and ``ukf``."""

    rate_deg_s: float = Field(
        3.0,
        gt=0,
        description="standard deviation of each component of the target's angular rate before it was"
        " seen to turn, °/s",
    )
    bias_share: float = Field(
        0.006,
        ge=0,
        description="standard deviation of the part of a keypoint's error that changes slowly, in each"
        " coordinate, as a share of the target's diameter in the image; 0 for none",
    )
    bias_time_s: float = Field(
        3600.0, gt=0, description="time in which the slow part falls to 1/e of its correlation, s"
    )
    bias_angle_deg: float = Field(
        10.0,
        gt=0,
        description="turn of the target as the camera sees it over which the slow part falls to 1/e of"
        " its correlation, °",
    )
    bias_zoom: float = Field(
        1.3,
        gt=1,
        description="ratio of two ranges over which the slow part falls to 1/e of its correlation",
    )
    pose_inflation: float = Field(
        1.0, gt=0, description="factor on the standard deviations of poses that come without keypoints"
    )
    gate_probability: float = Field(
        1e-4, gt=0, lt=1, description="probability of refusing a right keypoint as an outlier"
    )
    iterations: int = Field(
        3, ge=1, description="number of times at most that a measurement is linearised"
    )
    adaptive: bool = Field(
        True, description="scale the keypoints' noise and the process noise by what is seen"
    )
    adaptive_frames: float = Field(
        30.0, gt=1, description="number of frames over which the scales of the noise are averaged"
    )
    hypotheses: int = Field(4, ge=1, description="number of attitudes at most that are followed at once")
    lost_frames: int = Field(
        5, ge=1, description="number of refused frames in a row after which the position is doubted"
    )
