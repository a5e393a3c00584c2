"""Scenario keys of the sky: what is behind and around the spacecraft."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core._plugins.options import Options


class StarsConfig(Options):
    """Stars as points of light."""

    catalogue: Literal["hipparcos", "thesis"] = Field(
        "hipparcos",
        description="hipparcos: the real sky; thesis: a field drawn at random from the seed, with stars"
        " of three sizes and three colours",
    )
    max_magnitude: float = Field(
        6.5, ge=-2, le=13, description="magnitude of the faintest star, Johnson V"
    )
    gain: float = Field(
        1.0,
        gt=0,
        description="factor on the light of stars; 1 is physical. As in real photographs, an exposure"
        " for a sunlit spacecraft shows no stars; the built-in scenarios raise the gain to make them"
        " visible",
    )


class SkyConfig(Options):
    """What is behind and around the spacecraft."""

    earth: bool = Field(True, description="show the Earth, and let it illuminate the spacecraft")
    stars: StarsConfig | None = Field(
        StarsConfig(), description="the stars; null for a sky without them"
    )
    sun_disc: bool = Field(True, description="show the Sun's disc where it is in the field of view")
