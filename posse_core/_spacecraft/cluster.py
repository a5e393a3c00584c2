"""A spacecraft like Cluster II, from its published dimensions.

Body axes: Y is the spin axis and the axis of the drum; X and Z are in the plane of the rigid booms. The
drum is 2.9 m in diameter and 1.3 m high, the rigid booms are 5 m long (ESA SP-1159; thesis, Table 3.2).
The positions of the booms and the length of the antennas follow the thesis' bounding box, 0.616 : 0.378
: 1. The 50 m wire booms are left out, as in the thesis. Everything else is modelled by eye after ESA's
photographs.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_about, R_from_z
from posse_core._model.joints import Joint
from posse_core._spacecraft import shapes, textures
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.finishes import Finish, common_finishes
from posse_core._spacecraft.options import ClusterOptions
from posse_core._spacecraft.parametric import Parametric
from posse_core._spacecraft.shapes import box

RADIUS_M, HEIGHT_M = 1.45, 1.30
BOX_RATIO = (0.616, 0.378, 1.0)
"""Proportions of the bounding box along X, Y, Z (thesis, Table 3.2)."""
CENTRE_OF_MASS_M = (0.0, 0.0, 0.0)
"""The centre of the drum: a spinner is balanced about its axis."""

BOOM_TIP = RADIUS_M + 5.0
BOOM_AZIMUTH = np.arctan2(BOX_RATIO[2], BOX_RATIO[0])  # about the spin axis, from X towards Z
BOOM_Y = 0.50
ANTENNA_TIP = BOX_RATIO[1] * BOOM_TIP * np.sin(BOOM_AZIMUTH)  # half the height of the bounding box
TOP, BOTTOM = HEIGHT_M / 2.0, -HEIGHT_M / 2.0
BAND = (-0.12, 0.12)  # y, the open band between the two rows of solar panels
SIDES = 6
PANEL_SEGMENTS = 12
UP = R_from_z((0.0, 1.0, 0.0))
DOWN = R_from_z((0.0, -1.0, 0.0))


class Cluster(Parametric[ClusterOptions]):
    """The scene source ``cluster``."""

    name = "cluster"
    centre_of_mass_m = CENTRE_OF_MASS_M
    skeleton = (
        *((f"{end}{k}", f"{end}{k % SIDES + 1}") for end in "TB" for k in range(1, SIDES + 1)),
        *((f"T{k}", f"B{k}") for k in range(1, SIDES + 1)),
        *(("A1", "A2"), ("A3", "A4")),
    )
    loose = (
        ("boom_1", "boom_1_hinges", "magnetometers"),
        ("boom_2", "boom_2_hinges", "search_coils"),
        ("antenna_top",),
        ("antenna_bottom",),
        ("solar_upper_2",),
        ("solar_lower_5",),
        ("aspoc",),
        ("cis_1", "cis_2"),
        ("edi_1", "edi_2"),
        ("top_lid",),
        ("engine",),
    )

    def assemble(self, craft: Assembly, lean: float) -> None:
        _drum(craft)
        _solar_array(craft)
        _ends(craft)
        _instruments(craft)
        _booms(craft)
        _antennas(craft)

    def finishes(self, seed: int) -> dict[str, Finish]:
        size_px = (1024, 384)
        cells = partial(textures.solar_cells, "solar_cells", (36, 13), size_px, seed)
        return {**common_finishes(seed), "solar_cells": cells}


def _around(azimuth_rad: float) -> FloatArray:
    """Rotation (3, 3) about the spin axis by the azimuth, from X towards Z."""
    return R_about((0.0, -1.0, 0.0), azimuth_rad)


def _ray(azimuth_rad: float, radius_m: float, y: float) -> FloatArray:
    return np.array([radius_m * np.cos(azimuth_rad), y, radius_m * np.sin(azimuth_rad)])


def _drum(craft: Assembly) -> None:
    """The parts that are visible between the solar panels: the black wall and its frames."""
    wall = shapes.cylinder(1.41, HEIGHT_M - 0.04, 72).at((0.0, BOTTOM + 0.02, 0.0), UP)
    craft.add("body", "foil_black", wall)
    frames = [
        shapes.ring(1.40, 1.43, 0.025, 72).at((0.0, y, 0.0), UP)
        for y in (BAND[0] - 0.02, BAND[1] - 0.005)
    ]
    craft.add("frames", "aluminium", *frames)


def _solar_array(craft: Assembly) -> None:
    """Two rows of six curved panels, with keypoints at their edges."""
    slot = np.radians(0.7)
    arc = 2.0 * np.pi / SIDES - slot
    rows = {"upper": (BAND[1], TOP), "lower": (BOTTOM, BAND[0])}
    for row, (low, high) in rows.items():
        height = high - low
        sheet = shapes.curved_panel(RADIUS_M, height, arc, 0.025, PANEL_SEGMENTS)
        sheet = sheet.textured((1.0 / (RADIUS_M * arc), 1.0 / height))
        for side in range(SIDES):
            start = 2.0 * np.pi * side / SIDES + slot / 2.0
            # The sheet's arc is counter-clockwise about Y, which is from X towards −Z.
            rotation = _around(start + arc) @ UP
            panel = sheet.at((0.0, (low + high) / 2.0, 0.0), rotation)
            craft.add(f"solar_{row}_{side + 1}", "solar_cells", panel)
    for side in range(SIDES):
        middle = 2.0 * np.pi * (side + 0.5) / SIDES
        corner = 2.0 * np.pi * side / SIDES + slot / 2.0
        upper, lower = f"solar_upper_{side + 1}", f"solar_lower_{side + 1}"
        craft.mark(f"T{side + 1}", upper, _ray(middle, RADIUS_M, TOP))
        craft.mark(f"B{side + 1}", lower, _ray(middle, RADIUS_M, BOTTOM))
        craft.mark(f"S{side + 1}", upper, _ray(corner, RADIUS_M, BAND[1]))


def _ends(craft: Assembly) -> None:
    """Top: white rim, foil, and the ring that carries a second spacecraft. Bottom: foil, engine,
    ring."""
    rim = shapes.ring(1.08, 1.425, 0.03, 72)
    craft.add("top_rim", "white_paint", rim.at((0.0, TOP - 0.03, 0.0), UP))
    craft.add("bottom_rim", "white_paint", rim.at((0.0, BOTTOM, 0.0), UP))
    craft.add("top_foil", "foil_black", shapes.cylinder(1.08, 0.015, 60).at((0, TOP - 0.03, 0), UP))
    craft.add(
        "bottom_foil", "foil_gold", shapes.cylinder(1.08, 0.015, 60).at((0, BOTTOM + 0.03, 0), DOWN)
    )
    hoop = shapes.ring(0.445, 0.47, 0.12, 64)
    craft.add("top_ring", "aluminium", hoop.at((0, TOP - 0.03, 0), UP))
    craft.add("separation_ring", "aluminium", hoop.at((0, BOTTOM + 0.03, 0), DOWN))
    lid = shapes.cylinder(0.44, 0.03, 48)
    craft.add("top_lid", "foil_gold", lid.at((0, TOP - 0.02, 0), UP))
    engine = shapes.nozzle(0.045, 0.16, 0.34, 0.008, 40)
    craft.add("engine", "titanium", engine.at((0.0, BOTTOM + 0.02, 0.0), DOWN))
    skirt = shapes.frustum(0.22, 0.12, 0.08, 40)
    craft.add("engine_shield", "foil_silver", skirt.at((0.0, BOTTOM + 0.02, 0.0), DOWN))
    springs = []
    for k in range(4):
        azimuth = np.radians(45.0 + 90.0 * k)
        pad = shapes.cylinder(0.035, 0.06, 24).at(_ray(azimuth, 0.53, BOTTOM + 0.015), DOWN)
        springs += [pad, box((0.10, 0.05, 0.07)).at(_ray(azimuth + 0.5, 0.56, BOTTOM))]
    craft.add("separation_springs", "aluminium", *springs)
    plugs = [box((0.12, 0.04, 0.09)).at(_ray(a, 0.95, BOTTOM + 0.01)) for a in (2.6, 5.74)]
    craft.add("umbilicals", "grey_paint", *plugs)
    seams = [
        box((0.62, 0.008, 0.03)).at((0.775, 0.0, 0.0)).at((0.0, TOP - 0.012, 0.0), _around(azimuth))
        for azimuth in np.arange(6) * np.pi / 3.0 + 0.3
    ]
    craft.add("top_seams", "foil_silver", *seams)
    jets = []
    for k in range(4):
        azimuth = np.radians(20.0 + 90.0 * k)
        for y, R in ((TOP, UP), (BOTTOM, DOWN)):
            jets.append(shapes.nozzle(0.018, 0.04, 0.09, 0.005, 20).at(_ray(azimuth, 1.2, y), R))
    craft.add("thrusters", "titanium", *jets)


def _instruments(craft: Assembly) -> None:
    """Sensors in the open band and on the top rim, named after Cluster's."""
    middle = sum(BAND) / 2.0

    def outward(name: str, material: str, degrees: float, size: tuple[float, float, float]) -> None:
        depth = size[0]
        mesh = box(size).at((RADIUS_M - 0.004 - depth / 2.0, middle, 0.0))
        craft.add(name, material, mesh.at((0.0, 0.0, 0.0), _around(np.radians(degrees))))

    outward("cis_1", "foil_gold", 15.0, (0.1, 0.2, 0.28))
    outward("cis_2", "foil_gold", 48.0, (0.1, 0.2, 0.22))
    outward("peace_1", "white_paint", 100.0, (0.1, 0.18, 0.16))
    outward("peace_2", "white_paint", 280.0, (0.1, 0.18, 0.16))
    outward("rapid", "aluminium", 200.0, (0.1, 0.2, 0.34))
    outward("edi_1", "foil_silver", 150.0, (0.1, 0.2, 0.24))
    outward("edi_2", "foil_silver", 330.0, (0.1, 0.2, 0.24))
    for k in range(4):
        azimuth = np.radians(75.0 + 90.0 * k)
        spool = _ray(azimuth, RADIUS_M - 0.14, middle)
        out = R_from_z(_ray(azimuth, 1.0, 0.0))
        craft.add(
            f"wire_spool_{k + 1}",
            "grey_paint",
            shapes.revolved(
                [(0, 0), (0.09, 0), (0.09, 0.08), (0.03, 0.10), (0.03, 0.13), (0, 0.13)], 24
            ).at(spool, out),
        )
    sensor = [(0, 0), (0.05, 0), (0.05, 0.06), (0.035, 0.08), (0.035, 0.01), (0, 0.01)]
    for k, degrees in enumerate((35.0, 215.0), start=1):
        position = _ray(np.radians(degrees), 1.28, TOP)
        craft.add(f"sun_sensor_{k}", "black_paint", shapes.revolved(sensor, 24).at(position, UP))
    aspoc = _ray(np.radians(300.0), 0.85, TOP - 0.02)
    craft.add(
        "aspoc",
        "foil_gold",
        shapes.cylinder(0.09, 0.14, 28).at(aspoc, UP),
        box((0.22, 0.10, 0.16)).at(np.add(aspoc, (0.0, 0.05, 0.14))),
    )


