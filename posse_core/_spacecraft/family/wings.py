"""The solar wings of a spacecraft of the family, with a drive and hinges that are joints.

Wing axes: x points outward from the bus, z out of the cells, and y completes them; the origin is where
the shaft leaves the drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_about, R_from_z
from posse_core._model.joints import Joint
from posse_core._spacecraft import shapes
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.family.bus import Bus, Side, picked

MOST_PANELS = {1: 7, 2: 5, 4: 3}
"""Number of wings → the most panels that each has."""
LONGEST_WING = 5.0
"""Length of a wing's panels, at most, in units of the bus."""
CELL_M = 0.12
"""Side of the squares in which cells are drawn. Real cells are smaller; in a texture they would blur."""


@dataclass(frozen=True)
class WingDesign:
    """What all wings of a spacecraft have in common; lengths in metres.

    Attributes:
        panels: number of panels of each wing.
        panel_m: (length along the wing, chord, thickness).
        gap_m: between panels.
        yoke_m: length of the yoke.
        is_triangle: whether the yoke is a triangle rather than a single boom.
        angle_rad: rotation of the wings along Y from cells towards −Z about body Y; with four wings, 0.
        drive_z_m: height of the wings' axis.
    """

    panels: int
    panel_m: tuple[float, float, float]
    gap_m: float
    yoke_m: float
    is_triangle: bool
    angle_rad: float
    drive_z_m: float


def drawn_wings(bus: Bus, rng: np.random.Generator) -> WingDesign:
    """Random wings for a bus that has some."""
    u, count = bus.unit_m, len(bus.winged)
    chord = u * float(rng.uniform(0.6, 1.3 if count < 4 else 0.95))
    length = float(rng.uniform(0.55, 1.3)) * chord
    fit = max(1, int(LONGEST_WING * u / length))
    panels = min(int(rng.integers(1 if count > 1 else 2, MOST_PANELS[count] + 1)), fit)
    yoke = u * float(rng.uniform(0.3, 0.7))
    angle = float(rng.uniform(-np.pi, np.pi)) if count < 4 else 0.0
    z = float(rng.uniform(-0.2, 0.2)) * bus.height_m
    thick = 0.018 * u
    return WingDesign(panels, (length, chord, thick), 0.03 * u, yoke, bool(rng.integers(2)), angle, z)


def add_wings(craft: Assembly, bus: Bus, design: WingDesign, rng: np.random.Generator) -> None:
    """The wings, numbered from 1, with keypoints at the outer corners of their first and last panel."""
    yoke = picked(rng, ("aluminium", "black_paint", "white_paint"))
    for number, side in enumerate(bus.winged, start=1):
        _add_wing(craft, bus, design, side, number, yoke)


def _add_wing(
    craft: Assembly, bus: Bus, design: WingDesign, side: Side, number: int, finish: str
) -> None:
    u, name = bus.unit_m, f"wing_{number}"
    length, chord, thick = design.panel_m
    out = 0.08 * u
    root = side.outward * (side.apothem_m + out) + (0.0, 0.0, design.drive_z_m)
    normal = R_about((0.0, 1.0, 0.0), design.angle_rad) @ (0.0, 0.0, -1.0)
    R = np.column_stack([side.outward, np.cross(normal, side.outward), normal])

    def placed(mesh: shapes.Mesh) -> shapes.Mesh:
        return mesh.at(root, R)

    def point(x_m: float, y_m: float) -> FloatArray:
        return np.asarray(R @ (x_m, y_m, 0.0) + root)

    along = R_from_z((1.0, 0.0, 0.0))
    housing = shapes.cylinder(0.075 * u, out + 0.03 * u, 24).at((-out - 0.03 * u, 0.0, 0.0), along)
    craft.add(f"{name}_drive", "aluminium", placed(housing))
    craft.hang(Joint(name, "revolute", root, side.outward, facing_body=normal))
    craft.add(f"{name}_yoke", finish, *map(placed, _yoke(design, u)), joint=name)
    carrier = name
    for panel in range(1, design.panels + 1):
        start = design.yoke_m + panel * design.gap_m + (panel - 1) * length
        hinge = f"{name}_hinge_{panel}"
        at = point(start - design.gap_m / 2.0, 0.0)
        craft.hang(Joint(hinge, "revolute", at, -R[:, 1], carrier, limits=(-np.pi, np.pi)))
        sheet = shapes.panel(length, chord, thick).at((start + length / 2.0, 0.0, 0.0))
        craft.add(f"{name}_panel_{panel}", "solar_panel", placed(sheet), joint=hinge)
        frame = _frame(design, start, u)
        craft.add(f"{name}_frame_{panel}", "aluminium", *map(placed, frame), joint=hinge)
        carrier = hinge
    first, last = design.yoke_m + design.gap_m, start + length
    corners = ((first, -1, 1), (first, 1, 1), (last, 1, design.panels), (last, -1, design.panels))
    for k, (x, end, panel) in enumerate(corners, start=4 * number - 3):
        craft.mark(f"S{k}", f"{name}_panel_{panel}", point(x, end * chord / 2.0))


def _yoke(design: WingDesign, u: float) -> list[shapes.Mesh]:
    """A shaft out of the drive and a triangle or one boom, with a bar along the first panel's edge."""
    radius, foot = 0.022 * u, 0.06 * u
    end, reach = design.yoke_m - 0.01 * u, 0.36 * design.panel_m[1]
    shaft = shapes.tube([(-0.04 * u, 0.0, 0.0), (foot, 0.0, 0.0)], 1.8 * radius, 16)
    bar = shapes.tube([(end, -reach, 0.0), (end, reach, 0.0)], radius, 10)
    if design.is_triangle:
        arms = [
            shapes.tube([(0.8 * foot, 0.0, 0.0), (end, y, 0.0)], 0.9 * radius)
            for y in (-0.9 * reach, 0.9 * reach)
        ]
    else:
        arms = [shapes.tube([(0.8 * foot, 0.0, 0.0), (end, 0.0, 0.0)], 1.3 * radius)]
    return [shaft, bar, *arms]


def _frame(design: WingDesign, start_m: float, u: float) -> list[shapes.Mesh]:
    """Two ribs behind a panel that starts at x, and the knuckles of the hinge at its inner edge."""
    length, chord, thick = design.panel_m
    rib = 0.02 * u
    middle, behind = start_m + length / 2.0, -thick / 2.0 - 0.4 * rib
    meshes = [
        shapes.box((0.97 * length, 1.5 * rib, rib)).at((middle, y * chord, behind))
        for y in (-0.25, 0.25)
    ]
    meshes += [
        shapes.box((2.6 * design.gap_m, 0.05 * u, 1.7 * thick)).at(
            (start_m - design.gap_m / 2.0, y * chord, 0.0)
        )
        for y in (-0.33, 0.33)
    ]
    return meshes
