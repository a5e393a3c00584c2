"""A 3U CubeSat with two wings. The whole spacecraft and its options are in this file.

Body axes: Z is along the length, with the camera at +Z (towards the nadir when nadir-pointing); the
cells face −Y. The body is 100 × 100 × 340.5 mm with rails of 8.5 mm (CubeSat Design Specification, rev.
14.1).
"""

from __future__ import annotations

from functools import partial

import numpy as np
from pydantic import Field

from posse_core._arrays import FloatArray
from posse_core._frames import R_a_from_b_by_directions, R_about, R_from_z
from posse_core._model.joints import Joint
from posse_core._model.spacecraft import Material
from posse_core._spacecraft import shapes, textures
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.finishes import Finish, common_finishes
from posse_core._spacecraft.options import VariantOptions
from posse_core._spacecraft.parametric import Parametric
from posse_core._spacecraft.shapes import box

WIDTH_M, LENGTH_M, RAIL_M = 0.100, 0.3405, 0.0085
PANEL_M = (0.082, 0.320, 0.002)  # width, length, thickness
TAPE_M = (0.17, 0.006, 0.0008)  # a quarter-wave monopole for 435 MHz
HALF, END = WIDTH_M / 2.0, LENGTH_M / 2.0


class CubesatOptions(VariantOptions):
    """Options of the 3U CubeSat, 34 cm long with two hinged wings."""

    panel_angle_deg: float = Field(
        0.0,
        ge=0.0,
        le=150.0,
        description="folding angle of both wings, from flat back towards the sides",
    )
    variant_panel_angle_deg: float = Field(
        40.0, ge=0.0, le=150.0, description="largest additional random folding angle in a variant"
    )


class Cubesat(Parametric[CubesatOptions]):
    """The scene source ``cubesat``."""

    name = "cubesat"
    centre_of_mass_m = (0.0, 0.0, 0.0)
    skeleton = (
        *((f"{end}{k}", f"{end}{k % 4 + 1}") for end in "TB" for k in range(1, 5)),
        *((f"T{k}", f"B{k}") for k in range(1, 5)),
        *(("S1", "S2"), ("S3", "S4"), ("A1", "A2"), ("A3", "A4")),
    )
    loose = (("tape_1",), ("tape_2",), ("tape_3",), ("wing_left",), ("gps_antenna",), ("star_tracker",))

    def assemble(self, craft: Assembly, lean: float) -> None:
        _body(craft)
        _payload(craft)
        _tapes(craft)
        fold_deg = self.options.panel_angle_deg + abs(lean) * self.options.variant_panel_angle_deg
        _wings(craft, np.radians(fold_deg))

    def finishes(self, seed: int) -> dict[str, Finish]:
        size_px = (256, 1024)
        panel = partial(textures.solar_panel, "solar_panel", (2, 6), size_px, seed)
        board = partial(Material, "circuit_board", (0.015, 0.06, 0.02), roughness=0.35)
        glass = partial(Material, "glass", (0.01, 0.008, 0.015), roughness=0.05)
        own: dict[str, Finish] = {"solar_panel": panel, "circuit_board": board, "glass": glass}
        return common_finishes(seed) | own


def _body(craft: Assembly) -> None:
    """Rails with their feet, ribs of the frame, walls, and cells on three sides."""
    offset = HALF - RAIL_M / 2.0
    corners = [(offset, offset), (-offset, offset), (-offset, -offset), (offset, -offset)]
    rails = [box((RAIL_M, RAIL_M, LENGTH_M)).at((x, y, 0.0)) for x, y in corners]
    ribs = []
    for z in (-END + 0.009, -LENGTH_M / 6.0, LENGTH_M / 6.0, END - 0.009):
        for x, y in ((0.0, offset), (0.0, -offset), (offset, 0.0), (-offset, 0.0)):
            length = WIDTH_M - 2.0 * RAIL_M
            size = (length, 0.004, 0.006) if x == 0.0 else (0.004, length, 0.006)
            ribs.append(box(size).at((x, y, z)))
    craft.add("rails", "aluminium", *rails, *ribs)
    inner = WIDTH_M - 0.010
    craft.add("bus", "black_paint", box((inner, inner, LENGTH_M - 0.014)))
    for name, azimuth in (("right", 0.0), ("left", np.pi), ("up", -np.pi / 2.0)):
        craft.add(f"cells_{name}", "solar_panel", _sheet().at((0.0, 0.0, 0.0), _side(azimuth)))
    for number, (x, y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)), start=1):
        craft.mark(f"T{number}", "rails", (x * HALF, y * HALF, -END))
        craft.mark(f"B{number}", "rails", (x * HALF, y * HALF, END))


def _sheet() -> shapes.Mesh:
    """A panel whose back is just outside the plane of a wall, with its front towards +z."""
    return shapes.panel(*PANEL_M).at((0.0, 0.0, HALF - 0.0035))


