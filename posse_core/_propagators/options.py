"""Options of the built-in propagators, separate from their code so that importing them is quick."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from posse_core._plugins.options import Options


class ThesisOptions(Options):
    """Options of the propagator ``thesis``."""

    relative_orbits: int = Field(
        25,
        ge=1,
        le=10_000,
        description="H of Algorithm 3.1: number of relative orbits, each over all times",
    )


class J2RoeOptions(Options):
    """Options of the propagator ``j2-roe``."""

    mean_elements: Literal["brouwer-lyddane", "canonical"] = Field(
        "brouwer-lyddane",
        description="theory of mean elements: the published one, or one that has no singularities and"
        " is several times more accurate",
    )


class SurfaceConfig(Options):
    """Coefficient times area divided by mass, of spherical spacecraft."""

    target_m2_kg: float = Field(ge=0, description="of the target, m²/kg")
    chaser_m2_kg: float = Field(ge=0, description="of the chaser, m²/kg")

    @property
    def pair(self) -> tuple[float, float]:
        """(target, chaser)."""
        return self.target_m2_kg, self.chaser_m2_kg


class NonlinearOptions(Options):
    """Options of the propagator ``nonlinear``."""

    gravity: Literal["two-body", "j2"] = Field("j2", description="the Earth's gravity")
    drag: SurfaceConfig | None = Field(
        None, description="air drag, C_D A/m: exponential atmosphere that rotates with the Earth"
    )
    solar_pressure: SurfaceConfig | None = Field(
        None, description="solar radiation pressure, C_R A/m, with the Earth's shadow"
    )
    third_body: bool = Field(False, description="attraction of the Sun and the Moon")


class FileOptions(Options):
    """Options of the propagator ``file``."""

    path: Path = Field(
        description="trajectory file: .npz or .csv with the names that 'posse propagate' writes, or the"
        " target's CCSDS OEM (.oem, .txt)"
    )
    chaser_path: Path | None = Field(None, description="the chaser's CCSDS OEM, if path is the target's")
