"""What is on the bus of a spacecraft of the family: payload, propulsion, antennas, booms, radiators."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import FloatArray
from posse_core._frames import R_about
from posse_core._spacecraft import shapes
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.family.bus import Bus, Side, picked

_WHITE = ("white_paint", "white_paint", "grey_paint")
_BOXES = ("foil_silver", "foil_gold", "foil_black", "white_paint", "black_paint", "aluminium")
_BOOMS = ("aluminium", "black_paint", "white_paint")
PAYLOADS = ("dish", "telescope", "instruments", "horns", "panel")


@dataclass
class Fitter:
    """Adds fittings to a bus, and counts the keypoints on its antennas.

    Attributes:
        craft: what is built.
        bus: the bus.
        panel_reach_m: how far beyond the bus's sides along Y wings begin; infinite without wings there.
        slots: for the deck at each end, −1 and 1, the azimuths of places that are free, degrees.
    """

    craft: Assembly
    bus: Bus
    panel_reach_m: float
    slots: dict[int, list[int]] = field(default_factory=dict)
    _antennas: int = 0

    def mark_antenna(self, part: str, point_m: ArrayLike) -> None:
        """Add the next keypoint of the category A."""
        self._antennas += 1
        self.craft.mark(f"A{self._antennas}", part, point_m)

    def on_slot(self, mesh: shapes.Mesh, end: int) -> tuple[shapes.Mesh, FloatArray]:
        """A small fitting on the next free place of a deck, and (3,) that place."""
        azimuth = self.slots[end].pop()
        radius = 0.74 * self.bus.inscribed_m
        place = self.bus.place_on_deck(end, azimuth, radius)
        return self.bus.on_deck(mesh, end, azimuth, radius), place


def add_fittings(craft: Assembly, bus: Bus, panel_reach_m: float, rng: np.random.Generator) -> None:
    """Everything on the bus but its wings. Every spacecraft has an antenna."""
    slots = {end: [int(a) for a in 22.5 + 45.0 * rng.permutation(8)] for end in (-1, 1)}
    fitter = Fitter(craft, bus, panel_reach_m, slots)
    payload = picked(rng, PAYLOADS)
    _payload(fitter, payload, rng)
    _propulsion(fitter, rng)
    _omnis(fitter, payload, rng)
    _star_trackers(fitter, rng)
    ends = [end for end in (1.0, -1.0) if not any(abs(s.outward[0] - end) < 1e-6 for s in bus.winged)]
    for end in rng.permutation(ends):
        _on_end(fitter, float(end), payload, rng)
    for number, side in enumerate(bus.sides, start=1):
        _on_side(fitter, side, number, rng)


def _payload(fitter: Fitter, payload: str, rng: np.random.Generator) -> None:
    """What is at the middle of the deck at +Z."""
    bus, craft = fitter.bus, fitter.craft
    u, r = bus.unit_m, bus.inscribed_m
    if payload == "dish":
        diameter = float(rng.uniform(1.1, 2.2)) * r
        _dish(fitter, "main_dish", np.array([0.0, 0.0, bus.height_m / 2.0]), diameter, 0.3 * u, rng)
    elif payload == "telescope":
        radius, length = rng.uniform(0.3, 0.55) * r, rng.uniform(0.35, 0.9) * u
        wall = 0.06 * radius
        tube = [(0, 0), (radius, 0), (radius, length), (radius - wall, length)]
        tube += [(radius - wall, 0.1 * length), (0, 0.1 * length)]
        craft.add("telescope", picked(rng, _BOXES), bus.on_deck(shapes.revolved(tube, 40), 1, 0.0, 0.0))
        baffle = shapes.ring(radius - 2.2 * wall, radius - 0.5 * wall, 0.7 * length, 40)
        baffle = baffle.at((0.0, 0.0, 0.25 * length))
        craft.add("telescope_baffle", "black_paint", bus.on_deck(baffle, 1, 0.0, 0.0))
    elif payload == "instruments":
        for number, azimuth in enumerate((0.0, 90.0, 180.0, 270.0)[: int(rng.integers(2, 5))], start=1):
            size = rng.uniform((0.25, 0.25, 0.2), (0.4, 0.4, 0.7)) * (r, r, u)
            body = shapes.box(size).at((0.0, 0.0, size[2] / 2.0))
            name = f"instrument_{number}"
            craft.add(name, picked(rng, _BOXES), bus.on_deck(body, 1, azimuth, 0.43 * r))
            bore = [(0, -0.01), (0.24, -0.01), (0.28, 0.2), (0.24, 0.2), (0.18, 0.02), (0, 0.02)]
            scan = shapes.revolved(np.array(bore) * float(size[:2].min()), 28)
            scan = scan.at((0.0, 0.0, size[2]))
            craft.add(f"{name}_aperture", "black_paint", bus.on_deck(scan, 1, azimuth, 0.43 * r))
    elif payload == "horns":
        wide = 0.15 * r
        horns = []
        for azimuth, radius in ((0, 0), (0, 0.36 * r), (120, 0.36 * r), (240, 0.36 * r)):
            horn = shapes.nozzle(0.4 * wide, wide, rng.uniform(0.2, 0.4) * u, 0.12 * wide, 28)
            horns.append(bus.on_deck(horn, 1, azimuth, radius))
        craft.add("horns", picked(rng, _WHITE), *horns)
    else:
        side = 1.0 * r
        array = shapes.box((side, 0.8 * side, 0.09 * u))
        craft.add("array_antenna", picked(rng, _WHITE), bus.on_deck(array, 1, 0.0, 0.0))
        corner = (side / 2.0, 0.4 * side, bus.height_m / 2.0 + 0.035 * u)
        fitter.mark_antenna("array_antenna", corner)


def _dish(
    fitter: Fitter,
    name: str,
    foot_m: FloatArray,
    diameter_m: float,
    stand_m: float,
    rng: np.random.Generator,
) -> None:
    """A reflector towards +Z above a foot, with its feed on three struts and keypoints on its rim."""
    u, craft = fitter.bus.unit_m, fitter.craft
    focal = float(rng.uniform(0.35, 0.5)) * diameter_m
    vertex = np.add(foot_m, (0.0, 0.0, stand_m))
    reflector = shapes.dish(diameter_m, focal, 0.0, 0.012 * u, 8, 48).at(vertex)
    craft.add(name, picked(rng, _WHITE), reflector)
    post = shapes.tube([foot_m - (0, 0, 0.02 * u), vertex - (0, 0, 0.005 * u)], 0.035 * u, 16)
    hub = shapes.frustum(0.06 * u, 0.16 * diameter_m, 0.08 * u, 24).at(vertex - (0, 0, 0.085 * u))
    craft.add(f"{name}_mount", picked(rng, _BOOMS), post, hub)
    focus = np.add(vertex, (0.0, 0.0, focal))
    radius = 0.37 * diameter_m
    struts = []
    for azimuth in np.radians((90.0, 210.0, 330.0)):
        around = (np.cos(azimuth), np.sin(azimuth), radius / (4.0 * focal))
        on_dish = np.add(vertex, radius * np.array(around))
        struts.append(shapes.tube([on_dish, focus], 0.009 * u, 8))
    feed = shapes.frustum(0.05 * u, 0.03 * u, 0.1 * u, 20).at(focus - (0.0, 0.0, 0.05 * u))
    craft.add(f"{name}_feed", picked(rng, _BOOMS), feed, *struts)
    rim = reflector.vertices_m[1 + 7 * 48 : 1 + 8 * 48]
    fitter.mark_antenna(name, rim[0])
    fitter.mark_antenna(name, rim[24])


def _propulsion(fitter: Fitter, rng: np.random.Generator) -> None:
    """The adapter ring, an engine or a cover within it, and thrusters on the deck at −Z."""
    bus, craft = fitter.bus, fitter.craft
    u, r = bus.unit_m, bus.inscribed_m
    radius = float(rng.uniform(0.42, 0.58)) * r
    ring = shapes.ring(0.92 * radius, radius, 0.09 * u, 48)
    craft.add("adapter_ring", "aluminium", bus.on_deck(ring, -1, 0.0, 0.0))
    if rng.uniform() < 0.6:
        mouth = float(rng.uniform(0.35, 0.7)) * radius
        bell = shapes.nozzle(0.35 * mouth, mouth, 2.2 * mouth, 0.06 * mouth, 36)
        craft.add("engine", "titanium", bus.on_deck(bell, -1, 0.0, 0.0))
    else:
        cover = shapes.frustum(0.8 * radius, 0.5 * radius, 0.06 * u, 36)
        craft.add("engine_cover", "foil_black", bus.on_deck(cover, -1, 0.0, 0.0))
    jet = shapes.nozzle(0.018 * u, 0.04 * u, 0.09 * u, 0.006 * u, 20)
    count = int(picked(rng, (2, 4, 4)))
    craft.add("thrusters", "titanium", *(fitter.on_slot(jet, -1)[0] for _ in range(count)))


def _omnis(fitter: Fitter, payload: str, rng: np.random.Generator) -> None:
    """Omnidirectional antennas on both decks: spikes, or patches where a dish is above."""
    u = fitter.bus.unit_m
    for number, end in enumerate((-1, 1)[: int(rng.integers(1, 3))], start=1):
        name = f"omni_{number}"
        length = u * (0.1 if payload == "dish" and end == 1 else float(rng.uniform(0.15, 0.35)))
        wide = 0.035 * u
        spike = [(0, 0), (wide, 0), (wide, 0.3 * length)]
        spike += [(0.5 * wide, 0.4 * length), (0, length)]
        mesh, place = fitter.on_slot(shapes.revolved(spike, 20), end)
        fitter.craft.add(name, picked(rng, _WHITE), mesh)
        fitter.mark_antenna(name, np.add(place, (0.0, 0.0, end * length)))


def _star_trackers(fitter: Fitter, rng: np.random.Generator) -> None:
    """Up to two baffles on the deck at −Z, leaning outward."""
    u = fitter.bus.unit_m
    bore = np.array([(0, -0.2), (0.25, -0.2), (0.36, 1), (0.32, 1), (0.2, 0.1), (0, 0.1)]) * 0.16 * u
    for number in range(1, int(rng.integers(0, 3)) + 1):
        lean = R_about((1.0, 0.0, 0.0), float(rng.uniform(-0.5, 0.5)))
        mesh = shapes.revolved(bore, 24).at((0.0, 0.0, 0.02 * u), lean)
        placed, _ = fitter.on_slot(mesh, -1)
        fitter.craft.add(f"star_tracker_{number}", "black_paint", placed)


def _on_end(fitter: Fitter, end: float, payload: str, rng: np.random.Generator) -> None:
    """A dish on a boom or a magnetometer's boom towards +X (``end`` 1) or −X (−1), or neither."""
    bus, craft = fitter.bus, fitter.craft
    u, start = bus.unit_m, float(bus.half_m[0])
    names = craft.part_names
    what = picked(rng, ("dish", "magnetometer", "nothing"))
    if what == "dish" and payload != "dish":
        most = min(1.5 * u, 1.7 * (float(bus.half_m[1]) + fitter.panel_reach_m))
        diameter = float(rng.uniform(0.55, 1.0)) * most
        name = "dish_fore" if end > 0 else "dish_aft"
        z = float(rng.uniform(0.15, 0.35)) * bus.height_m
        foot = np.array([end * (start + 0.1 * u + diameter / 2.0), 0.0, z])
        path = [np.array([end * 0.9 * start, 0.0, z]), foot - (end * 0.03 * u, 0.0, 0.0)]
        craft.add(f"{name}_boom", picked(rng, _BOOMS), shapes.tube(path, 0.03 * u, 14))
        _dish(fitter, name, foot, diameter, 0.14 * u, rng)
    elif what == "magnetometer" and "magnetometer" not in names:
        length, z = u * float(rng.uniform(0.9, 2.6)), -float(rng.uniform(0.1, 0.4)) * bus.height_m
        tip = np.array([end * (start + length), 0.0, z])
        rod = shapes.tube([np.array([end * 0.9 * start, 0.0, z]), tip], 0.016 * u, 12)
        craft.add("magnetometer_boom", picked(rng, _BOOMS), rod)
        head = shapes.box((0.12 * u, 0.08 * u, 0.08 * u))
        second = tip - (end * 0.35 * length, 0.0, 0.0)
        craft.add("magnetometer", picked(rng, _BOXES), head.at(tip), head.at(second))
        fitter.mark_antenna("magnetometer", np.add(tip, (end * 0.06 * u, 0.0, 0.0)))


