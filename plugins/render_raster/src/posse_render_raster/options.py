"""Options of the renderer ``raster``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core import Options


class RasterOptions(Options):
    """Resolution of the pixel samples and of the shadow map."""

    samples_per_axis: Literal[1, 3, 5, 7] = Field(
        3, description="samples per pixel in each direction; odd, so that one is at the centre"
    )
    shadow_map_px: int = Field(
        2048, ge=64, le=8192, description="largest width and height of a body's shadow map, px"
    )
