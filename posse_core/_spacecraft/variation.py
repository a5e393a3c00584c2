"""Random materials of a finished spacecraft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from posse_core._arrays import FloatArray
from posse_core._model.finish import Finish
from posse_core._model.spacecraft import Material, Spacecraft
from posse_core._model.srgb import linear_from_srgb, srgb_from_linear
from posse_core._randomness import random_generator
from posse_core._scenario.variation import Factors, MaterialVariation, VariationConfig
from posse_core._spacecraft.materials import chosen_materials

LEAST_ROUGHNESS = 0.02
_PATTERN_PX = 256
"""Side of the texture that a material without one gets."""
_FINEST, _COARSEST = 1.0 / 64.0, 1.0 / 8.0
"""Smallest and largest standard deviation of a pattern's blobs, as shares of the texture."""


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
    made = {
        name: replace(spacecraft.materials[name])
        if variation.per == "frame"
        else _varied(spacecraft.materials[name], ranges, _generator(seed, -1, name))
        for name, ranges in chosen.items()
    }
    return replace(spacecraft, materials={**spacecraft.materials, **made})


class RandomFinishes:
    """Factors of a spacecraft's materials that are drawn for each frame."""

    def __init__(self, spacecraft: Spacecraft, variation: VariationConfig, seed: int) -> None:
        """The arguments are those of :func:`varied_materials`."""
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
        return Finish(
            (float(color[0]), float(color[1]), float(color[2])), min(roughness, most_roughness)
        )


def _chosen(spacecraft: Spacecraft, variation: VariationConfig) -> dict[str, MaterialVariation]:
    choices, where = variation.materials, "variation.materials"
    return chosen_materials(spacecraft.materials, choices, spacecraft.name, where)


def _generator(seed: int, index: int, name: str) -> np.random.Generator:
    return random_generator(seed, index, f"variation {name}")


def _most(material: Material) -> tuple[FloatArray, float]:
    """The greatest factors (3,) of the base colour and of the roughness with which neither exceeds 1."""
    brightest, roughest = np.array(material.base_color), material.roughness
    if material.base_color_texture is not None:
        brightest = brightest * linear_from_srgb(material.base_color_texture.max(axis=(0, 1)) / 255.0)
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


def _factor(limits: Factors, rng: np.random.Generator, count: int = 1) -> FloatArray:
    """Random factors, whose logarithm is even between the limits."""
    drawn = np.exp(rng.uniform(np.log(limits[0]), np.log(limits[1]), count))
    return np.asarray(drawn if count > 1 else drawn[0])


def _coloured(
    material: Material, color: FloatArray, pattern: float, rng: np.random.Generator
) -> Material:
    """The material with a base colour (3,), which may be above 1 where its texture is dark, and a
    pattern."""
    texture = material.base_color_texture
    if not pattern and np.all(color <= 1.0):
        return replace(material, base_color=(float(color[0]), float(color[1]), float(color[2])))
    if texture is None:
        side = _PATTERN_PX if pattern else 1
        linear = np.ones((side, side, 3))
    else:
        linear = linear_from_srgb(texture / 255.0)
    if pattern:
        height, width = linear.shape[:2]
        share = float(_factor((_FINEST, _COARSEST), rng))
        noise = rng.standard_normal((height, width))
        blobs = gaussian_filter(noise, (share * height, share * width), mode="wrap")
        linear = linear * np.exp(pattern * blobs / blobs.std())[..., None]
    reflectance = np.clip(linear * color, 0.0, 1.0)
    peak = np.maximum(reflectance.max(axis=(0, 1)), 1e-6)
    coded = np.rint(255.0 * srgb_from_linear(reflectance / peak)).astype(np.uint8)
    red, green, blue = (float(c) for c in peak)
    return replace(material, base_color=(red, green, blue), base_color_texture=coded)
