"""Scenario keys of the sky: what is behind and around the spacecraft."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core._plugins.options import Options


class StarsConfig(Options):
    """Stars as points of light."""

    catalogue: Literal["hipparcos", "thesis"] = Field(
        "hipparcos",
        description="hipparcos is the sky as it is; thesis is a field drawn at random from the seed, in"
        " three sizes and three colours",
    )
    max_magnitude: float = Field(6.5, ge=-2, le=13, description="faintest star, Johnson V")
    gain: float = Field(
        1.0,
        gt=0,
        description="multiplies the light of stars; 1 is physical. An exposure for a sunlit spacecraft"
        " shows no stars, as in real photographs; the built-in scenarios raise the gain so that it does",
    )


class SkyConfig(Options):
    """What is behind and around the spacecraft."""

    earth: bool = Field(True, description="show the Earth and let it light the spacecraft")
    stars: StarsConfig | None = Field(StarsConfig(), description="null for a sky without stars")
    sun_disc: bool = Field(True, description="show the Sun where it is in the field of view")
