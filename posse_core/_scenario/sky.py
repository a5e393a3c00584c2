"""Scenario keys of the sky: what is behind and around the spacecraft."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

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


class LaboratoryConfig(Options):
    """A dark room with light boxes in place of space, another one in each frame.

    The Sun stands for a lamp, whose strength is ``constants.solar_constant_w_m2``.
    """

    boxes: tuple[int, int] = Field((1, 3), description="least and greatest number of lit boxes")
    box_deg: tuple[float, float] = Field(
        (20.0, 50.0), description="least and greatest side of a box, as the spacecraft sees it"
    )
    box_w_m2_sr: tuple[float, float] = Field(
        (300.0, 5000.0),
        description="least and greatest radiance of a box, W m⁻² sr⁻¹; a sunlit white plate has 170",
    )
    off_axis_deg: float = Field(
        60.0,
        ge=0,
        le=180,
        description="least angle between the camera's axis and the middle of a box, so that none shines"
        " behind the spacecraft",
    )
    wall_w_m2_sr: tuple[float, float] = Field(
        (0.0, 2.0), description="least and greatest radiance of the brightest walls, W m⁻² sr⁻¹"
    )

    @model_validator(mode="after")
    def _in_order(self) -> LaboratoryConfig:
        if not 0 <= self.boxes[0] <= self.boxes[1] <= 20:
            raise ValueError("boxes is the least and the greatest number, from 0 to 20")
        if not 0 < self.box_deg[0] <= self.box_deg[1] <= 150:
            raise ValueError("box_deg is the least and the greatest side, above 0 and up to 150")
        if not 0 < self.box_w_m2_sr[0] <= self.box_w_m2_sr[1]:
            raise ValueError("box_w_m2_sr is the least and the greatest radiance, above 0")
        if not 0 <= self.wall_w_m2_sr[0] <= self.wall_w_m2_sr[1]:
            raise ValueError("wall_w_m2_sr is the least and the greatest radiance, from 0")
        return self


class SkyConfig(Options):
    """What is behind and around the spacecraft."""

    earth: bool = Field(True, description="show the Earth, and let it illuminate the spacecraft")
    stars: StarsConfig | None = Field(
        StarsConfig(), description="the stars; null for a sky without them"
    )
    sun_disc: bool = Field(True, description="show the Sun's disc where it is in the field of view")
    laboratory: LaboratoryConfig | None = Field(
        None,
        description="a dark room with light boxes in place of space, drawn from the seed for each frame;"
        " goes with earth: false and stars: null",
    )

    @model_validator(mode="after")
    def _room_has_no_sky(self) -> SkyConfig:
        if self.laboratory is not None and (self.earth or self.stars is not None):
            raise ValueError("laboratory: a room shows no sky; give earth: false and stars: null too")
        return self
