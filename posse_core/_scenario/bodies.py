"""Scenario keys of the bodies beside the target: other spacecraft, fragments, the chaser's own
structure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pydantic import Field, model_validator

from posse_core._plugins.options import Options
from posse_core._scenario.attitude import LawChoice
from posse_core._scenario.component import ComponentChoice, TargetChoice
from posse_core._scenario.joints import JointLawChoice
from posse_core._scenario.orbit import RelativeConfig
from posse_core._scenario.sensors import MountConfig

MOST_BODIES: Final = 200
"""The most bodies beside the target: each takes its part of every frame."""

Metres3 = tuple[float, float, float]


class BodyConfig(Options):
    """A body beside the target, or several of one kind.

    Give exactly one of ``relative`` and ``mount``.
    """

    spacecraft: TargetChoice = Field(
        description="what it looks like: {name: cubesat}, {mesh: ...} or {package: folder}, as in target"
    )
    relative: RelativeConfig | None = Field(
        None, description="its motion relative to the target, with the keys of the scenario's relative"
    )
    mount: MountConfig | None = Field(
        None, description="place and attitude on the chaser that carries it, in camera axes"
    )
    propagator: ComponentChoice | None = Field(
        None,
        description="model of its relative motion; null is the scenario's. A recorded motion's chaser"
        " is the body",
    )
    attitude: LawChoice = Field(
        LawChoice(law="nadir"), description="its attitude law, as attitude.target; not with mount"
    )
    joints: Mapping[str, JointLawChoice] = Field({}, description="laws of its joints, as joints")
    count: int = Field(
        1,
        ge=1,
        le=MOST_BODIES,
        description="number of such bodies; several are named NAME-1, NAME-2, …, are turned by"
        " random rotations, and have consecutive values of the spacecraft's option seed, if that is"
        " given",
    )
    spread_m: Metres3 = Field(
        (0.0, 0.0, 0.0),
        description="standard deviation of their positions at the epoch, along R, T and N",
    )
    spread_m_s: Metres3 = Field(
        (0.0, 0.0, 0.0), description="standard deviation of their velocities at the epoch, likewise"
    )

    @model_validator(mode="after")
    def _consistent(self) -> BodyConfig:
        if (self.relative is None) == (self.mount is None):
            raise ValueError("give exactly one of relative, mount")
        if self.mount is not None:
            alone = {"propagator", "attitude", "count", "spread_m", "spread_m_s"}
            given = sorted(
                key for key in alone if getattr(self, key) != type(self).model_fields[key].default
            )
            if given:
                raise ValueError(f"{', '.join(given)}: not with mount, which fixes the body's place")
        if min(*self.spread_m, *self.spread_m_s) < 0:
            raise ValueError("spread_m and spread_m_s are standard deviations, 0 or more")
        return self

    def members(self, name: str) -> list[tuple[str, TargetChoice]]:
        """Name and spacecraft of each of the bodies."""
        if self.count == 1:
            return [(name, self.spacecraft)]
        seed = self.spacecraft.options.get("seed")
        members = []
        for k in range(self.count):
            options = dict(self.spacecraft.options)
            if isinstance(seed, int):
                options["seed"] = seed + k
            choice = self.spacecraft.model_copy(update={"options": options})
            members.append((f"{name}-{k + 1}", choice))
        return members
