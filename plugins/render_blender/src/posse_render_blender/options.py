"""Options of the renderer ``blender``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from posse_core import Options


class BlenderOptions(Options):
    """How Cycles renders, and under which interpreter it runs."""

    python: str | None = Field(
        None, description="a Python that has bpy; else $POSSE_BLENDER_PYTHON, then $POSSE_BLENDER"
    )
    executable: str | None = Field(None, description="a blender executable, in place of python")
    spp: int = Field(256, ge=1, le=2**24, description="samples a pixel, at most")
    max_bounces: int = Field(
        2, ge=0, le=1024, description="bounces from surface to surface; 0 is direct light alone"
    )
    threads: int = Field(
        0,
        ge=0,
        le=1024,
        description="of the CPU; 0 takes $POSSE_THREADS, the worker's share, else every core",
    )
    device: Literal["cpu", "cuda", "optix", "hip", "oneapi", "metal"] = Field(
        "cpu", description="what computes; a GPU that is asked for and absent is an error"
    )
    denoiser: Literal["none", "openimagedenoise"] = Field(
        "none", description="smooths noise, and with it what is fine in the image"
    )
    adaptive_threshold: float = Field(
        0.01, ge=0, le=1, description="stop sampling a pixel at this noise; 0 samples all alike"
    )

    @model_validator(mode="after")
    def _one_interpreter(self) -> BlenderOptions:
        if self.python is not None and self.executable is not None:
            raise ValueError("give python or executable, not both")
        return self
