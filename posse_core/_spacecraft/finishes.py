"""The surface finishes of the built-in spacecraft, by name."""

from __future__ import annotations

from collections.abc import Callable

from posse_core._model.spacecraft import Material
from posse_core._spacecraft import textures

Finish = Callable[[], Material]
"""Makes a material; it is called only for materials that the spacecraft uses."""


def common_finishes(seed: int) -> dict[str, Finish]:
    """All common finishes; the seed determines their textures."""
    return {
        "foil_gold": lambda: textures.foil("foil_gold", (0.86, 0.56, 0.20), seed),
        "foil_amber": lambda: textures.foil("foil_amber", (0.78, 0.60, 0.35), seed, 0.14, 0.42),
        "foil_silver": lambda: textures.foil("foil_silver", (0.80, 0.80, 0.80), seed, roughness=0.34),
        "foil_black": lambda: textures.foil("foil_black", (0.06, 0.06, 0.07), seed, 0.10, 0.5),
        "white_paint": lambda: textures.paint("white_paint", 0.80, seed),
        "grey_paint": lambda: textures.paint("grey_paint", 0.35, seed),
        "black_paint": lambda: textures.paint("black_paint", 0.03, seed),
        "aluminium": lambda: textures.metal("aluminium", (0.88, 0.88, 0.89), 0.35),
        "titanium": lambda: textures.metal("titanium", (0.50, 0.47, 0.43), 0.45),
        "mirror_tiles": lambda: textures.mirror_tiles("mirror_tiles", seed),
    }
