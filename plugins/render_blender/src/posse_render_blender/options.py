"""Options of the renderer ``blender``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from posse_core import Options


class BlenderOptions(Options):
    """How Cycles renders, and under which interpreter it runs."""

    python: str | None = Field(
        None,
        description="path of a Python that has bpy; default $POSSE_BLENDER_PYTHON, then $POSSE_BLENDER",
    )
    executable: str | None = Field(None, description="path of a blender executable, instead of python")
    spp: int = Field(256, ge=1, le=2**24, description="maximum number of samples per pixel")
    max_bounces: int = Field(
        2, ge=0, le=1024, description="bounces from surface to surface; 0 gives direct light alone"
    )
    threads: int = Field(
        0,
        ge=0,
        le=1024,
        description="CPU threads; 0 uses $POSSE_THREADS, set by the executor, else all cores",
    )
    device: Literal["cpu", "cuda", "optix", "hip", "oneapi", "metal"] = Field(
        "cpu", description="device that renders; it is an error if the chosen GPU is absent"
    )
    denoiser: Literal["none", "openimagedenoise"] = Field(
        "none", description="a denoiser smooths the noise, but also fine detail of the image"
    )
    adaptive_threshold: float = Field(
        0.01,
        ge=0,
        le=1,
        description="noise at which the sampling of a pixel stops; 0 samples all pixels equally",
    )

    @model_validator(mode="after")
    def _one_interpreter(self) -> BlenderOptions:
        if self.python is not None and self.executable is not None:
            raise ValueError("give python or executable, not both")
        return self