def _side(azimuth_rad: float) -> FloatArray:
    """Rotation (3, 3) that takes a panel's z to the outward direction at the azimuth (from X to Y), and
    its y to body Z."""
    outward = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
    along = np.array([0.0, 0.0, 1.0])
    return R_a_from_b_by_directions(outward, along, np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))


def _payload(craft: Assembly) -> None:
    """Camera at +Z, star tracker and circuit board on +Y, thruster and patch antenna at −Z."""
    bore = [(0, 0), (0.036, 0), (0.036, 0.018), (0.031, 0.018), (0.028, 0.004), (0, 0.004)]
    craft.add("camera", "black_paint", shapes.revolved(bore, 48).at((0.0, 0.0, END - 0.010)))
    glass = shapes.revolved([(0, 0), (0.027, 0), (0.020, 0.004), (0, 0.006)], 40)
    craft.add("lens", "glass", glass.at((0.0, 0.0, END - 0.008)))
    board = box((0.080, 0.0016, 0.300)).at((0.0, HALF - 0.0040, 0.0))
    craft.add("board", "circuit_board", board)
    outward = R_from_z((0.0, 1.0, 0.0))
    hole = [(0, 0), (0.014, 0), (0.016, 0.012), (0.014, 0.012), (0.010, 0.002), (0, 0.002)]
    craft.add(
        "star_tracker", "grey_paint", shapes.revolved(hole, 32).at((0.0, HALF - 0.0035, 0.11), outward)
    )
    patch = box((0.035, 0.004, 0.035)).at((0.0, HALF - 0.0015, -0.09))
    craft.add("gps_antenna", "white_paint", patch)
    chips = [
        box((w, 0.002, h)).at((x, HALF - 0.0025, z))
        for x, z, w, h in (
            (-0.02, 0.02, 0.014, 0.014),
            (0.018, 0.03, 0.010, 0.018),
            (0.0, -0.02, 0.020, 0.012),
            (-0.022, -0.045, 0.012, 0.008),
            (0.024, 0.065, 0.008, 0.008),
        )
    ]
    craft.add("chips", "black_paint", *chips)
    s_band = box((0.060, 0.060, 0.004)).at((0.0, 0.0, -END + 0.006))
    craft.add("s_band_antenna", "white_paint", s_band)


def _tapes(craft: Assembly) -> None:
    """Four tape antennas at the −Z end, tilted slightly backwards."""
    length, width, thick = TAPE_M
    for number in range(4):
        azimuth = np.pi / 2.0 * number
        turn = R_about((0.0, 0.0, 1.0), azimuth) @ R_about((0.0, 1.0, 0.0), np.radians(20.0))
        root = 0.04 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) + (0.0, 0.0, -END + 0.008)
        tape = box((length, width, thick)).at((length / 2.0, 0.0, 0.0)).at(root, turn)
        craft.add(f"tape_{number + 1}", "aluminium", tape)
        craft.mark(f"A{number + 1}", f"tape_{number + 1}", turn @ (length, 0.0, 0.0) + root)


def _wings(craft: Assembly, fold_rad: float) -> None:
    """Two wings hinged at the upper long edges; when flat, their cells face up (−Y).

    The joints ``wing_right`` and ``wing_left`` fold them from flat to the sides, where they are stowed.
    """
    width, length, _ = PANEL_M
    hinge = HALF - 0.002
    for sign, name, first in ((1.0, "right", 1), (-1.0, "left", 3)):
        turn = R_about((0.0, 0.0, 1.0), sign * fold_rad)
        root = np.array([sign * (HALF + 0.002), -hinge, 0.0])
        joint = f"wing_{name}"
        craft.hang(
            Joint(
                joint,
                "revolute",
                origin_body_m=root,
                axis_body=np.array([0.0, 0.0, sign]),
                limits=(0.0 - float(fold_rad), max(np.pi / 2.0 - float(fold_rad), 0.0)),
                facing_body=turn @ np.array([0.0, -1.0, 0.0]),
            )
        )

        def turned(mesh: shapes.Mesh, turn: FloatArray = turn, root: FloatArray = root) -> shapes.Mesh:
            return mesh.at(root, turn)

        flat = shapes.panel(*PANEL_M).at((0.0, 0.0, 0.0), _side(-np.pi / 2.0))
        wing = turned(flat.at((sign * (0.004 + width / 2.0), 0.0, 0.0)))
        craft.add(f"wing_{name}", "solar_panel", wing, joint=joint)
        hinges = [
            shapes.tube([(0.0, 0.0, z - 0.012), (0.0, 0.0, z + 0.012)], 0.003, 12) for z in (-0.1, 0.1)
        ]
        leaves = [box((0.010, 0.001, 0.020)).at((sign * 0.004, 0.002, z)) for z in (-0.1, 0.1)]
        craft.add(f"hinges_{name}", "aluminium", *map(turned, (*hinges, *leaves)), joint=joint)
        for number, z in ((first, -length / 2.0), (first + 1, length / 2.0)):
            corner = turn @ (sign * (0.004 + width), 0.0, z) + root
            craft.mark(f"S{number}", f"wing_{name}", corner)
