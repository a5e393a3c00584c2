"""A spacecraft like Aqua (EOS PM-1), from its published dimensions.

Body axes: X is forward (towards AMSR-E), Z points to the nadir, and Y completes the right-handed system.
The solar wing extends along −Y. Deployed size 8.04 × 16.70 × 4.81 m, bus 6.49 m long (NASA EOS PM-1 fact
sheet; thesis, Table 3.2). Everything else is modelled by eye after NASA's photographs.
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
from posse_core._spacecraft.options import AquaOptions
from posse_core._spacecraft.parametric import Parametric
from posse_core._spacecraft.shapes import box

SIZE_M = (8.04, 16.70, 4.81)
"""Deployed size along X, Y, Z, m."""
CENTRE_OF_MASS_M = (-0.1, -0.9, 0.1)
"""In layout coordinates, from 2.6 t of bus and instruments about the origin and 0.33 t of wing 8 m
away."""

# Layout coordinates: body axes, with x = 0 at the centre of the 6.49 m bus and y = 0 in its symmetry
# plane.
AFT, WAIST, NOSE, FRONT = -3.25, -1.55, 2.0, 3.24  # ends of the aft module, the body, the front deck
HALF_WIDTH = 1.2
AFT_TOP, AFT_BOTTOM = -1.15, 1.0  # z; up is −z
TOP, BOTTOM = -0.8, 0.35
DECK_TOP, DECK_BOTTOM = -0.2, 0.05
SHIELD_EDGE = 1.75  # y of the outermost point opposite the wing
WING_AXIS = (-0.4, -0.25)  # x, z of the solar array drive
PANELS, PANEL_GAP, PANEL_THICKNESS = 11, 0.03, 0.03
WING_ROOT, WING_TIP = -3.5, SHIELD_EDGE - SIZE_M[1]  # y
DOWN = (0.0, 0.0, 1.0)


class Aqua(Parametric[AquaOptions]):
    """The scene source ``aqua``."""

    name = "aqua"
    centre_of_mass_m = CENTRE_OF_MASS_M
    skeleton = (
        *(("T1", "T2"), ("T2", "T3"), ("T3", "T4"), ("T4", "T1"), ("T5", "T6")),
        *(("B1", "B2"), ("B2", "B3"), ("B3", "B4"), ("B4", "B1"), ("B5", "B6")),
        *(("T1", "B1"), ("T2", "B2"), ("T3", "B3"), ("T4", "B4"), ("T5", "B5"), ("T6", "B6")),
        *(("S1", "S2"), ("S2", "S3"), ("S3", "S4"), ("S4", "S1"), ("A1", "A2")),
    )
    loose = (
        ("antenna_boom", "antenna_dish"),
        ("omni_top",),
        ("omni_bottom",),
        ("x_band_horn",),
        ("modis_door",),
        ("airs_shield",),
        ("star_tracker_1", "star_tracker_2"),
        ("electronics",),
        ("radiator_top",),
        ("amsr_calibrators",),
        ("ceres_aft", "ceres_aft_head"),
    )

    def assemble(self, craft: Assembly, lean: float) -> None:
        _bus(craft)
        _fittings(craft)
        _amsr(craft)
        _instruments(craft)
        _antennas(craft)
        angle_deg = self.options.panel_angle_deg + lean * self.options.variant_panel_angle_deg
        _wing(craft, np.radians(angle_deg))

    def finishes(self, seed: int) -> dict[str, Finish]:
        size_px = (1024, 512)
        panel = partial(textures.solar_panel, "solar_panel", (48, 12), size_px, seed, back=0.5)
        return {**common_finishes(seed), "solar_panel": panel}


def _cuboid(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> shapes.Mesh:
    low, high = np.array([x, y, z]).T
    return box(high - low).at((low + high) / 2.0)


def _edges(
    x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], width: float
) -> list[shapes.Mesh]:
    """Angle strips along the twelve edges of a box. They leave out the corners, where keypoints are."""
    sides = (x, y, z)
    strips = []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for at_a in sides[a]:
            for at_b in sides[b]:
                spans = [(0.0, 0.0)] * 3
                low, high = sides[axis]
                spans[axis] = (low + 1.1 * width, high - 1.1 * width)
                for k, at in ((a, at_a), (b, at_b)):
                    outward = 0.004 if at == sides[k][1] else -0.004
                    inward = width if at == sides[k][0] else -width
                    spans[k] = (min(at + outward, at + inward), max(at + outward, at + inward))
                strips.append(_cuboid(*spans))
    return strips


def _bus(craft: Assembly) -> None:
    """The body in three sections, with radiators, and keypoints at the corners."""
    w = HALF_WIDTH
    craft.add("bus_aft", "foil_amber", _cuboid((AFT, WAIST), (-w, w), (AFT_TOP, AFT_BOTTOM)))
    craft.add("bus", "foil_amber", _cuboid((WAIST, NOSE), (-w, w), (TOP, BOTTOM)))
    craft.add("front_deck", "foil_amber", _cuboid((NOSE, FRONT), (-w, w), (DECK_TOP, DECK_BOTTOM)))
    proud = 0.02
    plates = [(-3.05, -2.45, -0.95, 0.05), (-2.35, -1.75, -0.95, 0.05), (0.3, 0.95, -0.7, 0.2)]
    plates += [(1.1, 1.85, -0.7, 0.2)]
    for side, across in (("right", (w, w + proud)), ("left", (-w - proud, -w))):
        craft.add(
            f"radiator_{side}",
            "mirror_tiles" if side == "left" else "white_paint",
            *(_cuboid((x0, x1), across, (z0, z1)) for x0, x1, z0, z1 in plates),
        )
    top_plates = [(-1.3, -0.5), (-0.35, 0.45), (0.6, 1.4)]
    craft.add(
        "radiator_top",
        "white_paint",
        *(_cuboid(x, (-0.85, 0.85), (TOP - proud, TOP)) for x in top_plates),
    )
    strips = [
        *_edges((AFT, WAIST), (-w, w), (AFT_TOP, AFT_BOTTOM), 0.035),
        *_edges((WAIST, NOSE), (-w, w), (TOP, BOTTOM), 0.03),
    ]
    craft.add("bus_frame", "aluminium", *strips)
    seam = 0.012
    tapes = [
        _cuboid((x - 0.02, x + 0.02), (-w - seam, w + seam), (TOP - seam, BOTTOM + seam))
        for x in (-0.42, 0.52, 1.48)
    ]
    craft.add("bus_tapes", "foil_silver", *tapes)
    corners = {1: (AFT, -w), 2: (WAIST, -w), 3: (WAIST, w), 4: (AFT, w)}
    for number, (x, y) in corners.items():
        craft.mark(f"T{number}", "bus_aft", (x, y, AFT_TOP))
        craft.mark(f"B{number}", "bus_aft", (x, y, AFT_BOTTOM))
    for number, y in ((5, -w), (6, w)):
        craft.mark(f"T{number}", "bus", (NOSE, y, TOP))
        craft.mark(f"B{number}", "bus", (NOSE, y, BOTTOM))


def _fittings(craft: Assembly) -> None:
    """Adapter ring, thrusters, star trackers, sun sensors, struts, electronics boxes."""
    to_aft = R_from_z((-1.0, 0.0, 0.0))
    middle = (AFT, 0.0, (AFT_TOP + AFT_BOTTOM) / 2.0)
    craft.add("adapter_ring", "aluminium", shapes.ring(0.90, 0.97, 0.14, 64).at(middle, to_aft))
    craft.add("tank", "foil_black", shapes.frustum(0.55, 0.30, 0.10, 40).at(middle, to_aft))
    nozzles = []
    for y, z in ((0.62, 0.45), (-0.62, 0.45), (0.62, -0.45), (-0.62, -0.45)):
        position = np.add(middle, (0.0, y, z))
        nozzles.append(shapes.nozzle(0.03, 0.07, 0.16, 0.008, 24).at(position, to_aft))
    craft.add("thrusters", "titanium", *nozzles)
    struts = []
    for y in (-1.1, 1.1):
        for x in (NOSE + 0.15, FRONT - 0.1):
            struts.append(shapes.tube([(NOSE - 0.05, y, TOP + 0.15), (x, y, DECK_TOP)], 0.03))
    craft.add("deck_struts", "aluminium", *struts)
    for number, (y, lean) in enumerate(((0.45, 0.5), (-0.45, -0.5)), start=1):
        R = R_from_z((-0.5, lean, -1.0))
        position = (WAIST + 0.25, y, TOP - 0.02)
        bore = [(0, 0), (0.09, 0), (0.13, 0.36), (0.115, 0.36), (0.07, 0.05), (0, 0.05)]
        craft.add(f"star_tracker_{number}", "black_paint", shapes.revolved(bore, 28).at(position, R))
    boxes = [
        _cuboid((-1.35, -0.85), (1.2, 1.34), (-0.65, -0.1)),
        _cuboid((-0.7, -0.2), (1.2, 1.30), (-0.7, 0.0)),
        _cuboid((-0.1, 0.2), (1.2, 1.38), (-0.45, 0.1)),
        _cuboid((-1.35, -0.95), (-1.32, -1.2), (-0.6, 0.15)),
        _cuboid((-2.9, -2.5), (-1.30, -1.2), (0.2, 0.8)),
        _cuboid((-2.9, -2.2), (1.2, 1.28), (0.25, 0.85)),
    ]
    craft.add("electronics", "foil_silver", *boxes)


def _amsr(craft: Assembly) -> None:
    """AMSR-E: a 1.6 m offset reflector over a spinning drum, pointing 47.4° away from the nadir."""
    off_nadir = np.radians(47.4)
    boresight = np.array([np.sin(off_nadir), 0.0, np.cos(off_nadir)])
    feed = np.array([2.72, 0.0, DECK_TOP - 0.62])
    reach = 1.08  # from the feed, which is the paraboloid's focus, up to the aperture's centre
    focal, offset = reach * (1.0 + np.cos(off_nadir)) / 2.0, reach * np.sin(off_nadir)
    centre = feed - (0.0, 0.0, reach)
    R = R_from_z(boresight, (0.0, 0.0, -1.0))
    reflector = shapes.dish(1.6, focal, offset, thickness_m=0.035, rings=10, segments=64)
    craft.add("amsr_dish", "white_paint", reflector.at(centre, R))
    craft.add("amsr_backing", "black_paint", *_backing(focal, offset, centre, R))
    rim = reflector.at(centre, R).vertices_m[1 + 9 * 64 : 1 + 10 * 64]
    craft.mark("A1", "amsr_dish", rim[0])
    craft.mark("A2", "amsr_dish", rim[32])
    up = R_from_z((0.0, 0.0, -1.0))
    drum = (feed[0], 0.0, DECK_TOP)
    craft.add(
        "amsr_drum",
        "foil_silver",
        shapes.cylinder(0.50, 0.40, 48).at(drum, up),
        _cuboid((2.25, 2.75), (-0.42, 0.42), (-0.78, -0.6)),
    )
    horns = [
        shapes.nozzle(0.05, 0.09, 0.20, 0.01, 20).at((feed[0] + x, y, feed[2] + 0.08), up)
        for x, y in ((0.0, -0.2), (0.0, 0.0), (0.0, 0.2), (0.2, -0.1), (0.2, 0.1))
    ]
    craft.add("amsr_feeds", "aluminium", *horns)
    spread = rim[[6, 16, 27, 37, 48, 58]]
    feet = [(2.95, 0.4), (2.72, 0.48), (2.42, 0.38), (2.42, -0.38), (2.72, -0.48), (2.95, -0.4)]
    struts = [
        shapes.tube([(x, y, -0.58), point], 0.022) for (x, y), point in zip(feet, spread, strict=True)
    ]
    craft.add("amsr_struts", "black_paint", *struts)
    sky_mirror = shapes.dish(0.42, 0.3, thickness_m=0.015, rings=4, segments=28)
    craft.add(
        "amsr_calibrators",
        "white_paint",
        sky_mirror.at((3.05, -0.62, -0.62), R_from_z((0.3, 0.5, -1.0))),
        shapes.tube([(3.0, -0.55, DECK_TOP), (3.05, -0.62, -0.66)], 0.02),
        shapes.cylinder(0.17, 0.2, 28).at((3.0, 0.68, DECK_TOP), up),
    )


def _backing(focal_m: float, offset_m: float, centre_m: FloatArray, R: FloatArray) -> list[shapes.Mesh]:
    """The ring and the ribs that stiffen the reflector's back."""

    def behind(radius: float, angle: float) -> FloatArray:
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        z = ((x + offset_m) ** 2 + y**2 - offset_m**2) / (4.0 * focal_m)
        return np.asarray(R @ (x, y, z - 0.045) + centre_m)

    rods = []
    for k in range(24):
        a, b = (2.0 * np.pi * (k + step) / 24 for step in (0, 1))
        rods.append(shapes.tube([behind(0.45, a), behind(0.45, b)], 0.018, 8))
    for k in range(8):
        angle = 2.0 * np.pi * (k + 0.5) / 8
        rods.append(shapes.tube([behind(r, angle) for r in (0.05, 0.25, 0.45, 0.74)], 0.014, 8))
    return rods


