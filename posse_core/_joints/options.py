"""Options of the built-in joint laws, separate from their code so that importing them is quick."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from posse_core._plugins.options import Options

Range = tuple[float, float]


class FixedOptions(Options):
    """Options of the law ``fixed``."""

    value_deg: float | None = Field(None, description="angle of a joint that turns; null is 0")
    value_m: float | None = Field(None, description="displacement of a joint that slides; null is 0")


class RateOptions(Options):
    """Options of the law ``rate``. Give exactly one of the rates."""

    rate_deg_s: float | None = Field(None, description="of a joint that turns, degrees per second")
    rate_m_s: float | None = Field(None, description="of a joint that slides, metres per second")
    start_deg: float | None = Field(
        None, description="angle of a joint that turns at the epoch; null is 0"
    )
    start_m: float | None = Field(
        None, description="displacement of a joint that slides at the epoch; null is 0"
    )

    @model_validator(mode="after")
    def _one_rate(self) -> RateOptions:
        if (self.rate_deg_s is None) == (self.rate_m_s is None):
            raise ValueError("give exactly one of rate_deg_s, rate_m_s")
        return self


class BendingOptions(Options):
    """Options of the law ``bending``."""

    amplitude_m: float = Field(description="deflection of the wing's tip, m")
    frequency_hz: float = Field(gt=0, description="natural frequency of the mode")
    damping_ratio: float = Field(0.0, ge=0, lt=1, description="share of critical damping")
    phase_deg: float = Field(0.0, description="phase at the epoch; at 0 the deflection is greatest")


class TableOptions(Options):
    """Options of the law ``table``."""

    path: Path = Field(
        description="a .csv or .npz with t_s, seconds after the epoch or after its own epoch_utc, and"
        " value_deg (a joint that turns) or value_m (one that slides)"
    )
    interpolation: Literal["cubic", "linear"] = Field(
        "cubic",
        description="between the rows; cubic: with steady rates, and no value beyond those of the rows",
    )


class AnimationOptions(Options):
    """Options of the law ``animation``."""

    animation: str | None = Field(
        None, description="name of an animation in the spacecraft's file; null: the joint's first"
    )
    start_s: float = Field(0.0, description="when it starts, seconds after the epoch")
    repeat: bool = Field(
        False, description="play it again and again, before its start too; else the joint rests there"
    )


class RandomOptions(Options):
    """Options of the law ``random``."""

    range_deg: Range | None = Field(
        None,
        description="least and greatest angle of a joint that turns; null: its limits, or a whole turn",
    )
    range_m: Range | None = Field(
        None, description="least and greatest displacement of a joint that slides; null: its limits"
    )
    every: Literal["frame", "run"] = Field(
        "frame", description="whether each frame has a value of its own, or all frames have the same"
    )

    @model_validator(mode="after")
    def _in_order(self) -> RandomOptions:
        for name in ("range_deg", "range_m"):
            given = getattr(self, name)
            if given is not None and given[0] > given[1]:
                raise ValueError(f"{name}: the first number is above the second")
        return self
