"""The bus of a spacecraft of the family: a prism or a drum with decks, tapes, and perhaps solar cells.

Layout coordinates: body axes with the origin at the bus's centre. Z is the bus's own axis; its top is at
−Z, as with the other built-in spacecraft. Lengths are in units of about the bus's width.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_about, R_from_z
from posse_core._spacecraft import shapes
from posse_core._spacecraft.assembly import Assembly

BusKind = Literal["box", "hexagon", "octagon", "cylinder"]
"""A cuboid, a prism with six or eight sides, or a drum."""
WINGED_AZIMUTHS = {0: (), 1: (270,), 2: (90, 270), 4: (0, 90, 180, 270)}
"""Number of wings → azimuths of the sides that carry them, degrees from X towards Y."""
_COVERINGS = (
    *(("foil_gold",) * 4 + ("foil_amber", "foil_silver") * 3),
    *("foil_black", "foil_black", "white_paint", "white_paint", "grey_paint"),
)
_DECKS = ("white_paint", "black_paint", "foil_silver", "aluminium", "mirror_tiles", "foil_black")
_SEGMENTS = 48
_CELL_GAP_RAD = 0.03

T = TypeVar("T")


def picked(rng: np.random.Generator, choices: Sequence[T]) -> T:
    """One of the choices, each with the same probability."""
    return choices[int(rng.integers(len(choices)))]


@dataclass(frozen=True)
class Side:
    """A side of the bus. In its own axes x points outward and z is the body's.

    Attributes:
        azimuth_deg: of its outward normal, from X towards Y.
        apothem_m: distance from the bus's axis.
        width_m: its horizontal width; of a drum, of the strip that fittings may use.
    """

    azimuth_deg: int
    apothem_m: float
    width_m: float

    @property
    def R_body_from_side(self) -> FloatArray:
        """(3, 3) rotation from the side's own axes."""
        return R_about((0.0, 0.0, 1.0), np.radians(self.azimuth_deg))

    @property
    def outward(self) -> FloatArray:
        """(3,) unit normal, body axes."""
        return np.asarray(self.R_body_from_side[:, 0])

    def placed(self, mesh: shapes.Mesh) -> shapes.Mesh:
        """A mesh of the side's own axes in layout coordinates."""
        return mesh.at((0.0, 0.0, 0.0), self.R_body_from_side)

    def plate(
        self, y_m: tuple[float, float], z_m: tuple[float, float], sunk_m: float, proud_m: float
    ) -> shapes.Mesh:
        """A box on the side, from ``sunk_m`` below its surface to ``proud_m`` above it."""
        low = np.array([self.apothem_m - sunk_m, y_m[0], z_m[0]])
        high = np.array([self.apothem_m + proud_m, y_m[1], z_m[1]])
        return self.placed(shapes.box(high - low).at((low + high) / 2.0))


@dataclass(frozen=True)
class Bus:
    """The shape of a bus.

    Attributes:
        kind: its shape.
        unit_m: the unit of all lengths of this spacecraft.
        outline_m: (N, 2) the horizontal outline, counter-clockwise.
        height_m: along Z.
        sides: its sides by their azimuths.
        winged: those that carry wings.
        covering: name of its finish.
        has_cells: whether the sides without wings have solar cells.
    """

    kind: BusKind
    unit_m: float
    outline_m: FloatArray
    height_m: float
    sides: tuple[Side, ...]
    winged: tuple[Side, ...]
    covering: str
    has_cells: bool

    @property
    def free(self) -> tuple[Side, ...]:
        """The sides that carry no wing."""
        return tuple(side for side in self.sides if side not in self.winged)

    @property
    def half_m(self) -> FloatArray:
        """(2,) the outline's extents along X and Y."""
        return np.asarray(self.outline_m.max(axis=0))

    @property
    def inscribed_m(self) -> float:
        """Radius of the largest circle about the axis within the outline."""
        return min(side.apothem_m for side in self.sides)

    def on_deck(self, mesh: shapes.Mesh, end: int, azimuth_deg: float, radius_m: float) -> shapes.Mesh:
        """A mesh whose z points outward, placed on the deck at +Z (``end`` 1) or −Z (−1)."""
        place = self.place_on_deck(end, azimuth_deg, radius_m)
        return mesh.at(place, R_from_z((0.0, 0.0, float(end))))

    def place_on_deck(self, end: int, azimuth_deg: float, radius_m: float) -> FloatArray:
        """(3,) where z = 0 of a fitting is: a little below the surface, so that no faces coincide."""
        azimuth, z = np.radians(azimuth_deg), end * (self.height_m / 2.0 - 0.01 * self.unit_m)
        return np.array([radius_m * np.cos(azimuth), radius_m * np.sin(azimuth), z])