def _instruments(craft: Assembly) -> None:
    """The Earth-observing instruments on the nadir side."""
    down = R_from_z(DOWN)

    def aperture(x: float, y: float, z: float, size: tuple[float, float, float]) -> shapes.Mesh:
        return shapes.hood(size, 0.02).at((x, y, z + size[2] / 2.0), down)

    craft.add("modis", "foil_silver", _cuboid((2.05, 3.15), (-0.75, 0.85), (DECK_BOTTOM, 1.1)))
    craft.add("modis_aperture", "black_paint", aperture(2.65, -0.1, 1.1, (0.7, 0.9, 0.10)))
    craft.add("modis_door", "white_paint", _flap((2.6, 0.85, 1.08), 1.0))
    craft.add("airs", "foil_silver", _cuboid((-0.95, 0.25), (-0.15, 0.95), (BOTTOM, 1.15)))
    craft.add("airs_aperture", "black_paint", aperture(-0.35, 0.3, 1.15, (0.55, 0.5, 0.16)))
    craft.add("airs_shield", "white_paint", _flap((-0.35, 0.95, 1.05), 1.1))
    for name, x, y, size in (
        ("amsu_a1", 1.25, -0.55, (0.72, 0.95, 0.42)),
        ("amsu_a2", 0.35, -0.80, (0.65, 0.55, 0.55)),
        ("hsb", 1.40, 0.60, (0.55, 0.70, 0.48)),
    ):
        body = box(size).at((x, y, BOTTOM + size[2] / 2.0))
        craft.add(name, "foil_gold", body)
        face = BOTTOM + size[2]
        r = 0.22 * size[1]
        bore = [(0, 0), (r, 0), (r, 0.12), (0.85 * r, 0.12), (0.85 * r, 0.01), (0, 0.01)]
        scan = shapes.revolved(bore, 32)
        craft.add(
            f"{name}_aperture",
            "black_paint",
            *(scan.at((x, y + offset, face), down) for offset in (-0.25 * size[1], 0.25 * size[1])),
        )
    for name, x, y in (("ceres_fore", -2.0, -0.5), ("ceres_aft", -2.85, 0.5)):
        pedestal = _cuboid((x - 0.27, x + 0.27), (y - 0.27, y + 0.27), (AFT_BOTTOM, 1.32))
        turret = shapes.cylinder(0.22, 0.2, 32).at((x, y, 1.32), down)
        craft.add(name, "foil_silver", pedestal, turret)
        head = box((0.40, 0.30, 0.26)).at((x, y, 1.64))
        barrel = shapes.ring(0.07, 0.10, 0.12, 24).at((x + 0.07, y, 1.77), down)
        craft.add(f"{name}_head", "white_paint", head, barrel)


