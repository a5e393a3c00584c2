"""Options of the core's refiners. This module is fast to import."""

from __future__ import annotations

from pydantic import Field

from posse_core._plugins.options import Options
from posse_core._scenario.component import ComponentChoice


class RenderCompareOptions(Options):
    """Options of the refiner ``render-compare``."""

    renderer: ComponentChoice = Field(
        ComponentChoice(name="raster", options={"shadow_map_px": 512}),
        description="renderer that draws what would be seen, with its options",
    )
    ms: float | None = Field(
        None,
        gt=0,
        description="time for an image, milliseconds, after which nothing new is begun; such a result"
        " depends on the machine. Without it the result is the same everywhere",
    )
    size_px: int = Field(
        192,
        ge=32,
        le=1024,
        description="extent of the spacecraft where poses are compared with each other, about; the pose"
        " that is found and its rivals are followed once more where it is twice as large",
    )
    least_agreement: float = Field(
        0.8, ge=0, le=1, description="a pose whose agreement with the image is lower is not accepted"
    )
