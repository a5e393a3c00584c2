"""Options of the renderer ``raster``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core import Options


class RasterOptions(Options):
    """How finely it samples."""

    samples_per_axis: Literal[1, 3, 5, 7] = Field(
        3, description="samples across a pixel and down it; odd, so that one lies in its middle"
    )
    shadow_map_px: int = Field(2048, ge=64, le=8192, description="width and height of the shadow map")
