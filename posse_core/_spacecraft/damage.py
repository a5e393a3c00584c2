"""Damage to a finished spacecraft: lost, torn and bent parts. Keypoints on what is gone are dropped."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

from posse_core._arrays import FloatArray
from posse_core._frames import R_about, R_from_z, unit
from posse_core._model.spacecraft import Part, Spacecraft
from posse_core._randomness import random_generator
from posse_core._scenario.damage import DamageConfig
from posse_core._spacecraft.contacts import Contacts, area_m2
from posse_core._spacecraft.tearing import torn

FLATNESS = 0.1
"""A part is flat if it is thinner than this share of its width."""
LEAST_BEND_RAD, MOST_BEND_RAD = np.radians(10.0), np.radians(45.0)
_OFF_SURFACE_SHARE = 1e-6
"""How much farther from its part a keypoint may be than before, as a share of the size, to be on it."""


def damaged(spacecraft: Spacecraft, damage: DamageConfig, seed: int) -> Spacecraft:
    """A spacecraft with random damage; with all its numbers zero, the spacecraft itself.

    Parts are lost first, then torn, the larger ones more often, then bent. Its symmetries are gone.

    Args:
        spacecraft: whole.
        damage: how much.
        seed: of the run, for a damage without its own.
    """
    if damage.missing_parts == damage.torn_parts == damage.bent_parts == 0:
        return spacecraft
    seed = seed if damage.seed is None else damage.seed
    size_m = float(np.ptp(spacecraft.bounds_body_m, axis=0).max())
    carriers = {name: _nearest(spacecraft.parts, x) for name, x in spacecraft.keypoints_body_m.items()}
    contacts = Contacts(spacecraft.parts, size_m)
    parts = dict(enumerate(spacecraft.parts))
    rng = random_generator(seed, -1, "damage: missing parts")
    others = [k for k in rng.permutation(len(parts)).tolist() if k != contacts.main]
    lost = contacts.fallen_without(others[: damage.missing_parts])
    parts = {k: part for k, part in parts.items() if k not in lost}

    rng = random_generator(seed, -1, "damage: torn parts")
    keys, area = list(parts), np.array([area_m2(part).sum() for part in parts.values()])
    chosen = rng.choice(keys, min(damage.torn_parts, len(keys)), replace=False, p=area / area.sum())
    for k in chosen.tolist():
        parts[k] = torn(parts[k], rng)
    points = {
        name: x
        for name, x in spacecraft.keypoints_body_m.items()
        if carriers[name] in parts
        and _distance_m(parts[carriers[name]], x)
        <= _distance_m(spacecraft.parts[carriers[name]], x) + _OFF_SURFACE_SHARE * size_m
    }
    craft = replace(
        spacecraft,
        parts=tuple(parts.values()),
        materials={
            name: material
            for name, material in spacecraft.materials.items()
            if name in {part.material for part in parts.values()}
        },
        keypoints_body_m=points,
        keypoint_joints={n: joint for n, joint in spacecraft.keypoint_joints.items() if n in points},
        skeleton=tuple(pair for pair in spacecraft.skeleton if set(pair) <= set(points)),
        symmetries=(),
    )
    numbers = {k: number for number, k in enumerate(parts)}
    rng = random_generator(seed, -1, "damage: bent parts")
    main = spacecraft.parts[contacts.main]
    flat = [k for k in parts if k != contacts.main and _can_bend(parts[k], main)]
    for k in rng.permutation(flat)[: damage.bent_parts].tolist():
        hanging = contacts.fallen_without({*lost, k}) - lost
        moved = {numbers[each] for each in hanging}
        carried = {name for name in points if numbers[carriers[name]] in moved}
        craft = _bent(craft, numbers[k], moved, carried, rng)
    return craft


def _bent(
    craft: Spacecraft,
    number: int,
    moved: Collection[int],
    keypoints: Collection[str],
    rng: np.random.Generator,
) -> Spacecraft:
    """Turn parts and keypoints about that edge of part ``number`` which is nearest to the origin.

    Joints all of whose parts are turned are turned too.
    """
    middle, R, half_m = _box(craft.parts[number])
    edges = [(sign * half_m[k] * R[:, k], R[:, 1 - k]) for k in (0, 1) for sign in (-1.0, 1.0)]
    out, axis = min(edges, key=lambda edge: float(np.linalg.norm(middle + edge[0])))
    pivot = middle + out
    angle = float(rng.uniform(LEAST_BEND_RAD, MOST_BEND_RAD)) * (1.0 if rng.uniform() < 0.5 else -1.0)
    turn = R_about(axis, angle)

    def turned(x_m: FloatArray) -> FloatArray:
        return np.asarray((x_m - pivot) @ turn.T + pivot)

    parts = tuple(
        replace(
            part,
            vertices_body_m=turned(part.vertices_body_m),
            normals_body=(part.normals_body @ turn.T).astype(np.float32),
        )
        if k in moved
        else part
        for k, part in enumerate(craft.parts)
    )
    staying = {part.joint for k, part in enumerate(craft.parts) if k not in moved}
    joints = tuple(
        joint
        if joint.name in staying or all(part.joint != joint.name for part in parts)
        else replace(
            joint,
            origin_body_m=turned(joint.origin_body_m),
            axis_body=turn @ joint.axis_body,
            facing_body=None if joint.facing_body is None else turn @ joint.facing_body,
        )
        for joint in craft.joints
    )
    points = {n: turned(x) if n in keypoints else x for n, x in craft.keypoints_body_m.items()}
    return replace(craft, parts=parts, joints=joints, keypoints_body_m=points)


def _box(part: Part) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The box around a part that lies along its largest triangle and has the least area there.

    Returns:
        (3,) its middle, (3, 3) its axes as columns, the last one across it, and (3,) half sides, m.
    """
    x, largest = part.vertices_body_m, int(area_m2(part).argmax())
    a, b, c = x[part.faces[largest]]
    across = R_from_z(unit(np.cross(b - a, c - a)))
    flat = x @ across
    outline = flat[ConvexHull(flat[:, :2], qhull_options="QJ").vertices, :2]
    best, least_m2 = 0.0, np.inf
    for along in np.roll(outline, -1, axis=0) - outline:
        angle = float(np.arctan2(along[1], along[0]))
        sides = np.ptp(outline @ R_about((0.0, 0.0, 1.0), angle)[:2, :2], axis=0)
        if sides[0] * sides[1] < 0.999 * least_m2:
            best, least_m2 = angle, float(sides[0] * sides[1])
    R = across @ R_about((0.0, 0.0, 1.0), best)
    low, high = (x @ R).min(axis=0), (x @ R).max(axis=0)
    return R @ ((low + high) / 2.0), R, (high - low) / 2.0


