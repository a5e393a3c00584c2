"""Scenario keys of the motion: the target's orbit and the chaser's motion relative to it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from posse_core._plugins.options import Options
from posse_core._scenario.design import DesignConfig, PlanConfig

Vector3 = Annotated[tuple[float, float, float], Field(description="three numbers")]


class ElementsConfig(Options):
    """Osculating Keplerian elements in GCRF axes."""

    epoch_utc: str = Field(description="UTC, ISO 8601, as in 2022-01-31T02:02:27.58")
    a_m: float = Field(gt=0, description="semi-major axis, m")
    e: float = Field(ge=0, lt=1, description="eccentricity")
    i_deg: float = Field(ge=0, le=180, description="inclination, degrees")
    raan_deg: float = Field(description="right ascension of the ascending node, degrees")
    argp_deg: float = Field(description="argument of perigee, degrees")
    mean_anomaly_deg: float = Field(description="mean anomaly at the epoch, degrees")


class StateEciConfig(Options):
    """Position and velocity in GCRF axes at an epoch."""

    epoch_utc: str = Field(description="UTC, ISO 8601")
    r_m: Vector3 = Field(description="geocentric position, m")
    v_m_s: Vector3 = Field(description="velocity, m/s")


class OrbitConfig(Options):
    """The target's orbit. Give exactly one key."""

    tle: tuple[str, str] | None = Field(None, description="the two lines of a two-line element set")
    elements: ElementsConfig | None = Field(None, description="osculating Keplerian elements")
    state_eci: StateEciConfig | None = Field(None, description="position and velocity")

    @model_validator(mode="after")
    def _exactly_one(self) -> OrbitConfig:
        given = [key for key in type(self).model_fields if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError(
                "give exactly one of tle, elements, state_eci"
                + (f", not {' and '.join(given)}" if given else "")
            )
        return self


class StateRtnConfig(Options):
    """Relative position and velocity in the target's RTN axes."""

    r_m: Vector3 = Field(description="radial, along-track, cross-track position, m")
    v_m_s: Vector3 = Field(description="velocity in the rotating axes, m/s")


class RelativeStateEciConfig(Options):
    """The chaser's state in GCRF axes, at the orbit's epoch."""

    r_m: Vector3 = Field(description="geocentric position, m")
    v_m_s: Vector3 = Field(description="velocity, m/s")


class RelativeConfig(Options):
    """The chaser's motion relative to the target. Give exactly one key, and optionally a plan."""

    roe_m: tuple[float, float, float, float, float, float] | None = Field(
        None,
        description="quasi-nonsingular relative orbital elements times the target's semi-major axis,"
        " a·(δa, δλ, δex, δey, δix, δiy), m",
    )
    roe_equinoctial_m: tuple[float, float, float, float, float, float] | None = Field(
        None,
        description="equinoctial relative orbital elements times the target's semi-major axis,"
        " a·(δa, δl, δex, δey, δp, δq), m; for inclinations near 0° and 180°",
    )
    state_rtn: StateRtnConfig | None = Field(None, description="relative state in the target's RTN axes")
    state_eci: RelativeStateEciConfig | None = Field(
        None, description="the chaser's own state in GCRF axes"
    )
    design: DesignConfig | None = Field(None, description="a named relative orbit")
    plan: PlanConfig | None = Field(None, description="manoeuvres of the chaser")

    @model_validator(mode="after")
    def _exactly_one(self) -> RelativeConfig:
        ways = [key for key in type(self).model_fields if key != "plan"]
        given = [key for key in ways if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give exactly one of {', '.join(ways)}"
                + (f", not {' and '.join(given)}" if given else "")
            )
        return self
