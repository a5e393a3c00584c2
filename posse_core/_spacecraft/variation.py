"""Random materials of a finished spacecraft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._model.finish import Finish
from posse_core._model.spacecraft import Material, Spacecraft
from posse_core._model.srgb import linear_from_srgb, srgb_from_linear
from posse_core._randomness import random_generator
from posse_core._scenario.variation import Factors, MaterialVariation, VariationConfig
from posse_core._spacecraft.materials import chosen_materials
from posse_core._spacecraft.patterns import MOST, log_pattern
from posse_core._spacecraft.unwrapping import is_unwrapped, unwrapped

LEAST_ROUGHNESS = 0.02
_PATTERN_PX = 256
"""Side of the texture that a material without one gets."""
_PATTERNS = (2, 24)
"""Least and largest number of patterns of a material, of which each frame has one."""
_MOST_TEXELS = 1 << 25
"""All patterns of a material have no more, unless two have."""


def varied_materials(spacecraft: Spacecraft, variation: VariationConfig, seed: int) -> Spacecraft:
    """A spacecraft with random materials; each draws from the seed and its own name.

    Args:
        spacecraft: with its own materials.
        variation: how they vary.
        seed: of the run, for a variation without its own.

    Raises:
        InputError: the spacecraft has no such material.
    """
    seed = seed if variation.seed is None else variation.seed
    chosen = _chosen(spacecraft, variation)
    # Materials that vary per frame are the target's own even beside bodies of the same spacecraft.
    vary = _with_patterns if variation.per == "frame" else _varied
    made = {
        name: vary(spacecraft.materials[name], ranges, _generator(seed, -1, name))
        for name, ranges in chosen.items()
    }
    patterned = {name for name, ranges in chosen.items() if ranges.pattern}
    parts = tuple(
        part
        if part.material not in patterned or is_unwrapped(part)
        else unwrapped(part, 2 * spacecraft.radius_m, _generator(seed, -1, f"sides of {part.name}"))
        for part in spacecraft.parts
    )
    return replace(spacecraft, parts=parts, materials={**spacecraft.materials, **made})


class RandomFinishes:
    """Factors and patterns of a spacecraft's materials that are drawn for each frame."""

    def __init__(self, spacecraft: Spacecraft, variation: VariationConfig, seed: int) -> None:
        """The spacecraft is that of :func:`varied_materials`, the other arguments are the same."""
        self._materials = spacecraft.materials
        self._seed = seed if variation.seed is None else variation.seed
        self._ranges = _chosen(spacecraft, variation)
        self._most = {name: _most(spacecraft.materials[name]) for name in self._ranges}

    def of_frame(self, index: int) -> dict[str, Finish]:
        """The factors of a frame by material, cut where a reflectance or a roughness would exceed 1."""
        return {name: self._drawn(index, name) for name in self._ranges}

    def _drawn(self, index: int, name: str) -> Finish:
        ranges, rng = self._ranges[name], _generator(self._seed, index, name)
        brightness, roughness = (float(_factor(x, rng)) for x in (ranges.brightness, ranges.roughness))
        most_color, most_roughness = self._most[name]
        color = np.minimum(brightness * _factor(ranges.tint, rng, 3), most_color)
        patterns = len(self._materials[name].patterns)
        return Finish(
            _rgb(color),
            min(roughness, most_roughness),
            int(rng.integers(patterns)) if patterns else None,
        )


def _chosen(spacecraft: Spacecraft, variation: VariationConfig) -> dict[str, MaterialVariation]:
    choices, where = variation.materials, "variation.materials"
    return chosen_materials(spacecraft.materials, choices, spacecraft.name, where)


def _generator(seed: int, index: int, name: str) -> np.random.Generator:
    return random_generator(seed, index, f"variation {name}")


def _most(material: Material) -> tuple[FloatArray, float]:
    """The greatest factors (3,) of the base colour and of the roughness with which neither exceeds 1."""
    brightest, roughest = np.array(material.base_color), material.roughness
    textures = material.patterns or (material.base_color_texture,)
    codes = [texture.max(axis=(0, 1)) for texture in textures if texture is not None]
    if codes:
        brightest = brightest * linear_from_srgb(np.max(codes, axis=0) / 255.0)
    if material.metallic_roughness_texture is not None:
        roughest *= float(material.metallic_roughness_texture[..., 1].max()) / 255.0
    return 1.0 / np.maximum(brightest, 1e-6), 1.0 / max(roughest, 1e-6)


