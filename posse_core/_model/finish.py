"""What varies of a material from frame to frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

from posse_core._model.spacecraft import Material


@dataclass(frozen=True)
class Finish:
    """Factors of a material in one frame, and its pattern. With them no reflectance or roughness is
    above 1.

    Attributes:
        base_color: (3,) of the base colour in red, green, blue.
        roughness: of the roughness.
        pattern: index of the one of the material's patterns that takes the place of the texture of its
            base colour; None if the texture stays.
    """

    base_color: tuple[float, float, float]
    roughness: float
    pattern: int | None = None

    def on(self, material: Material) -> Material:
        """The material with its own factors multiplied, and with the pattern as its texture. Factors of
        the base colour may be above 1 where its texture is dark."""
        red, green, blue = (a * b for a, b in zip(self.base_color, material.base_color, strict=True))
        texture = material.base_color_texture
        return replace(
            material,
            base_color=(red, green, blue),
            roughness=self.roughness * material.roughness,
            base_color_texture=texture if self.pattern is None else material.patterns[self.pattern],
        )
