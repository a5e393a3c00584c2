"""The finishes that the built-in spacecraft are made of, by name."""

from __future__ import annotations

from posse_core.model.spacecraft import Material
from posse_core.spacecraft import textures


def finishes(seed: int) -> dict[str, Material]:
    """All common finishes, drawn from a seed."""
    made = [
        textures.foil("foil_gold", (0.86, 0.56, 0.20), seed),
        textures.foil("foil_silver", (0.80, 0.80, 0.80), seed, roughness=0.34),
        textures.foil("foil_black", (0.06, 0.06, 0.07), seed, wrinkle=0.10, roughness=0.5),
        textures.paint("white_paint", 0.80, seed),
        textures.paint("grey_paint", 0.35, seed),
        textures.paint("black_paint", 0.03, seed),
        textures.metal("aluminium", (0.88, 0.88, 0.89), 0.35),
        textures.metal("titanium", (0.50, 0.47, 0.43), 0.45),
        textures.mirror_tiles("mirror_tiles", seed),
    ]
    return {material.name: material for material in made}