def _can_bend(part: Part, main: Part) -> bool:
    """Whether a part is flat and outside of the box around the main part, not a slab through it."""
    middle, _, half_m = _box(part)
    low, high = main.vertices_body_m.min(axis=0), main.vertices_body_m.max(axis=0)
    margin = 1e-6 * float((high - low).max())
    outside = np.any((middle < low - margin) | (middle > high + margin))
    return bool(half_m[2] < FLATNESS * min(half_m[:2]) and outside)


def _nearest(parts: tuple[Part, ...], x_m: FloatArray) -> int:
    """Index of the part whose surface is nearest to a point (3,)."""
    return int(np.argmin([_distance_m(part, x_m) for part in parts]))


def _distance_m(part: Part, x_m: FloatArray) -> float:
    """Distance of a point (3,) from a part's surface."""
    a, b, c = np.moveaxis(part.vertices_body_m[part.faces] - x_m, 1, 0)
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.sum(normal * normal, axis=1), np.finfo(float).tiny)
    height = np.sum(a * normal, axis=1) / np.sqrt(square)
    inside, nearest = np.ones(len(a), dtype=bool), np.inf
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        inside &= np.sum(np.cross(start, along) * normal, axis=1) >= 0.0
        length2 = np.maximum(np.sum(along * along, axis=1), np.finfo(float).tiny)
        t = np.clip(-np.sum(start * along, axis=1) / length2, 0.0, 1.0)
        nearest = min(nearest, float(np.linalg.norm(start + t[:, None] * along, axis=1).min()))
    return min(nearest, float(np.abs(height[inside]).min(initial=np.inf)))
