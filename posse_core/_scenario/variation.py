"""Scenario keys of random materials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from posse_core._plugins.options import Options


def _in_order(limits: tuple[float, float]) -> tuple[float, float]:
    low, high = limits
    if not 0.0 < low <= high <= 100.0:
        raise ValueError("give the least factor and then the greatest, above 0 and up to 100")
    return limits


Factors = Annotated[tuple[float, float], AfterValidator(_in_order)]
"""Least and greatest factor; its logarithm is drawn evenly."""


class MaterialVariation(Options):
    """How a material varies: limits of factors by which it is multiplied."""

    brightness: Factors = Field((1.0, 1.0), description="factor of the base colour")
    tint: Factors = Field((1.0, 1.0), description="further factor of each of red, green and blue")
    roughness: Factors = Field((1.0, 1.0), description="factor of the roughness")
    metallic: Factors = Field((1.0, 1.0), description="factor of the metallic share")
    pattern: float = Field(
        0.0,
        ge=0.0,
        le=2.0,
        description="standard deviation of the logarithm of a random pattern of patches, lines and"
        " blobs on the colour; 0 is none",
    )


class VariationConfig(Options):
    """Random materials of the target."""

    per: Literal["run", "frame"] = Field(
        "run", description="whether all frames have the same materials, or each frame its own"
    )
    seed: int | None = Field(
        None, ge=0, lt=2**63, description="seed of the variation; null is the scenario's"
    )
    materials: Mapping[str, MaterialVariation] = Field(
        description='name of a material, or a pattern such as "foil_*" for those without a key of their'
        " own → how it varies"
    )

    @model_validator(mode="after")
    def _factors_alone(self) -> VariationConfig:
        for name, ranges in self.materials.items():
            if self.per == "frame" and ranges.metallic != (1.0, 1.0):
                raise ValueError(f"materials.{name}: metallic varies per run, not per frame")
        return self
