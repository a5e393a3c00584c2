"""Scenario keys of named relative orbits and of manoeuvres."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from posse_core._plugins.options import Options

Metres3 = tuple[float, float, float]


class FlyAround(Options):
    """Natural motion on a circle about a target in a nearly circular orbit, at constant range.

    The circle's plane is inclined by 30° to the local horizon; it crosses neither pole of the view
    sphere.
    """

    name: Literal["fly-around"]
    range_m: float = Field(gt=0, description="distance from the target")
    phase_deg: float = Field(0.0, description="argument of latitude at which R is lowest")


class SafeEllipse(Options):
    """Passively safe natural ellipse.

    The relative eccentricity and inclination vectors are parallel, so that R and N are never zero
    together (D'Amico and Montenbruck 2006).
    """

    name: Literal["safe-ellipse"]
    radial_m: float = Field(gt=0, description="amplitude along R, a·|δe|; along T it is twice this")
    normal_m: float = Field(gt=0, description="amplitude along N, a·|δi|")
    along_m: float = Field(0.0, description="mean along-track offset, a·δλ")
    phase_deg: float = Field(0.0, description="direction of both vectors: an argument of latitude")


class VBarHop(Options):
    """Natural arc from one point of V-bar to another in one orbit, after one impulse along V-bar.

    It assumes a circular target orbit: the arc is a closed form of Hill's equations.
    """

    name: Literal["v-bar-hop"]
    start_m: float = Field(description="position along V-bar at the epoch; positive is ahead")
    end_m: float = Field(description="position along V-bar after one orbit")


class VBarApproach(Options):
    """Forced motion along V-bar at constant speed, then a hold at its end."""

    name: Literal["v-bar-approach"]
    start_m: float = Field(description="position at the epoch; positive is ahead of the target")
    end_m: float = Field(description="position at the end")
    duration_s: float = Field(gt=0, description="time from start to end")


class RBarApproach(Options):
    """Forced motion along R-bar at constant speed, then a hold at its end."""

    name: Literal["r-bar-approach"]
    start_m: float = Field(description="position at the epoch; positive is below the target")
    end_m: float = Field(description="position at the end")
    duration_s: float = Field(gt=0, description="time from start to end")


class HoldPoint(Options):
    """Forced hold at a fixed position in RTN axes."""

    name: Literal["hold-point"]
    r_rtn_m: Metres3 = Field(description="radial, along-track, cross-track position, m")


class Algorithm31(Options):
    """The thesis' Algorithm 3.1 with the core's dynamics: H relative orbits over all the times.

    It includes the jumps and repetitions of the original.
    """

    name: Literal["algorithm-3-1"]
    relative_orbits: int = Field(25, ge=1, le=10_000, description="H, the number of relative orbits")
    delta_e_m: tuple[float, float] = Field(description="a·(δex, δey)")
    delta_i_m: tuple[float, float] = Field(description="a·(δix, δiy) of the first relative orbit")


class Algorithm31Repaired(Options):
    """Algorithm 3.1 repaired: all H relative orbits differ.

    Successive orbits are close to each other, and the first is close to the last. Both vectors rotate,
    so that the cameras do not stay on a line parallel to N.
    """

    name: Literal["algorithm-3-1-repaired"]
    relative_orbits: int = Field(25, ge=2, le=10_000, description="H, the number of relative orbits")
    size_m: float = Field(
        gt=0, description="a·|δe|, which is the least distance; the largest is 4.5 times as much"
    )


class ViewSphere(Options):
    """Viewing directions spread evenly over the sphere (Fibonacci lattice), one for each frame.

    This is for training sets that must show every side; no dynamics connect one frame with the next.
    """

    name: Literal["view-sphere"]
    range_m: tuple[float, float] = Field(description="least and largest distance")
    range_law: Literal["uniform", "logarithmic"] = Field(
        "uniform",
        description="distribution of the distances; logarithmic gives each octave equally many",
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
    dv_rtn_m_s: Metres3 = Field(description="change of velocity in the target's RTN axes, m/s")


class TransferConfig(Options):
    """A reconfiguration whose impulses are computed."""

    to_roe_m: tuple[float, float, float, float, float, float] = Field(
        description="wanted a·(δa, δλ, δex, δey, δix, δiy) at end_s"
    )
    start_s: float = Field(0.0, ge=0, description="earliest time of an impulse, seconds after the epoch")
    end_s: float = Field(
        gt=0, description="time at which the elements are reached, seconds after the epoch"
    )


class PlanConfig(Options):
    """Manoeuvres of the chaser. Give exactly one key."""

    burns: tuple[BurnConfig, ...] | None = Field(None, min_length=1, description="given impulses")
    transfer: TransferConfig | None = Field(
        None, description="a transfer to other relative orbital elements"
    )

    @model_validator(mode="after")
    def _exactly_one(self) -> PlanConfig:
        if (self.burns is None) == (self.transfer is None):
            raise ValueError("give exactly one of burns, transfer")
        return self
