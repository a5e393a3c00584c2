"""What must hold between the labels and arrays of one frame, each proven from what did not make them.

A check yields one line for each thing that is wrong. It is asked only of frames that have the labels
that it compares (:class:`Check`). The checks of single bodies are in
:mod:`posse_core._evaluation.body_checks`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._dataset.files import has_alpha, read_image
from posse_core._dataset.layout import inside
from posse_core._errors import InputError
from posse_core._evaluation.body_case import BodyCase
from posse_core._evaluation.body_checks import (
    BODY_CHECKS,
    NORMAL_ERROR,
    OUTLINE_DISAGREEMENT_PX,
    OUTLINE_DISAGREEMENT_SHARE,
    outline_px,
)
from posse_core._evaluation.case import DEPTH_ERROR_M, POSE, Case
from posse_core._model.label_line import BodyLabels

LARGEST = 1e15
"""Largest number of a pose: what is as far has no image, and squares of some are infinite."""
COMPARED_PIXELS = 1 << 13
"""Pixels of a frame whose normals or flow are compared, evenly spread; fewer if it has fewer."""


@dataclass(frozen=True)
class Check:
    """A check by name; it applies to frames whose target has all of ``needs`` (not null) and whose
    truth file has all of ``arrays``."""

    name: str
    proves: str
    run: Callable[[Case], Iterator[str]]
    needs: tuple[str, ...] = ()
    arrays: tuple[str, ...] = ()

    def applies(self, case: Case) -> bool:
        """Whether the frame has what the check compares."""
        return case.has(*self.needs) and all(name in case.truth for name in self.arrays)


def _schema(case: Case) -> Iterator[str]:
    dataset, labels = case.dataset, case.labels
    if labels.spacecraft not in dataset.spacecraft_by_name:
        yield f"spacecraft: {labels.spacecraft!r} has no file in spacecraft/"
        return
    for name, beside in case.beside.items():
        if name not in dataset.bodies:
            yield f"bodies.{name}: has no file in bodies/{name}/"
            return
        known = dataset.bodies[name].name
        if not beside.has("spacecraft") or beside.spacecraft != known:
            yield f"bodies.{name}.spacecraft: is not {known!r}, whose files are in bodies/{name}/"
            return
        apart = _made(beside) ^ _made(labels)
        if apart:
            yield f"bodies.{name}: the target and it do not have the same labels: {min(apart)}"
            return
    for body in case.bodies:
        prefix = f"bodies.{body.name}." if body.number else ""
        for fault in _schema_of(body):
            yield f"{prefix}{fault}"
            return


def _made(labels: BodyLabels) -> set[str]:
    """The labels that annotators make of every body."""
    every = BodyLabels.model_fields.keys() - {"joints", "is_carried"}
    return {name for name in every if labels.has(name)}


def _schema_of(body: BodyCase) -> Iterator[str]:
    labels, craft = body.labels, body.craft
    for name in POSE:
        if labels.has(name) and not any(getattr(labels, name)):
            yield f"{name}: all of its numbers are 0"
        elif labels.has(name) and max(map(abs, getattr(labels, name))) > LARGEST:
            yield f"{name}: has a number beyond {LARGEST:.0e}"
    if labels.has("keypoints") and labels.keypoints.keys() != craft.keypoints_body_m.keys():
        yield f"keypoints: their names are not those of {body.where}.json"
    if labels.has("q_cam_from_body") and body.joints.keys() != {joint.name for joint in craft.joints}:
        yield f"joints: their names are not those of {body.where}.json"
    if body.mesh.part_id.min() < 0 or body.mesh.part_id.max() >= len(craft.parts):
        yield f"{body.where}.ply has triangles of a part that {craft.name}.json lacks"
    if labels.has("mask_rle"):
        try:
            shape = body.mask.shape
        except ValueError as error:
            yield f"mask_rle: {error}"
        else:
            if shape != (body.camera.height_px, body.camera.width_px):
                yield f"mask_rle: it is {shape[1]} x {shape[0]} pixels, not the camera's size"


def _files(case: Case) -> Iterator[str]:
    try:
        path = inside(case.dataset.folder, case.labels.image)
        image = read_image(path)
        if has_alpha(path):
            yield "the image has an alpha channel"
        if image.shape[:2] != (case.camera.height_px, case.camera.width_px):
            yield f"the image is {image.shape[1]} x {image.shape[0]} pixels, not the camera's size"
        arrays = case.arrays
    except InputError as error:
        yield str(error)
        return
    for name, array in arrays.items():
        fault = case.array_fault(name, array)
        if fault is not None:
            yield fault


def _parts(case: Case) -> Iterator[str]:
    part_id = case.truth["part_id"]
    if not np.array_equal(part_id >= 0, case.covered):
        yield f"part_id and the mask differ in {int(((part_id >= 0) != case.covered).sum())} pixels"
    if part_id.max() >= len(case.parts):
        yield f"part_id has {part_id.max()}, and the scene has {len(case.parts)} parts"
        return
    counts = np.bincount(part_id[part_id >= 0], minlength=len(case.parts))
    owners = np.append(case.body_of_part, -1)[part_id]
    for body in case.bodies:
        which = f"{body.name}: " if body.number else ""
        own = counts[case.body_of_part == body.number].tolist()
        areas = body.labels.part_area_px if body.has("part_area_px") else None
        for name, count in zip(body.craft.parts, own, strict=True):
            if areas is not None and areas.get(name, 0) != count:
                said = areas.get(name, 0)
                yield f"{which}part_area_px of {name} is {said}, part_id has {count} pixels of it"
        off = int(((owners == body.number) != body.mask).sum())
        if off and len(case.bodies) > 1:
            yield f"{which}its mask and part_id differ in {off} pixels"
    if len(case.bodies) > 1 and not np.array_equal(case.truth.get("body_id", np.zeros(0)), owners):
        yield "body_id is not there, or not the body of each pixel's part_id"
    if case.has(*POSE):
        yield from _parts_of_the_mesh(case, part_id.astype(np.int64))


def _parts_of_the_mesh(case: Case, part_id: IntArray) -> Iterator[str]:
    """Where faces of two parts coincide, a pixel may show either."""
    wrong = (part_id != case.part_seen) & (part_id >= 0) & (case.part_seen >= 0)
    if wrong.sum() <= OUTLINE_DISAGREEMENT_PX:
        return
    for part in np.unique(part_id[wrong]):
        here = wrong & (part_id == part)
        depth_m = case.depth_of_part(part)[here]
        wrong[here] = np.abs(depth_m - case.hits.depth_m[here]) > case.depth_error_m[here]
    if wrong.sum() > OUTLINE_DISAGREEMENT_PX + OUTLINE_DISAGREEMENT_SHARE * outline_px(case.covered):
        pairs = np.stack([part_id[wrong], case.part_seen[wrong]])
        (said, shown), counts = np.unique(pairs, axis=1, return_counts=True)
        most = int(counts.argmax())
        yield (
            f"part_id is not the mesh's part in {int(wrong.sum())} pixels: most are of"
            f" {case.parts[shown[most]]}, and it says {case.parts[said[most]]}"
        )


def _depth(case: Case) -> Iterator[str]:
    depth_m, mesh_m = case.truth["depth_m"].astype(np.float64), case.hits.depth_m
    there = np.isfinite(depth_m)
    if not np.array_equal(there, case.covered):
        yield f"depth_m and the mask differ in {int((there != case.covered).sum())} pixels"
    both = there & np.isfinite(mesh_m)
    if not both.any():
        return
    wrong = int((np.abs(depth_m - mesh_m)[both] > case.depth_error_m[both]).sum())
    if wrong > OUTLINE_DISAGREEMENT_PX + OUTLINE_DISAGREEMENT_SHARE * outline_px(both):
        scale = float(np.median(depth_m[both] / mesh_m[both]))
        yield f"depth_m is off the mesh in {wrong} of {both.sum()} pixels (median ratio {scale:.4g})"


def _normals(case: Case) -> Iterator[str]:
    normal = case.truth["normal_cam"].astype(np.float64)
    seen = np.asarray(np.isfinite(normal).all(axis=-1))
    if not np.array_equal(seen, case.covered):
        yield f"normal_cam and the mask differ in {int((seen != case.covered).sum())} pixels"
    v, u = np.nonzero(seen)
    rays = case.camera.rays(np.stack([u, v], axis=-1))
    if np.any(np.abs(np.linalg.norm(normal[seen], axis=-1) - 1) > NORMAL_ERROR):
        yield "normal_cam has normals that are not of length 1"
    elif np.any(np.sum(normal[seen] * rays, axis=-1) > NORMAL_ERROR * np.linalg.norm(rays, axis=-1)):
        yield "normal_cam has normals that point away from the camera"
    elif case.has(*POSE):
        yield from _normals_of_the_mesh(case, normal, seen)


def _normals_of_the_mesh(case: Case, normal: FloatArray, seen: BoolArray) -> Iterator[str]:
    row, column = np.nonzero(seen & (case.hits.face >= 0))
    chosen = slice(None, None, max(1, -(-len(row) // COMPARED_PIXELS)))
    row, column = row[chosen], column[chosen]
    expected = case.normals_of_faces(case.hits.face[row, column], row)
    off = np.linalg.norm(np.cross(expected, normal[row, column]), axis=1)
    is_off = off > NORMAL_ERROR + case.turn_by_step_rad[row, column]
    wrong = int(is_off.sum())
    if wrong > OUTLINE_DISAGREEMENT_PX + OUTLINE_DISAGREEMENT_SHARE * outline_px(seen):
        typical_deg = np.degrees(np.arcsin(np.minimum(np.median(off[is_off]), 1)))
        yield f"normal_cam is not the mesh's in {wrong} of {len(row)} pixels ({typical_deg:.3g}° off)"


def _albedo(case: Case) -> Iterator[str]:
    color = case.truth["base_color_rgb"]
    seen = np.isfinite(color).all(axis=-1)
    if not np.array_equal(seen, case.covered):
        yield f"base_color_rgb and the mask differ in {int((seen != case.covered).sum())} pixels"
    outside = int(((color < 0) | (color > 1)).any(axis=-1).sum())
    if outside:
        yield f"base_color_rgb is not within 0 and 1 in {outside} pixels"


SCHEMA = Check("schema", "every label is there, of its type and in its range", _schema)
CHECKS = (
    Check("files", "image and arrays can be read and are of the camera's size", _files),
    *BODY_CHECKS,
    Check(
        "parts",
        "part ids fill the masks, are the mesh's by the pose, and are counted right",
        _parts,
        ("mask_rle",),
        ("part_id",),
    ),
    Check(
        "depth",
        f"depth is the mesh's by the pose, {DEPTH_ERROR_M * 1e3:.0f} mm",
        _depth,
        ("mask_rle", *POSE),
        ("depth_m",),
    ),
    Check(
        "normals",
        "normals of length 1, towards the camera, the mesh's by the pose",
        _normals,
        ("mask_rle",),
        ("normal_cam",),
    ),
    Check(
        "albedo", "base colour on the mask, within 0 and 1", _albedo, ("mask_rle",), ("base_color_rgb",)
    ),
)
"""Checks of a frame whose schema is right."""
