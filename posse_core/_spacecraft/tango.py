"""A spacecraft like Tango, the target of PRISMA and of the data sets SPEED, SPEED+ and SHIRT.

Body axes and origin are SPEED's: Z is the outward normal of the solar panel, X and Y are along its edges
(0.74 m and 0.77 m), and the origin is in the middle of the body's lower face. The eleven keypoints are
those of SPEED+ (Park et al., IEEE Aerospace Conference 2022): S0 … S3 are corners of the panel, B4 … B7
of the body, and A8 … A10 the tips of the antennas. In photographs the body's lower corners are 12 mm
above B4 … B7, which were published at z = 0.

The outline of body, panel and antennas follows from the keypoints; all else (cells, brackets, struts,
instruments) is modelled by eye after photographs of the mock-up in Stanford's laboratory.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from posse_core._frames import R_a_from_b_by_directions, R_about, R_from_z, unit
from posse_core._model.spacecraft import Material
from posse_core._randomness import random_generator
from posse_core._spacecraft import shapes, textures
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.finishes import Finish, common_finishes
from posse_core._spacecraft.options import VariantOptions
from posse_core._spacecraft.parametric import Parametric
from posse_core._spacecraft.shapes import box

KEYPOINTS_M = {
    "S0": (-0.37, -0.385, 0.3215),
    "S1": (-0.37, 0.385, 0.3215),
    "S2": (0.37, 0.385, 0.3215),
    "S3": (0.37, -0.385, 0.3215),
    "B4": (-0.37, -0.264, 0.0),
    "B5": (-0.37, 0.304, 0.0),
    "B6": (0.37, 0.304, 0.0),
    "B7": (0.37, -0.264, 0.0),
    "A8": (-0.5427, 0.4877, 0.2535),
    "A9": (0.5427, 0.4877, 0.2591),
    "A10": (0.305, -0.579, 0.2515),
}
"""SPEED's keypoints, body axes."""

HALF_X, PANEL_Y = 0.37, 0.385
BACK, FRONT = -0.264, 0.304  # y of the body's sides
BOTTOM, TOP = 0.0125, 0.295  # z of the body
FACE = 0.3215  # z of the panel's cells
SHEET = 0.0005  # thickness of the layer of cells

COLUMNS, ROWS = 4, 17  # of cells in each of the two groups
PITCH_X, PITCH_Y = 0.0831, 0.0431
LEFT_X, RIGHT_X, FIRST_Y = -0.3400, 0.0193, -0.3696  # where the groups of cells begin
TEXELS_PER_M = 1400.0


class TangoOptions(VariantOptions):
    """Options of the Tango-like spacecraft, a box under one solar panel."""


class Tango(Parametric[TangoOptions]):
    """The scene source ``tango``."""

    name = "tango"
    centre_of_mass_m = (0.0, 0.0, 0.0)
    skeleton = (
        *(("S0", "S1"), ("S1", "S2"), ("S2", "S3"), ("S3", "S0")),
        *(("B4", "B5"), ("B5", "B6"), ("B6", "B7"), ("B7", "B4")),
        *(("S0", "B4"), ("S1", "B5"), ("S2", "B6"), ("S3", "B7")),
        *(("S1", "A8"), ("S2", "A9"), ("S3", "A10")),
    )
    loose = (
        ("gps_antenna_left",),
        ("gps_antenna_right",),
        ("rod_left",),
        ("rod_right",),
        ("probe_left",),
        ("probe_right",),
        ("radiator",),
        ("tab",),
        ("lugs",),
    )

    def assemble(self, craft: Assembly, lean: float) -> None:
        _panel(craft)
        _body(craft)
        _antennas(craft)
        _brackets(craft)
        _struts(craft)
        _fittings(craft)

    def finishes(self, seed: int) -> dict[str, Finish]:
        silver = (0.82, 0.82, 0.82)
        own: dict[str, Finish] = {
            "cells": lambda: _cells(seed),
            "film": lambda: textures.film("film", silver, seed, 14, 0.25),
            "film_creased": lambda: textures.film("film_creased", silver, seed, 90, 0.30),
            "film_matt": lambda: textures.film("film_matt", silver, seed, 4, 0.50, 0.5),
            "antenna_paint": partial(Material, "antenna_paint", (0.09, 0.09, 0.09), roughness=0.4),
        }
        return common_finishes(seed) | own


