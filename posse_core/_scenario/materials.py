"""Keys that replace what a spacecraft's materials are."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from posse_core._plugins.options import Options

_Share = Annotated[float, Field(ge=0.0, le=1.0)]


class MaterialKeys(Options):
    """What replaces a material's own values; a texture of what is given no longer counts."""

    base_color: tuple[_Share, _Share, _Share] | None = Field(
        None, description="linear reflectance in red, green and blue; null keeps the material's"
    )
    metallic: _Share | None = Field(None, description="metallic share; null keeps the material's")
    roughness: _Share | None = Field(None, description="perceptual roughness; null keeps the material's")
    specular: _Share | None = Field(
        None,
        description="strength of a non-metal's reflection at the surface, 0 for a Lambertian one; null"
        " keeps the material's",
    )