def _flap(hinge_m: tuple[float, float, float], length_m: float) -> shapes.Mesh:
    """A radiant cooler's Earth shield: a plate from its hinge out to :data:`SHIELD_EDGE`."""
    x, y, z = hinge_m
    thickness, rise = 0.02, np.radians(28.0)
    # The lower outer corner of the plate is the outermost point.
    reach = (SHIELD_EDGE - y - 0.5 * thickness * np.sin(rise)) / np.cos(rise)
    plate = box((length_m, reach, thickness)).at((0.0, reach / 2.0, 0.0))
    return plate.at((x, y, z), R_about((1.0, 0.0, 0.0), rise))


def _antennas(craft: Assembly) -> None:
    """The antenna on its aft boom, omnidirectional antennas above and below, and the X-band horn."""
    front = craft.bounds_m[1, 0]
    radius, y, z = 0.28, 0.95, AFT_BOTTOM - 0.1
    tip = np.array([front - SIZE_M[0] + radius, y, z + 0.25])
    craft.add(
        "antenna_boom",
        "aluminium",
        shapes.tube([(AFT, y, z), np.subtract(tip, (0, 0, 0.03))], 0.025, 14),
    )
    plate = shapes.dish(2.0 * radius, 0.35, thickness_m=0.02, rings=5, segments=40)
    craft.add("antenna_dish", "white_paint", plate.at(tip, R_from_z(DOWN)))
    craft.mark("A3", "antenna_dish", tip)
    spike = shapes.revolved([(0, 0), (0.05, 0), (0.05, 0.12), (0.025, 0.14), (0, 0.42)], 24)
    craft.add("omni_top", "white_paint", spike.at((0.1, 0.0, TOP), R_from_z((0.0, 0.0, -1.0))))
    craft.mark("A4", "omni_top", (0.1, 0.0, TOP - 0.42))
    craft.add("omni_bottom", "white_paint", spike.at((0.75, 0.35, BOTTOM), R_from_z(DOWN)))
    horn = shapes.nozzle(0.06, 0.20, 0.28, 0.012, 32)
    craft.add("x_band_horn", "white_paint", horn.at((-1.3, -0.75, BOTTOM), R_from_z(DOWN)))


