"""Options of the renderer ``mitsuba``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core import Options


class MitsubaOptions(Options):
    """Options of the renderer, set by ``-o renderer.spp=64`` and the like."""

    spp: int = Field(
        64,
        ge=1,
        le=65536,
        description="samples per pixel; llvm and cuda give those above 32 to the noisiest pixels",
    )
    max_depth: int = Field(
        4, ge=2, le=64, description="longest light path in segments; 2 gives direct light alone"
    )
    variant: Literal["auto", "llvm", "scalar", "cuda"] = Field(
        "auto", description="Mitsuba variant; auto uses llvm if it works on this machine, else scalar"
    )
    threads: int = Field(
        0,
        ge=0,
        description="threads of one worker; 0 uses $POSSE_THREADS, set by the executor, else all cores",
    )
