"""Options of the record of radiance."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core._plugins.options import Options


class RadianceOptions(Options):
    """The light of the frame's image, before lens and detector make digital numbers of it."""

    dtype: Literal["float32", "float16"] = Field(
        "float32",
        description="of the array; float16 takes half the space, has three digits, and ends at 65504"
        " W m⁻² sr⁻¹, which only the Sun's disc exceeds",
    )
    formats: tuple[Literal["exr"], ...] = Field(
        (), description="files of the same numbers, beside the array: exr or none"
    )