def _wing(craft: Assembly, angle_rad: float) -> None:
    """The solar wing: drive, yoke and eleven panels on a spine; at angle zero the cells face +X.

    The drive turns all but itself, by the joint ``wing``.
    """
    axis = np.array([0.0, 1.0, 0.0])
    turn = R_about(axis, angle_rad)
    x_axis, z_axis = WING_AXIS
    drive_end = np.array([x_axis, -HALF_WIDTH - 0.3, z_axis])
    facing = turn @ np.array([1.0, 0.0, 0.0])
    craft.hang(Joint("wing", "revolute", drive_end, axis, facing_body=facing))

    def turned(mesh: shapes.Mesh) -> shapes.Mesh:
        return mesh.at((x_axis, 0.0, z_axis), turn)

    def point(p: tuple[float, float, float]) -> FloatArray:
        return np.asarray(turn @ np.asarray(p) + (x_axis, 0.0, z_axis))

    outboard = R_from_z((0.0, -1.0, 0.0))
    drive = shapes.cylinder(0.2, 0.3, 32).at((x_axis, -HALF_WIDTH, z_axis), outboard)
    craft.add("array_drive", "aluminium", drive)
    half, t = SIZE_M[2] / 2.0, PANEL_THICKNESS
    neck, shoulder = -1.75, -2.6
    hips = 0.5 * half
    # The outline is in (z, y) of the yoke's plane, whose normal is x.
    outline = [(-0.25, neck), (0.25, neck), (hips, shoulder), (hips, WING_ROOT + PANEL_GAP)]
    outline += [(-hips, WING_ROOT + PANEL_GAP), (-hips, shoulder)]
    face = R_from_z((1.0, 0.0, 0.0), (0.0, 0.0, -1.0))  # y stays
    yoke = shapes.prism(np.array(outline)[::-1], t).at((0.0, 0.0, 0.0), face)
    shaft = shapes.tube([(0.0, -HALF_WIDTH - 0.3, 0.0), (0.0, neck, 0.0)], 0.07, 20)
    craft.add("yoke", "foil_amber", turned(yoke), turned(shaft), joint="wing")
    pitch = (WING_ROOT - WING_TIP) / PANELS
    sheet = shapes.panel(2.0 * half, pitch - PANEL_GAP, t)
    for number in range(PANELS):
        middle = WING_ROOT - pitch * (number + 0.5) - PANEL_GAP / 2.0
        panel = turned(sheet.at((0.0, middle, 0.0), face))
        craft.add(f"panel_{number + 1}", "solar_panel", panel, joint="wing")
    back = -t / 2.0
    ribs = [shapes.tube([(back - 0.03, neck, 0.0), (back - 0.03, WING_TIP + 0.1, 0.0)], 0.03, 8)]
    for number in range(PANELS):
        y = WING_ROOT - pitch * (number + 0.5)
        ribs.append(box((0.03, 0.04, 2.0 * half - 0.1)).at((back - 0.015, y, 0.0)))
    hinges = [
        box((0.035, 0.10, 0.12)).at((back, WING_ROOT - pitch * number, z))
        for number in range(PANELS)
        for z in ((-0.8, 0.8) if number == 0 else (-1.6, 0.0, 1.6))
    ]
    craft.add("wing_frame", "aluminium", *map(turned, (*ribs, *hinges)), joint="wing")
    inner = WING_ROOT - PANEL_GAP
    for number, (y, z, at) in enumerate(
        ((inner, -half, 1), (inner, half, 1), (WING_TIP, half, PANELS), (WING_TIP, -half, PANELS)),
        start=1,
    ):
        craft.mark(f"S{number}", f"panel_{at}", point((0.0, y, z)))
