"""How the surfaces of a spacecraft absorb sunlight, emit heat and store it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from posse_core._errors import InputError
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.spacecraft import Material, Spacecraft
from posse_core._model.srgb import linear_from_srgb
from posse_core._plugins.options import nearest
from posse_core._sensors.thermal.options import SurfaceOptions

FINISHES: Mapping[str, tuple[float, float]] = {
    "foil_gold": (0.40, 0.63),  # aluminised Kapton, Kapton outside
    "foil_amber": (0.40, 0.63),
    "foil_silver": (0.16, 0.47),  # aluminised FEP
    "foil_black": (0.95, 0.85),  # as black epoxy paint
    "white_paint": (0.26, 0.83),  # silicone
    "black_paint": (0.95, 0.90),  # polyurethane
    "aluminium": (0.24, 0.08),  # polished
    "titanium": (0.60, 0.60),  # polished
    "mirror_tiles": (0.07, 0.74),  # OSR
    "solar_panel": (0.75, 0.82),  # silicon cells
    "solar_cells": (0.75, 0.82),
}
"""Solar absorptance and emissivity of finishes by the names that the built-in spacecraft give them
(Fortescue, Swinerd & Stark, Spacecraft Systems Engineering, 4th ed. 2011, Table 11.3)."""
DIELECTRIC_EMISSIVITY, MIRROR_EMISSIVITY = 0.85, 0.05
HEAT_CAPACITY_J_M2_K = 5000.0
"""That of 2 mm of aluminium (2700 kg/m³, 900 J/kg/K)."""


@dataclass(frozen=True)
class Surface:
    """Properties of a surface.

    Attributes:
        solar_absorptance: share of sunlight that it absorbs.
        emissivity: share of a black body's heat that it emits, into all directions evenly, and share of
            infrared radiation that it absorbs.
        heat_capacity_j_m2_k: of what is behind it, per area.
        internal_power_w_m2: heat from inside.
    """

    solar_absorptance: float
    emissivity: float
    heat_capacity_j_m2_k: float = HEAT_CAPACITY_J_M2_K
    internal_power_w_m2: float = 0.0


def surface_of(material: Material) -> Surface:
    """The surface that a material stands for: a finish by its name, or else by the glTF material.

    α = 1 − ρ with the reflectance ρ in the bands, weighted by the Sun, and ε = 0.85 − 0.80 m ρ with the
    share m of metal: a dielectric of any colour emits well, a bright metal does not, and a dark metal
    counts as coated.
    """
    if material.name in FINISHES:
        return Surface(*FINISHES[material.name])
    rgb = np.array(material.base_color)
    if material.base_color_texture is not None:
        rgb = rgb * linear_from_srgb(material.base_color_texture / 255).mean(axis=(0, 1))
    metallic = material.metallic
    if material.metallic_roughness_texture is not None:
        metallic *= float(material.metallic_roughness_texture[..., 0].mean()) / 255
    reflectance = float(np.sum(rgb * SOLAR_BAND_FRACTIONS) / np.sum(SOLAR_BAND_FRACTIONS))
    drop = DIELECTRIC_EMISSIVITY - MIRROR_EMISSIVITY
    return Surface(1 - reflectance, DIELECTRIC_EMISSIVITY - drop * metallic * reflectance)


def surfaces_of(
    craft: Spacecraft,
    materials: Mapping[str, SurfaceOptions],
    parts: Mapping[str, SurfaceOptions],
) -> tuple[Surface, ...]:
    """The surface of each part; what a user gives for its material replaces the default, and what he
    gives for the part replaces both.

    Raises:
        InputError: a part or a material of that name does not exist.
    """
    _refuse_unknown("materials", materials, [part.material for part in craft.parts])
    _refuse_unknown("parts", parts, [part.name for part in craft.parts])
    derived = {name: surface_of(craft.materials[name]) for name in {p.material for p in craft.parts}}
    none = SurfaceOptions()
    made = []
    for part in craft.parts:
        surface = derived[part.material]
        for given in (materials.get(part.material, none), parts.get(part.name, none)):
            surface = replace(surface, **given.model_dump(exclude_none=True))
        made.append(surface)
    return tuple(made)


def _refuse_unknown(key: str, given: Mapping[str, SurfaceOptions], known: list[str]) -> None:
    for name in given:
        if name not in known:
            hint = nearest(name, known) or f" ({', '.join(dict.fromkeys(known))})"
            raise InputError(f"{key}: the spacecraft has none named {name!r}{hint}")
