"""A family of spacecraft: each seed is another plausible craft, for nets that must know unknown ones.

Proportions are those of real buses, from smallsats to geostationary ones: the panels of a wing are up to
five buses long, reflectors up to about a bus wide. No spacecraft is modelled on a particular one.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._interfaces.scene import SceneSource
from posse_core._model.spacecraft import Spacecraft
from posse_core._randomness import derived_seed, random_generator
from posse_core._spacecraft import textures
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.family.bus import Bus, add_bus, add_cells, drawn_bus, picked
from posse_core._spacecraft.family.fittings import add_fittings
from posse_core._spacecraft.family.wings import CELL_M, WingDesign, add_wings, drawn_wings
from posse_core._spacecraft.finishes import Finish, common_finishes
from posse_core._spacecraft.options import FamilyOptions
from posse_core._spacecraft.parametric import varied

BUS_DENSITY_KG_M3, WING_DENSITY_KG_M2 = 120.0, 4.0
"""For the centre of mass."""
_WIDTH_PX = 768


class Family(SceneSource[FamilyOptions]):
    """The scene source ``family``."""

    def build(self) -> Spacecraft:
        """Build the spacecraft of the seed: once in units of its bus, and then in its size."""
        low, high = self.options.size_m
        size_m = low * (high / low) ** float(self._random("size").uniform())
        outline, _, _ = self._assembled(1.0)
        longest = float(np.ptp(outline.bounds_m, axis=0).max())
        craft, bus, wings = self._assembled(size_m / longest)
        makers = self._finishes(bus, wings)
        materials = {
            name: varied(makers[name](), self._random(f"finish {name}")) for name in craft.material_names
        }
        return craft.finish(materials, _centre_of_mass_m(bus, wings), _skeleton(bus))

    def _random(self, purpose: str) -> np.random.Generator:
        return random_generator(self.options.seed, -1, f"family {purpose}")

    def _assembled(self, unit_m: float) -> tuple[Assembly, Bus, WingDesign | None]:
        """The spacecraft of the seed, proportional to the unit."""
        options = self.options
        choice = self._random("kind")
        kind, count = picked(choice, options.bus), picked(choice, options.wings)
        if kind == "hexagon" and count == 4:
            count = 2  # it has no sides towards ±X
        bus = drawn_bus(kind, count, unit_m, self._random("bus"))
        craft = Assembly(f"family-{options.seed}")
        add_bus(craft, bus, self._random("decks"))
        if bus.has_cells:
            add_cells(craft, bus)
        wings, reach_m = None, np.inf
        if bus.winged:
            rng = self._random("wings")
            wings = drawn_wings(bus, rng)
            add_wings(craft, bus, wings, rng)
            reach_m = wings.yoke_m
        add_fittings(craft, bus, reach_m, self._random("fittings"))
        return craft, bus, wings

    def _finishes(self, bus: Bus, wings: WingDesign | None) -> dict[str, Finish]:
        seed = derived_seed(self.options.seed, -1, "family textures")
        makers = dict(common_finishes(seed))
        cells = {"body_cells": (max(side.width_m for side in bus.sides), 0.86 * bus.height_m)}
        if wings is not None:
            cells["solar_panel"] = wings.panel_m[:2]
        back = picked(self._random("back"), (0.045, 0.045, 0.5))
        for name, (length_m, chord_m) in cells.items():
            count, size_px = _cell_grid(length_m, chord_m)
            makers[name] = partial(textures.solar_panel, name, count, size_px, seed, back=back)
        return makers


def _cell_grid(length_m: float, chord_m: float) -> tuple[tuple[int, int], tuple[int, int]]:
    """Number of cells along a panel and across it, and the size of its texture, px."""
    along = int(np.clip(round(length_m / CELL_M), 4, 24))
    across = int(np.clip(round(along * chord_m / length_m), 2, 36))
    return (along, across), (_WIDTH_PX, max(96, int(_WIDTH_PX * min(chord_m / length_m, 2.0))))


def _centre_of_mass_m(bus: Bus, wings: WingDesign | None) -> FloatArray:
    """(3,) layout coordinates; bus and panels have an even density, the rest is light."""
    if wings is None:
        return np.zeros(3)
    x, y = bus.outline_m.T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    length, chord, _ = wings.panel_m
    panels_kg = WING_DENSITY_KG_M2 * wings.panels * length * chord
    reach = wings.yoke_m + wings.panels * (length + wings.gap_m) / 2.0
    moment, mass_kg = np.zeros(3), BUS_DENSITY_KG_M3 * area * bus.height_m
    for side in bus.winged:
        middle = (side.apothem_m + reach) * side.outward + (0.0, 0.0, wings.drive_z_m)
        moment, mass_kg = moment + panels_kg * middle, mass_kg + panels_kg
    return np.asarray(moment / mass_kg)


def _skeleton(bus: Bus) -> list[tuple[str, str]]:
    """Edges of the bus and of the panels of each wing."""
    count = 4 if bus.kind == "cylinder" else len(bus.sides)
    around = [(k, k % count + 1) for k in range(1, count + 1)]
    pairs = [(f"{end}{a}", f"{end}{b}") for end in "TB" for a, b in around]
    pairs += [(f"T{k}", f"B{k}") for k in range(1, count + 1)]
    order = ((1, 2), (2, 3), (3, 4), (4, 1)) if bus.winged else ((1, 2), (2, 4), (4, 3), (3, 1))
    sheets = len(bus.winged) or 2
    pairs += [(f"S{4 * k + a}", f"S{4 * k + b}") for k in range(sheets) for a, b in order]
    return pairs
