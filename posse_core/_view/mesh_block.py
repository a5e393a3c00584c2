"""The mesh of a spacecraft, with its keypoints, as a page carries it."""

from __future__ import annotations

from typing import Any

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._model.srgb import linear_from_srgb, srgb_from_linear
from posse_core._spacecraft.proposals import category_of
from posse_core._view.coding import text


def mesh_block(craft: Spacecraft) -> dict[str, Any]:
    """JSON value for ``meshview.js``; positions are in metres, body axes, with every joint at zero.

    ``vertices_m`` and ``faces``: base64 of float64 and uint32, three each; a position occurs once in
    each part. ``parts``: how many of them each part has, in order, its mean colour in sRGB, the joint
    that carries it, and the category of its keypoints if its name tells one.
    """
    merged = [_merged(part) for part in craft.parts]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in merged)])
    vertices_m = np.concatenate([vertices for vertices, _ in merged])
    faces = np.concatenate([faces + start for (_, faces), start in zip(merged, first, strict=False)])
    low, high = craft.bounds_body_m
    return {
        "name": craft.name,
        "size_m": float((high - low).max()),
        "middle_m": ((low + high) / 2).tolist(),
        "vertices_m": text(vertices_m.astype("<f8")),
        "faces": text(faces.astype("<u4")),
        "parts": [
            {
                "name": part.name,
                "vertices": len(vertices),
                "triangles": len(part.faces),
                "colour": _colour(craft.materials[part.material]),
                "joint": part.joint,
                "category": category_of(part),
            }
            for part, (vertices, _) in zip(craft.parts, merged, strict=True)
        ],
        "keypoints": [
            {
                "name": name,
                "at": point.tolist(),
                "joint": craft.keypoint_joints.get(name),
                "part": _part_at(point, vertices_m, first),
            }
            for name, point in craft.keypoints_body_m.items()
        ],
        "skeleton": [list(pair) for pair in craft.skeleton],
        "symmetries": [R.tolist() for R in craft.symmetries],
    }


def _merged(part: Part) -> tuple[FloatArray, IntArray]:
    """(V, 3) different positions of a part's vertices, and the (T, 3) triangles between them."""
    vertices_m, position = np.unique(part.vertices_body_m, axis=0, return_inverse=True)
    return vertices_m, position.reshape(-1)[part.faces]


def _part_at(point_m: FloatArray, vertices_m: FloatArray, first: IntArray) -> int:
    """Index of the part of which a vertex is at a position, up to what a file's rounding moves it; −1
    for none."""
    at = np.flatnonzero(np.abs(vertices_m - point_m).max(axis=1) < 1e-6)
    return int(np.searchsorted(first, at[0], side="right")) - 1 if len(at) else -1


def _colour(material: Material) -> list[int]:
    """The mean of the base colour, sRGB, 0 … 255."""
    linear = np.array(material.base_color)
    if material.base_color_texture is not None:
        linear = linear * linear_from_srgb(material.base_color_texture / 255.0).mean(axis=(0, 1))
    return [round(255 * share) for share in srgb_from_linear(np.clip(linear, 0.0, 1.0)).tolist()]
