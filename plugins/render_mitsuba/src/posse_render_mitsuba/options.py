"""Options of the renderer ``mitsuba``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core import Options


class MitsubaOptions(Options):
    """``-o renderer.spp=64`` and its like."""

    spp: int = Field(
        64,
        ge=1,
        le=65536,
        description="samples a pixel; llvm and cuda spend those above 32 by the noise",
    )
    max_depth: int = Field(
        4, ge=2, le=64, description="longest light path in segments: 2 is direct light alone"
    )
    variant: Literal["auto", "llvm", "scalar", "cuda"] = Field(
        "auto", description="what computes: auto takes llvm where it works, else scalar"
    )
    sampler: Literal["multijitter", "stratified", "independent"] = Field(
        "multijitter", description="how samples are spread; multijitter has the least noise"
    )
    threads: int = Field(
        0,
        ge=0,
        description="threads of one worker; 0 takes $POSSE_THREADS, the worker's share, else every core",
    )