def _on_side(fitter: Fitter, side: Side, number: int, rng: np.random.Generator) -> None:
    """Radiators or boxes of electronics on a side, clear of a wing's drive and of cells."""
    bus, craft = fitter.bus, fitter.craft
    u, h, half = bus.unit_m, bus.height_m, 0.42 * side.width_m
    what = picked(rng, ("radiator", "radiator", "electronics", "nothing"))
    drum = 0.03 * u if bus.kind == "cylinder" else 0.0  # what a flat fitting on a drum is sunk
    if side not in bus.winged and bus.has_cells:
        return
    # A wing's axis is within 0.2 h of the middle, and its drive's radius is 0.075 u.
    clear = 0.2 * h + 0.1 * u if side in bus.winged else 0.02 * h
    if what == "radiator" and 0.44 * h - clear > 0.08 * u:
        rows = [(clear, 0.44 * h), (-0.44 * h, -clear)][: int(rng.integers(1, 3))]
        plates = [side.plate((-half, half), row, drum + 0.01 * u, 0.02 * u) for row in rows]
        craft.add(f"radiator_{number}", picked(rng, ("white_paint", "mirror_tiles")), *plates)
    elif what == "electronics" and 0.44 * h - clear > 0.08 * u:
        boxes = []
        for k, row in enumerate(((clear, 0.42 * h), (-0.42 * h, -clear))):
            y = sorted(float(v) for v in rng.uniform((-half, 0.2 * half), (-0.2 * half, half)))
            z = row[0] + (row[1] - row[0]) * float(rng.uniform(0.4, 0.9))
            boxes.append(side.plate((y[0], y[1]), (row[0], z), drum + 0.01 * u, (0.05 + 0.03 * k) * u))
        craft.add(f"electronics_{number}", picked(rng, _BOXES), *boxes)
