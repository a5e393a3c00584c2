"""The base of spacecraft that are made by code: finishes, missing parts, random variants."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, TypeVar

import numpy as np

from posse_core._errors import InputError
from posse_core._interfaces.scene import SceneSource
from posse_core._model.spacecraft import Material, Spacecraft
from posse_core._plugins.options import nearest
from posse_core._randomness import derived_seed, random_generator
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.finishes import Finish
from posse_core._spacecraft.options import VariantOptions
from posse_core._threads import in_threads

VariantOptionsT = TypeVar("VariantOptionsT", bound=VariantOptions)


class Parametric(SceneSource[VariantOptionsT]):
    """A spacecraft made by code, which a subclass defines.

    Attributes:
        name: name of the spacecraft.
        centre_of_mass_m: the centre of mass in layout coordinates.
        skeleton: pairs of keypoint names.
        loose: groups of parts that a variant may lack; the parts of a group are missing together.
    """

    name: ClassVar[str]
    centre_of_mass_m: ClassVar[tuple[float, float, float]]
    skeleton: ClassVar[tuple[tuple[str, str], ...]]
    loose: ClassVar[tuple[tuple[str, ...], ...]]

    @abstractmethod
    def assemble(self, craft: Assembly, lean: float) -> None:
        """Add all parts and keypoints. ``lean``, −1 … 1, scales the variant's additional rotation of
        movable parts."""

    @abstractmethod
    def finishes(self, seed: int) -> Mapping[str, Finish]:
        """Functions that make the materials, by name; the seed determines their textures."""

    def build(self) -> Spacecraft:
        """Build the spacecraft of the options, without the keypoints of missing parts.

        Raises:
            InputError: ``missing_parts`` names a part that does not exist, or no part is left.
        """
        seed = self.options.variant_seed
        craft = Assembly(self.name)
        missing = set(self.options.missing_parts)
        lean = 0.0
        if seed is not None:
            rng = random_generator(seed, -1, f"variant {self.name}")
            lean = float(rng.uniform(-1.0, 1.0))
            count = int(rng.integers(0, min(self.options.variant_missing_parts, len(self.loose)) + 1))
            for group in rng.permutation(len(self.loose))[:count]:
                missing.update(self.loose[int(group)])
        self.assemble(craft, lean)
        for part in self.options.missing_parts:
            if part not in craft.part_names:
                hint = nearest(part, craft.part_names)
                raise InputError(f"target: missing_parts: {self.name} has no part {part!r}{hint}")
        craft.remove(missing)
        if not craft.part_names:
            raise InputError(f"target: missing_parts: no part of {self.name} is left; keep at least one")
        materials = self._materials(craft.material_names, seed)
        return craft.finish(materials, self.centre_of_mass_m, self.skeleton)

    def _materials(self, names: Sequence[str], seed: int | None) -> dict[str, Material]:
        finishes = self.finishes(0 if seed is None else derived_seed(seed, -1, "finishes"))

        def make(name: str) -> Material:
            material = finishes[name]()
            if seed is None:
                return material
            return varied(material, random_generator(seed, -1, f"variant {name}"))

        return dict(zip(names, in_threads(make, names), strict=True))


def varied(material: Material, rng: np.random.Generator) -> Material:
    """The material with small random changes of brightness, colour and roughness."""
    factor = np.exp(0.15 * rng.standard_normal() + 0.06 * rng.standard_normal(3))
    red, green, blue = (float(c) for c in np.clip(factor * material.base_color, 0.0, 1.0))
    roughness = material.roughness * np.exp(0.3 * rng.standard_normal())
    return replace(
        material, base_color=(red, green, blue), roughness=float(np.clip(roughness, 0.05, 1.0))
    )