def _booms(craft: Assembly) -> None:
    """Two opposite rigid booms with a hinge halfway; one carries magnetometers, the other search
    coils. Once they are deployed, their hinges are locked."""
    for k in (0, 1):
        turn = _around(BOOM_AZIMUTH + np.pi * k)
        joint = f"boom_{k + 1}"
        hinge = _ray(BOOM_AZIMUTH + np.pi * k, RADIUS_M + 0.05, BOOM_Y)
        craft.hang(Joint(joint, "fixed", hinge, np.array([0.0, 1.0, 0.0])))

        def out(mesh: shapes.Mesh, turn: FloatArray = turn) -> shapes.Mesh:
            return mesh.at((0.0, 0.0, 0.0), turn)

        y, half = BOOM_Y, (RADIUS_M + BOOM_TIP) / 2.0
        rod = shapes.tube([(1.40, y, 0.0), (BOOM_TIP - 0.06, y, 0.0)], 0.025, 16)
        craft.add(f"boom_{k + 1}", "grey_paint", out(rod), joint=joint)
        knuckles = [box((0.16, 0.09, 0.09)).at((x, y, 0.0)) for x in (RADIUS_M + 0.05, half)]
        craft.add(f"boom_{k + 1}_hinges", "aluminium", *map(out, knuckles), joint=joint)
        # Two cradles on the top rim, in which the folded boom was stowed.
        cradles = [
            box((0.05, 0.07, 0.12)).at(_ray(BOOM_AZIMUTH + np.pi * k + turned, 1.36, TOP + 0.03))
            for turned in (0.6, 1.2)
        ]
        craft.add(f"boom_{k + 1}_cradles", "black_paint", *cradles)
        tip = np.array([BOOM_TIP - 0.06, y, 0.0])
        end = box((0.12, 0.12, 0.12)).at(tip)
        if k == 0:
            inner = box((0.12, 0.12, 0.12)).at((BOOM_TIP - 1.5, y, 0.0))
            craft.add("magnetometers", "foil_gold", out(end), out(inner), joint=joint)
        else:
            rods = [
                shapes.tube([tip - along, tip + along], 0.03, 16)
                for along in 0.16 * np.array([(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
            ]
            craft.add("search_coils", "foil_gold", out(end), *map(out, rods), joint=joint)
        name = ("magnetometers", "search_coils")[k]
        craft.mark(f"A{3 + k}", name, _ray(BOOM_AZIMUTH + np.pi * k, BOOM_TIP, y))


def _antennas(craft: Assembly) -> None:
    """S-band antennas on masts along the spin axis: at the centre of the top, and beside the engine
    below."""
    length = ANTENNA_TIP - TOP + 0.02
    stem = [(0, 0), (0.05, 0), (0.05, 0.05), (0.022, 0.07), (0.022, length - 0.42)]
    stem += [(0.055, length - 0.40), (0.055, length - 0.06), (0.02, length), (0, length)]
    mast = shapes.revolved(stem, 32)
    craft.add("antenna_top", "white_paint", mast.at((0.0, TOP - 0.02, 0.0), UP))
    craft.add("antenna_bottom", "white_paint", mast.at((0.62, BOTTOM + 0.02, 0.0), DOWN))
    craft.mark("A1", "antenna_top", (0.0, ANTENNA_TIP, 0.0))
    craft.mark("A2", "antenna_bottom", (0.62, -ANTENNA_TIP, 0.0))