def _cuboid(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> shapes.Mesh:
    low, high = np.array([x, y, z]).T
    return box(high - low).at((low + high) / 2.0)


def _beam(
    start_m: ArrayLike, end_m: ArrayLike, normal: ArrayLike, width_m: float, depth_m: float
) -> shapes.Mesh:
    """A bar of rectangular section between two points; its depth is along ``normal``."""
    start, end = np.asarray(start_m, dtype=np.float64), np.asarray(end_m, dtype=np.float64)
    along = end - start
    x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    R = R_a_from_b_by_directions(unit(along), np.asarray(normal, dtype=np.float64), x, z)
    return box((float(np.linalg.norm(along)) + 0.6 * width_m, width_m, depth_m)).at(
        (start + end) / 2.0, R
    )


def _body(craft: Assembly) -> None:
    """The box: a core, and on each side the film that it is wrapped in."""
    x, thin = HALF_X, 0.001
    inner = thin / 2.0
    core = _cuboid((-x + inner, x - inner), (BACK + inner, FRONT - inner), (BOTTOM + inner, TOP))
    craft.add("bus", "foil_black", core)
    bottom = _cuboid((-x, x), (BACK, FRONT), (BOTTOM, BOTTOM + thin))
    craft.add("side_bottom", "film", bottom)
    z = (BOTTOM + thin, TOP)
    front = _cuboid((-x, x), (FRONT - thin, FRONT), z)
    craft.add("side_front", "film_creased", front)
    back = _cuboid((-x, x), (BACK, BACK + thin), z)
    craft.add("side_back", "film_matt", back)
    y = (BACK + thin, FRONT - thin)
    craft.add("side_left", "film_matt", _cuboid((-x, -x + thin), y, z))
    craft.add("side_right", "film_matt", _cuboid((x - thin, x), y, z))
    for name in ("B4", "B5", "B6", "B7"):
        craft.mark(name, "bus", KEYPOINTS_M[name])


def _panel(craft: Assembly) -> None:
    """The panel with its light edge, the layer of cells, and the film below it."""
    size = np.array([2.0 * HALF_X, 2.0 * PANEL_Y])
    core = _cuboid((-HALF_X, HALF_X), (-PANEL_Y, PANEL_Y), (TOP + 0.001, FACE - SHEET))
    craft.add("panel_core", "white_paint", core)
    sheet = _cuboid((-HALF_X, HALF_X), (-PANEL_Y, PANEL_Y), (FACE - SHEET, FACE))
    craft.add("solar_panel", "cells", sheet.textured(1.0 / size, (0.5, 0.5)))
    below = _cuboid((-HALF_X, HALF_X), (-PANEL_Y, PANEL_Y), (TOP, TOP + 0.001))
    craft.add("panel_back", "film", below)
    screws = [shapes.ring(0.005, 0.009, 0.002, 24).at((0.005, y, FACE - 0.001)) for y in (-0.036, 0.087)]
    craft.add("panel_screws", "grey_paint", *screws)
    for name in ("S0", "S1", "S2", "S3"):
        craft.mark(name, "solar_panel", KEYPOINTS_M[name])


def _antennas(craft: Assembly) -> None:
    """Three tapered antennas: two at the corners in front, in the panel's plane, and one at the back."""
    half = np.radians(30.0)
    for name, side in (("A8", -1.0), ("A9", 1.0)):
        tip = np.array(KEYPOINTS_M[name])
        along = np.array([side * np.cos(half), np.sin(half), 0.0])
        length, middle = 0.207, np.array([side * 0.3660, 0.3796, 0.2555])
        middle += along * ((tip - middle) @ along - length)
        profile = [(0, 0), (0.0424, 0), (0.0424, 0.015), (0.0288, length), (0, length)]
        craft.add(
            f"antenna_{name}", "antenna_paint", shapes.revolved(profile, 40).at(middle, R_from_z(along))
        )
        craft.mark(name, f"antenna_{name}", tip)
    tip = np.array(KEYPOINTS_M["A10"])
    root = np.array([0.3015, -0.300, 0.2480])
    reach = root[1] - tip[1]
    profile = [(0, 0), (0.0285, 0), (0.0285, 0.075), (0.0319, 0.075), (0.0319, 0.100), (0.0278, 0.160)]
    profile += [(0.0252, 0.240), (0.0248, reach), (0, reach)]
    rod = shapes.revolved(profile, 40).at(root, R_from_z((0.0, -1.0, 0.0)))
    craft.add("antenna_A10", "antenna_paint", rod)
    foot = _cuboid((0.28, 0.32), (root[1] - 0.005, BACK + 0.002), (0.227, 0.267))
    craft.add("antenna_foot", "film_matt", foot)
    craft.mark("A10", "antenna_A10", tip)


def _frame(
    nodes_m: Mapping[str, ArrayLike], bars: str, normal: ArrayLike, width_m: float, depth_m: float
) -> list[shapes.Mesh]:
    """A flat frame: a bar between each two nodes that follow each other in a word of ``bars``."""
    return [
        _beam(nodes_m[start], nodes_m[end], normal, width_m, depth_m)
        for word in bars.split()
        for start, end in itertools.pairwise(word)
    ]


def _side(sign: float) -> str:
    return "left" if sign < 0.0 else "right"


def _brackets(craft: Assembly) -> None:
    """Dark frames at the panel's corners, which hold it to the body and carry the antennas."""
    for name, x_side, y_side in (("S0", -1, -1), ("S1", -1, 1), ("S2", 1, 1), ("S3", 1, -1)):
        x = x_side * (HALF_X + 0.004)
        nodes = {
            "a": (x, y_side * 0.295, 0.290),
            "b": (x, y_side * 0.379, 0.290),
            "c": (x, y_side * 0.379, 0.248),
            "d": (x, y_side * 0.295, 0.216),
            "e": (x, y_side * 0.210, 0.252),
        }
        bars = _frame(nodes, "abcdaed bd", (float(x_side), 0.0, 0.0), 0.008, 0.010)
        if name != "S0":  # the others hold an antenna
            ends = [(x_side * 0.350, y_side * 0.345), (x_side * 0.379, y_side * 0.383)]
            low, high = np.sort(ends, axis=0)
            bars.append(_cuboid((low[0], high[0]), (low[1], high[1]), (0.212, 0.2945)))
        craft.add(f"bracket_{name}", "black_paint", *bars)


def _struts(craft: Assembly) -> None:
    """Dark frames around the body's lower corners, and feet in the middle of its sides."""
    up = (0.0, 0.0, 1.0)
    for x_side, y_side in itertools.product((-1.0, 1.0), (-1.0, 1.0)):
        x, y = x_side * (HALF_X + 0.004), (FRONT if y_side > 0 else BACK) + y_side * 0.004
        inward, z = y - y_side * 0.024, BOTTOM - 0.002
        across = {
            "a": (x, y, 0.181),
            "b": (x, y, 0.100),
            "c": (x_side * 0.284, y, 0.100),
            "d": (x_side * 0.284, y, 0.018),
            "e": (x_side * 0.192, y, 0.018),
        }
        corner = {
            "a": (x, y, 0.181),
            "b": (x, inward, 0.181),
            "c": (x, y, 0.1405),
            "d": (x, inward, 0.101),
            "e": (x, y, 0.101),
        }
        below = {
            "a": (x_side * 0.276, y, z),
            "b": (x_side * 0.276, inward, z),
            "c": (x_side * 0.234, y, z),
            "d": (x_side * 0.192, inward, z),
            "e": (x_side * 0.192, y, z),
        }
        craft.add(
            f"strut_{_side(x_side)}_{'front' if y_side > 0 else 'back'}",
            "black_paint",
            *_frame(across, "abc ae cde", (0.0, y_side, 0.0), 0.007, 0.010),
            *_frame(corner, "abcde", (x_side, 0.0, 0.0), 0.005, 0.010),
            *_frame(below, "abcde", up, 0.005, 0.010),
        )
    for x_side in (-1.0, 1.0):
        x, z = x_side * (HALF_X + 0.004), BOTTOM - 0.002
        upright = {
            "a": (x, -0.055, 0.018),
            "b": (x, -0.030, 0.068),
            "c": (x, 0.0, 0.020),
            "d": (x, 0.030, 0.068),
            "e": (x, 0.055, 0.018),
        }
        edge = x_side * (HALF_X - 0.048)
        below = {"a": (x, -0.055, z), "b": (edge, -0.030, z), "c": (edge, 0.030, z), "d": (x, 0.055, z)}
        craft.add(
            f"foot_{_side(x_side)}",
            "black_paint",
            *_frame(upright, "abcde bd ae", (x_side, 0.0, 0.0), 0.008, 0.012),
            *_frame(below, "abcda", up, 0.008, 0.010),
        )


def _fittings(craft: Assembly) -> None:
    """GPS antennas, rods and probes on both sides, and what is on the front and below."""
    for x_side, dome_y, rod_y, probe_y in ((-1.0, -0.085, 0.032, 0.102), (1.0, -0.120, 0.026, -0.050)):
        out, name = R_from_z((x_side, 0.0, 0.0)), _side(x_side)
        x = x_side * (HALF_X - 0.0005)
        dome = [(0, 0), (0.044, 0), (0.042, 0.008), (0.026, 0.015), (0, 0.018)]
        craft.add(
            f"gps_antenna_{name}", "white_paint", shapes.revolved(dome, 40).at((x, dome_y, 0.252), out)
        )
        profile = [(0, 0), (0.016, 0), (0.012, 0.006), (0.007, 0.010), (0.007, 0.028), (0.0025, 0.030)]
        rod = shapes.revolved([*profile, (0.0025, 0.130), (0, 0.130)], 20)
        craft.add(f"rod_{name}", "white_paint", rod.at((x, rod_y, 0.240), out))
        angle = np.linspace(-0.44 * np.pi, 0.5 * np.pi, 12)
        ball = 0.016 * np.column_stack([np.cos(angle), np.sin(angle)]) + (0.0, 0.042)
        mast = [(0, 0), (0.003, 0), (0.003, ball[0, 1]), *ball[:-1], (0, ball[-1, 1])]
        probe = shapes.revolved(mast, 24).at((x, probe_y, 0.255), out)
        craft.add(f"probe_{name}", "white_paint", probe)
    plate = _cuboid((-0.065, 0.180), (FRONT - 0.0005, FRONT + 0.013), (0.020, 0.172))
    step = _cuboid((-0.152, -0.065), (FRONT - 0.0005, FRONT + 0.009), (0.028, 0.141))
    craft.add("radiator", "black_paint", plate, step)
    tab = _cuboid((-0.040, 0.100), (FRONT - 0.0005, 0.400), (0.281, 0.2955))
    tongues = [_cuboid((-0.040, 0.010), (0.395, 0.458), (0.283, 0.306))]
    tongues.append(_cuboid((0.022, 0.088), (0.395, 0.430), (0.283, 0.306)))
    craft.add("tab", "white_paint", tab, *tongues)
    lug = shapes.joined(
        [
            shapes.ring(0.013, 0.022, 0.0105, 24).at((0.0, 0.0, BOTTOM - 0.0100)),
            _cuboid((-0.026, 0.026), (-0.040, -0.017), (BOTTOM - 0.0080, BOTTOM + 0.0005)),
            _cuboid((-0.028, -0.014), (0.023, 0.041), (0.0010, BOTTOM + 0.0005)),
            _cuboid((0.014, 0.028), (0.023, 0.041), (0.0010, BOTTOM + 0.0005)),
        ]
    )
    places = (((0.0, -0.216), 0.0), ((0.221, 0.159), 2.2), ((-0.221, 0.159), -2.2))
    lugs = [lug.at((*at, 0.0), R_about((0.0, 0.0, 1.0), turn)) for at, turn in places]
    craft.add("lugs", "black_paint", *lugs)


def _cells(seed: int) -> Material:
    """The panel's face, uv 0 … 1 over all of it: two groups of cells with two clipped corners each, and
    the light connectors between their rows."""
    rng = random_generator(seed, -1, "tango cells")
    x = np.arange(-HALF_X, HALF_X, 1.0 / TEXELS_PER_M)
    y = np.arange(PANEL_Y, -PANEL_Y, -1.0 / TEXELS_PER_M)[:, None]
    value = np.full((len(y), len(x)), 0.20)
    rough, metal = np.full(value.shape, 0.6), np.zeros(value.shape)
    row = np.floor((y - FIRST_Y) / PITCH_Y)
    up = y - FIRST_Y - PITCH_Y * (row + 0.5)  # from the middle of the cell
    for start, clipped in ((LEFT_X, 1.0), (RIGHT_X, -1.0)):
        column = np.floor((x - start) / PITCH_X)
        across = np.abs(x - start - PITCH_X * (column + 0.5))
        group = (column >= 0) & (column < COLUMNS) & (row >= 0) & (row < ROWS)
        cell = group & (across < 0.0408) & (np.abs(up) < 0.0210)
        cell &= (across - 0.0408) + (clipped * up - 0.0210) < -0.0125
        shade = rng.normal(1.0, 0.06, (ROWS, COLUMNS))
        picked = shade[
            np.clip(row, 0, ROWS - 1).astype(int), np.clip(column, 0, COLUMNS - 1).astype(int)
        ]
        value, rough = np.where(cell, 0.022 * picked, value), np.where(cell, 0.10, rough)
        seam = np.abs(np.abs(up) - PITCH_Y / 2.0) < 0.0009
        inner = (y > FIRST_Y + 0.01) & (y < FIRST_Y + ROWS * PITCH_Y - 0.01)
        line = group & inner & seam & (across < 0.0295)
        value, metal = np.where(line, 0.85, value), np.where(line, 0.5, metal)
    color = value[..., None] * np.where(value[..., None] < 0.1, (0.7, 0.9, 1.6), 1.0)
    return Material(
        "cells",
        roughness=1.0,
        base_color_texture=textures.srgb(color),
        metallic=1.0,
        metallic_roughness_texture=textures.byte(np.stack([metal, rough], axis=-1)),
    )