def _varied(material: Material, ranges: MaterialVariation, rng: np.random.Generator) -> Material:
    """The material with random factors. No reflectance is above 1: what is brighter becomes white."""
    brightness, roughness, metallic = (
        float(_factor(limits, rng)) for limits in (ranges.brightness, ranges.roughness, ranges.metallic)
    )
    color = np.array(material.base_color) * brightness * _factor(ranges.tint, rng, 3)
    return replace(
        _coloured(material, color, ranges.pattern, rng),
        roughness=float(np.clip(material.roughness * roughness, LEAST_ROUGHNESS, 1.0)),
        metallic=float(np.clip(material.metallic * metallic, 0.0, 1.0)),
    )


def _with_patterns(material: Material, ranges: MaterialVariation, rng: np.random.Generator) -> Material:
    """The material with patterns for its frames, if they have any; its texture is the first."""
    if not ranges.pattern:
        return replace(material)
    color, own = np.array(material.base_color), material.base_color_texture
    texels = _PATTERN_PX**2 if own is None else own.shape[0] * own.shape[1]
    count = int(np.clip(_MOST_TEXELS // texels, *_PATTERNS))
    brightest = color * np.exp(ranges.pattern * MOST - 0.5 * ranges.pattern**2)
    peak = np.clip(brightest, 1e-6, 1.0)
    made = (_reflectance(material, color, ranges.pattern, rng) for _ in range(count))
    coded = tuple(_coded(reflectance, peak) for reflectance in made)
    return replace(material, base_color=_rgb(peak), base_color_texture=coded[0], patterns=coded)


def _factor(limits: Factors, rng: np.random.Generator, count: int = 1) -> FloatArray:
    """Random factors, whose logarithm is even between the limits."""
    drawn = np.exp(rng.uniform(np.log(limits[0]), np.log(limits[1]), count))
    return np.asarray(drawn if count > 1 else drawn[0])


def _coloured(
    material: Material, color: FloatArray, pattern: float, rng: np.random.Generator
) -> Material:
    """The material with a base colour (3,), which may be above 1 where its texture is dark, and a
    pattern."""
    if not pattern and np.all(color <= 1.0):
        return replace(material, base_color=_rgb(color))
    reflectance = _reflectance(material, color, pattern, rng)
    peak = _peak(reflectance)
    return replace(material, base_color=_rgb(peak), base_color_texture=_coded(reflectance, peak))


def _reflectance(
    material: Material, color: FloatArray, pattern: float, rng: np.random.Generator
) -> FloatArray:
    """Linear reflectance (H, W, 3) of the material's texture with a base colour (3,) and a random
    pattern. What would be above 1 is 1."""
    texture = material.base_color_texture
    if texture is None:
        side = _PATTERN_PX if pattern else 1
        linear = np.ones((side, side, 3))
    else:
        linear = linear_from_srgb(texture / 255.0)
    if pattern:
        height, width = linear.shape[:2]
        # The mean of a log-normal distribution is exp(σ²/2): so the material stays as bright.
        linear = (
            linear * np.exp(pattern * log_pattern((height, width), rng) - 0.5 * pattern**2)[..., None]
        )
    return np.asarray(np.clip(linear * color, 0.0, 1.0))


def _peak(reflectance: FloatArray) -> FloatArray:
    """(3,) the greatest of a reflectance (H, W, 3)."""
    return np.asarray(np.maximum(reflectance.max(axis=(0, 1)), 1e-6))


def _coded(reflectance: FloatArray, peak: FloatArray) -> AnyArray:
    """A reflectance (H, W, 3), as shares of its peak (3,), sRGB-coded uint8."""
    return np.asarray(np.rint(255.0 * srgb_from_linear(reflectance / peak)), dtype=np.uint8)


def _rgb(color: FloatArray) -> tuple[float, float, float]:
    red, green, blue = (float(c) for c in color)
    return red, green, blue
