"""Scenario keys of damage to a spacecraft."""

from __future__ import annotations

from pydantic import Field

from posse_core._plugins.options import Options


class DamageConfig(Options):
    """Random damage, the same in all frames of a run.

    The numbers are upper limits: a spacecraft of few parts keeps its bus, and only flat parts bend.
    """

    seed: int | None = Field(
        None, ge=0, lt=2**63, description="seed of the damage; null is the scenario's"
    )
    missing_parts: int = Field(
        0, ge=0, description="number of parts that are lost, with what only they hold"
    )
    torn_parts: int = Field(0, ge=0, description="number of parts with a ragged hole")
    bent_parts: int = Field(
        0, ge=0, description="number of flat parts, such as panels, that are bent about an edge"
    )
