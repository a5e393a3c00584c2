"""A piece of a broken spacecraft: a torn plate with what still hangs on it, every seed another one.

Body axes: the plate lies in the plane z = 0, with the origin at its middle.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from posse_core._arrays import FloatArray
from posse_core._interfaces.scene import SceneSource
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.options import Options
from posse_core._randomness import derived_seed, random_generator
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.finishes import common_finishes
from posse_core._spacecraft.shapes import Mesh, box, prism, tube

Surface = Literal["foil_gold", "foil_silver", "white_paint", "aluminium", "mirror_tiles"]
_SURFACES: tuple[Surface, ...] = ("foil_gold", "foil_silver", "white_paint", "aluminium", "mirror_tiles")


class FragmentOptions(Options):
    """Options of a fragment."""

    seed: int = Field(0, ge=0, lt=2**63, description="seed of its shape and finish")
    size_m: float = Field(0.4, gt=0.005, lt=50.0, description="largest width of the plate")
    surface: Surface | None = Field(None, description="finish of the plate; null draws one")


class Fragment(SceneSource[FragmentOptions]):
    """The scene source ``fragment``."""

    def build(self) -> Spacecraft:
        options = self.options
        rng = random_generator(options.seed, -1, "fragment")
        surface = options.surface or _SURFACES[int(rng.integers(len(_SURFACES)))]
        craft = Assembly("fragment")
        outline = _outline(rng, options.size_m)
        thick_m = options.size_m * rng.uniform(0.01, 0.04)
        craft.add("plate", surface, prism(outline, thick_m))
        for number, corner in enumerate(_extreme(outline), start=1):
            craft.mark(f"T{number}", "plate", (*corner, thick_m / 2))
        craft.add("torn", "aluminium", *_torn(rng, options.size_m, thick_m))
        finishes = common_finishes(derived_seed(options.seed, -1, "fragment's finish"))
        materials = {name: finishes[name]() for name in craft.material_names}
        return craft.finish(materials, (0.0, 0.0, 0.0), [("T1", "T2"), ("T2", "T3"), ("T3", "T4")])


def _outline(rng: np.random.Generator, size_m: float) -> FloatArray:
    """(N, 2) convex outline with the width ``size_m``, counter-clockwise, about the origin: points of an
    ellipse at random angles, so that no side is like another."""
    count = int(rng.integers(5, 9))
    angle = np.sort((np.arange(count) + rng.uniform(0.1, 0.9, count)) * 2 * np.pi / count)
    outline = np.stack([np.cos(angle), rng.uniform(0.45, 0.95) * np.sin(angle)], axis=-1)
    apart = np.linalg.norm(outline[:, None] - outline, axis=-1).max()
    return np.asarray(outline * (size_m / apart))


def _extreme(outline: FloatArray) -> FloatArray:
    """(4, 2) corners that are farthest along +x, +y, −x and −y, each another one."""
    chosen: list[int] = []
    for direction in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)):
        order = np.argsort(-(outline @ direction), kind="stable")
        chosen.append(next(int(k) for k in order if int(k) not in chosen))
    return outline[chosen]


def _torn(rng: np.random.Generator, size_m: float, thick_m: float) -> list[Mesh]:
    """A stump of a bracket, and bent wires of a harness."""
    base = (*rng.uniform(-0.12, 0.12, 2) * size_m, thick_m / 2)
    stump = box((0.12 * size_m, 0.08 * size_m, 0.3 * size_m * rng.uniform(0.4, 1.0)))
    height_m = float(np.ptp(stump.vertices_m[:, 2]))
    meshes = [stump.at((base[0], base[1], thick_m / 2 + 0.48 * height_m))]
    for _ in range(int(rng.integers(1, 4))):
        start = np.array([*rng.uniform(-0.15, 0.15, 2) * size_m, -thick_m / 4])
        steps = rng.normal(size=(3, 3)) * (0.06, 0.06, 0.02) + (0.0, 0.0, -0.12)
        path = start + np.concatenate([[(0.0, 0.0, 0.0)], np.cumsum(steps * size_m, axis=0)])
        meshes.append(tube(path, 0.008 * size_m, 8))
    return meshes
