"""Scenario keys of relative orbits by name, and of manoeuvres."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from posse_core._plugins.options import Options

Metres3 = tuple[float, float, float]


class FlyAround(Options):
    """Natural circle about the target at constant range, in an orbit of low eccentricity; its plane
    is 30° off the local horizon and it crosses neither pole of the view sphere."""

    name: Literal["fly-around"]
    range_m: float = Field(gt=0, description="distance from the target")
    phase_deg: float = Field(0.0, description="argument of latitude at which R is lowest")


class SafeEllipse(Options):
    """Passively safe natural ellipse: parallel relative eccentricity and inclination vectors, so
    that R and N never vanish together (D'Amico and Montenbruck 2006)."""

    name: Literal["safe-ellipse"]
    radial_m: float = Field(gt=0, description="amplitude along R, a·|δe|; along T it is twice this")
    normal_m: float = Field(gt=0, description="amplitude along N, a·|δi|")
    along_m: float = Field(0.0, description="mean along-track offset, a·δλ")
    phase_deg: float = Field(0.0, description="direction of both vectors")


class VBarHop(Options):
    """Natural arc from one point of V-bar to another, by one impulse along V-bar; it takes one
    orbit. Circular target: the arc is closed on Hill's equations."""

    name: Literal["v-bar-hop"]
    start_m: float = Field(description="place along V-bar at the epoch; positive is ahead")
    end_m: float = Field(description="place along V-bar after one orbit")


class VBarApproach(Options):
    """Forced straight line along V-bar at constant speed, then a hold at its end."""

    name: Literal["v-bar-approach"]
    start_m: float = Field(description="place at the epoch; positive is ahead of the target")
    end_m: float = Field(description="place at the end")
    duration_s: float = Field(gt=0, description="time from start to end")


class RBarApproach(Options):
    """Forced straight line along R-bar at constant speed, then a hold at its end."""

    name: Literal["r-bar-approach"]
    start_m: float = Field(description="place at the epoch; positive is below the target")
    end_m: float = Field(description="place at the end")
    duration_s: float = Field(gt=0, description="time from start to end")


class HoldPoint(Options):
    """Forced stay at a point of the RTN frame."""

    name: Literal["hold-point"]
    r_rtn_m: Metres3 = Field(description="radial, along-track, cross-track, m")


class Algorithm31(Options):
    """The thesis' Algorithm 3.1 with the core's dynamics: H relative orbits over all the times,
    its jumps and repetitions included."""

    name: Literal["algorithm-3-1"]
    relative_orbits: int = Field(25, ge=1, description="H")
    delta_e_m: tuple[float, float] = Field(description="a·(δex, δey)")
    delta_i_m: tuple[float, float] = Field(description="a·(δix, δiy) to start from")


class Algorithm31Repaired(Options):
    """Algorithm 3.1 mended: all H relative orbits differ, neighbours are near each other, and the
    first follows the last; both vectors turn, so cameras leave the line parallel to N."""

    name: Literal["algorithm-3-1-repaired"]
    relative_orbits: int = Field(25, ge=2, description="H")
    size_m: float = Field(gt=0, description="a·|δe|: the least distance; the largest is 4.5 times it")


class ViewSphere(Options):
    """Cameras on directions spread evenly over the sphere (Fibonacci lattice), one a frame, for
    training sets that must see every side; no dynamics tie one frame to the next."""

    name: Literal["view-sphere"]
    range_m: tuple[float, float] = Field(description="least and largest distance")
    range_law: Literal["uniform", "logarithmic"] = Field(
        "uniform", description="spread of the distances; logarithmic has as many near as far"
    )

    @model_validator(mode="after")
    def _ordered(self) -> ViewSphere:
        if not 0 < self.range_m[0] <= self.range_m[1]:
            raise ValueError("range_m is least and largest distance, both above 0")
        return self


DesignConfig = Annotated[
    FlyAround
    | SafeEllipse
    | VBarHop
    | VBarApproach
    | RBarApproach
    | HoldPoint
    | Algorithm31
    | Algorithm31Repaired
    | ViewSphere,
    Field(discriminator="name"),
]


class BurnConfig(Options):
    """One impulse."""

    t_s: float = Field(ge=0, description="seconds after the epoch")
    dv_rtn_m_s: Metres3 = Field(description="change of velocity, target's RTN axes, m/s")


class TransferConfig(Options):
    """A reconfiguration whose impulses are computed."""

    to_roe_m: tuple[float, float, float, float, float, float] = Field(
        description="a·(δa, δλ, δex, δey, δix, δiy) wanted at end_s"
    )
    start_s: float = Field(0.0, ge=0, description="not before this")
    end_s: float = Field(gt=0, description="reached at this time")


class PlanConfig(Options):
    """Manoeuvres of the chaser; exactly one key."""

    burns: tuple[BurnConfig, ...] | None = Field(None, min_length=1, description="given impulses")
    transfer: TransferConfig | None = Field(None, description="a transfer to other ROE")

    @model_validator(mode="after")
    def _exactly_one(self) -> PlanConfig:
        if (self.burns is None) == (self.transfer is None):
            raise ValueError("give exactly one of burns, transfer")
        return self
