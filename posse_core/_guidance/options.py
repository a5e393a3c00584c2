"""Options of the built-in controllers, separate from their code so that importing them is quick."""

from __future__ import annotations

from pydantic import Field

from posse_core._plugins.options import Options


class HoldOptions(Options):
    """Options of the controller ``hold``."""

    deadband_m: float = Field(
        0.05,
        gt=0,
        description="deviation in any axis that is not corrected, m; above it, there is an impulse",
    )
    return_s: float = Field(60.0, gt=0, description="time in which an impulse brings the chaser back, s")


class LqrOptions(Options):
    """Options of the controller ``lqr``; each weight is one over the square of a size."""

    position_m: float = Field(
        0.05, gt=0, description="deviation from a waypoint in any axis that counts as one, m"
    )
    velocity_m_s: float = Field(
        0.002, gt=0, description="deviation of the velocity in any axis that counts as one, m/s"
    )
    impulse_m_s: float = Field(0.01, gt=0, description="impulse in any axis that counts as one, m/s")


class MpcOptions(Options):
    """Options of the controller ``impulsive-mpc``."""

    tolerance_m: float = Field(0.05, gt=0, description="distance from a waypoint that is accepted, m")
    tolerance_m_s: float = Field(
        0.001, gt=0, description="difference from a waypoint's velocity that is accepted, m/s"
    )
    significance: float = Field(
        1.5,
        ge=0,
        description="predicted deviations of fewer standard deviations are not corrected",
    )
    deadband_m_s: float = Field(0.0005, ge=0, description="smaller impulses are not commanded, m/s")
    margin_sigma: float = Field(
        3.0,
        ge=0,
        description="distance from the keep-out ellipsoid and from the cone's surface, in standard"
        " deviations of the predicted position",
    )