def drawn_bus(kind: BusKind, wings: int, unit_m: float, rng: np.random.Generator) -> Bus:
    """A random bus of a kind."""
    u = unit_m
    width, depth, height = u * rng.uniform((0.7, 0.7, 0.8), (1.15, 1.15, 1.7))
    if kind != "box":
        depth, height = width, u * rng.uniform(0.5, 1.3)
    half = np.array([width, depth]) / 2.0
    if kind == "box":
        outline = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
        sides = tuple(Side(90 * k, float(half[k % 2]), 2.0 * float(half[(k + 1) % 2])) for k in range(4))
    else:
        count = {"hexagon": 6, "octagon": 8, "cylinder": 8}[kind]
        step = 360 // count
        first = 30 if kind == "hexagon" else 0
        corners = _SEGMENTS if kind == "cylinder" else count
        reach = half[0] if kind == "cylinder" else half[0] / np.cos(np.pi / count)
        angle = 2.0 * np.pi * np.arange(corners) / corners
        if kind == "octagon":
            angle += np.pi / count
        outline = reach * np.column_stack([np.cos(angle), np.sin(angle)])
        chord = 2.0 * half[0] * np.tan(np.pi / count)
        wide = float(0.6 * chord if kind == "cylinder" else chord)
        sides = tuple(Side(first + step * k, float(half[0]), wide) for k in range(count))
    winged = tuple(side for side in sides if side.azimuth_deg in WINGED_AZIMUTHS[wings])
    covering = picked(rng, _COVERINGS)
    has_cells = wings == 0 or (wings < 4 and rng.uniform() < 0.15)
    return Bus(kind, u, outline, float(height), sides, winged, covering, has_cells)


def add_bus(craft: Assembly, bus: Bus, rng: np.random.Generator) -> None:
    """The body with its decks and tapes, and keypoints at its corners."""
    if bus.kind == "cylinder":
        drum = shapes.cylinder(bus.sides[0].apothem_m, bus.height_m, _SEGMENTS)
        craft.add("bus", bus.covering, drum.at((0.0, 0.0, -bus.height_m / 2.0)))
        corners = bus.outline_m[_SEGMENTS // 8 :: _SEGMENTS // 4]
    else:
        craft.add("bus", bus.covering, shapes.prism(bus.outline_m, bus.height_m))
        corners = bus.outline_m
    for number, (x, y) in enumerate(corners, start=1):
        craft.mark(f"T{number}", "bus", (x, y, -bus.height_m / 2.0))
        craft.mark(f"B{number}", "bus", (x, y, bus.height_m / 2.0))
    for name, z in (("deck_top", -bus.height_m / 2.0), ("deck_bottom", bus.height_m / 2.0)):
        share, thick = rng.uniform(0.8, 0.93), rng.uniform(0.012, 0.03) * bus.unit_m
        craft.add(name, picked(rng, _DECKS), shapes.prism(share * bus.outline_m, thick).at((0, 0, z)))
    proud = 1.0 + 0.006 / float(np.abs(bus.half_m).max() / bus.unit_m)
    bands = [
        shapes.prism(proud * bus.outline_m, rng.uniform(0.012, 0.03) * bus.unit_m).at((0.0, 0.0, z))
        for z in bus.height_m * (rng.permutation(5)[: rng.integers(1, 4)] - 2.0) / 5.3
    ]
    tape = picked(rng, ("foil_silver", "aluminium", "black_paint"))
    craft.add("bus_tapes", tape, *bands)


def add_cells(craft: Assembly, bus: Bus) -> None:
    """Solar cells on the sides without wings. With no wing, the corners of two are keypoints."""
    height, proud, thick = 0.86 * bus.height_m, 0.014 * bus.unit_m, 0.02 * bus.unit_m
    marked = () if bus.winged else (0, len(bus.sides) // 2)
    corners = 0
    for number, side in enumerate(bus.free):
        outside = side.apothem_m + proud
        if bus.kind == "cylinder":
            arc = 2.0 * np.pi / len(bus.sides) - _CELL_GAP_RAD
            half = arc / 2.0
            sheet = shapes.curved_panel(outside, height, arc, thick, 8)
            sheet = sheet.textured((1.0 / (outside * arc), 0.5 / height))
            panel = sheet.at((0.0, 0.0, 0.0), R_about((0.0, 0.0, 1.0), -half))
            edges = [(outside * np.cos(half), end * outside * np.sin(half)) for end in (-1.0, 1.0)]
        else:
            width = 0.9 * side.width_m
            outward = R_from_z((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
            panel = shapes.panel(width, height, thick).at((outside - thick / 2.0, 0.0, 0.0), outward)
            edges = [(outside, end * width / 2.0) for end in (-1.0, 1.0)]
        name = f"cells_{number + 1}"
        craft.add(name, "body_cells", side.placed(panel))
        if number in marked:
            for (x, y), z in itertools.product(edges, (-height / 2.0, height / 2.0)):
                corners += 1
                craft.mark(f"S{corners}", name, side.R_body_from_side @ (x, y, z))
