"""What must hold between the labels of one frame, each proven from what did not make them.

A check yields one line for each thing that is wrong. It is asked only of frames that have the labels
that it compares (:class:`Check`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import BoolArray, FloatArray
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import inside
from posse_core._errors import InputError
from posse_core._evaluation.case import Case
from posse_core._evaluation.raster import RayMeeting, extent_px
from posse_core._model.labels import NOT_IN_FRAME, VISIBLE

REPROJECTION_ERROR_PX = 0.01
"""How far a labelled keypoint or box may lie from its projection."""
UNIT_LENGTH_ERROR = 1e-6
"""How far from 1 the length of a quaternion or of a direction may be."""
RANGE_ERROR_SHARE = 1e-6
"""How far a labelled range may lie from the distance by the pose, over that distance."""
PHASE_ANGLE_ERROR_RAD = 1e-6
NORMAL_ERROR = 1e-5
"""How far from 1 a normal's length may be, and the cosine of its angle to the ray above 0, since the
files hold single precision."""
DEPTH_ERROR_M, DEPTH_ERROR_SHARE = 1e-3, 1e-5
"""How far a depth may lie from the mesh: so much, and that share of itself for single precision."""
OUTLINE_DISAGREEMENT_SHARE = 0.01
"""Share of an outline's pixels that mask and mesh, or depth and mesh, may disagree in: edges that two
programs round differently. A mask that is one pixel off disagrees in more than half."""
OUTLINE_DISAGREEMENT_PX = 4
"""The same for the smallest outlines."""
SEEN_KEYPOINT_DEPTH_SHARE, HIDDEN_KEYPOINT_DEPTH_SHARE = 0.02, 1e-6
"""How far, over the craft's size, the mesh may stand in front of a keypoint that is seen; and how far it
must stand in front of one that is hidden."""


@dataclass(frozen=True)
class Check:
    """A check by name; it applies to frames whose labels have all of ``needs`` (not null) and whose
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
    labels = case.labels
    no_length = [
        name
        for name in ("q_cam_from_body", "t_body_cam_m")
        if labels.has(name) and not any(getattr(labels, name))
    ]
    if no_length:
        yield f"{no_length[0]}: all of its numbers are 0"
    elif labels.spacecraft not in case.dataset.spacecraft_by_name:
        yield f"spacecraft: {labels.spacecraft!r} has no file in spacecraft/"
    elif labels.has("keypoints") and labels.keypoints.keys() != case.craft.keypoints_body_m.keys():
        yield f"keypoints: their names are not those of spacecraft/{case.craft.name}.json"
    elif labels.has("mask_rle"):
        try:
            shape = case.mask.shape
        except ValueError as error:
            yield f"mask_rle: {error}"
        else:
            if shape != (case.camera.height_px, case.camera.width_px):
                yield f"mask_rle: it is {shape[1]} x {shape[0]} pixels, not the camera's size"


def _files(case: Case) -> Iterator[str]:
    try:
        image = read_image(inside(case.dataset.folder, case.labels.image))
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


def _pose(case: Case) -> Iterator[str]:
    q, t_m = np.array(case.labels.q_cam_from_body), np.array(case.labels.t_body_cam_m)
    if abs(np.linalg.norm(q) - 1) > UNIT_LENGTH_ERROR:
        yield f"the quaternion's length is {np.linalg.norm(q):.6f}, not 1"
    elif q[0] < 0:
        yield "the quaternion's scalar part is negative; the other sign is to be written"
    range_m = np.linalg.norm(t_m)
    if case.has("range_m") and abs(case.labels.range_m - range_m) > RANGE_ERROR_SHARE * range_m:
        yield f"range_m is {case.labels.range_m:.6g}, the position's length is {range_m:.6g}"


def _sun(case: Case) -> Iterator[str]:
    sun = np.array(case.labels.sun_direction_body)
    if abs(np.linalg.norm(sun) - 1) > UNIT_LENGTH_ERROR:
        yield f"the Sun's direction has length {np.linalg.norm(sun):.6f}, not 1"
        return
    to_camera = -frames.unit(np.array(case.labels.t_body_cam_m))
    sun_cam = case.R_cam_from_body @ sun
    angle = np.arctan2(np.linalg.norm(np.cross(sun_cam, to_camera)), sun_cam @ to_camera)
    if abs(angle - case.labels.phase_angle_rad) > PHASE_ANGLE_ERROR_RAD:
        yield f"phase_angle_rad is {case.labels.phase_angle_rad:.6f}, by pose and Sun {angle:.6f}"


def _keypoints(case: Case) -> Iterator[str]:
    uv, visibility = case.keypoints
    expected = case.camera.project(case.keypoints_cam_m)
    off = _apart(uv, expected)
    if off.size and off.max() > REPROJECTION_ERROR_PX:
        name = list(case.craft.keypoints_body_m)[int(off.argmax())]
        shown = "behind the camera" if np.isinf(off.max()) else f"{off.max():.2f} px off"
        yield f"{name} is {shown} where the pose puts it{_likely_cause(case, uv)}"
    size = np.array([case.camera.width_px, case.camera.height_px])
    inside = np.all((uv >= -0.5) & (uv < size - 0.5), axis=1)
    for i in np.flatnonzero(inside != (visibility != NOT_IN_FRAME)):
        name = list(case.craft.keypoints_body_m)[int(i)]
        where = "in" if inside[i] else "outside"
        yield f"{name} is {where} the image, and its visibility is {visibility[i]}"


def _apart(a: FloatArray, b: FloatArray) -> FloatArray:
    """(K,) distance of points; 0 where both are NaN, infinite where one is."""
    apart = np.linalg.norm(a - b, axis=1)
    gone = np.isnan(a).any(axis=1), np.isnan(b).any(axis=1)
    apart = np.where(gone[0] != gone[1], np.inf, apart)
    return np.where(gone[0] & gone[1], 0.0, apart)


def _likely_cause(case: Case, uv: FloatArray) -> str:
    """What would explain keypoints that do not meet the pose, or nothing."""
    w, x, y, z = case.labels.q_cam_from_body
    rotations = {
        "the quaternion is scalar-last": (z, w, x, y),
        "the rotation is from the camera to the body": (w, -x, -y, -z),
    }
    for cause, q in rotations.items():
        R = frames.matrix_from_quaternion(np.array(q))
        if _meets(uv, case.camera.project(case.in_camera(case.points_body_m, R))):
            return f": {cause}"
    expected = case.camera.project(case.keypoints_cam_m)
    mirrored_x = np.stack([case.camera.width_px - 1 - expected[:, 0], expected[:, 1]], axis=1)
    mirrored_y = np.stack([expected[:, 0], case.camera.height_px - 1 - expected[:, 1]], axis=1)
    if _meets(uv, mirrored_x):
        return ": x is mirrored"
    if _meets(uv, mirrored_y):
        return ": y is mirrored"
    if np.isfinite(uv - expected).any():
        shift = np.nanmedian(uv - expected, axis=0)
        if _meets(uv, expected + shift):
            return f": all are shifted by ({shift[0]:.2f}, {shift[1]:.2f}) px"
    return ""


def _meets(uv: FloatArray, expected: FloatArray) -> bool:
    return bool(_apart(uv, expected).max() <= REPROJECTION_ERROR_PX)


def _visibility(case: Case) -> Iterator[str]:
    visibility = case.keypoints[1]
    names = list(case.craft.keypoints_body_m)
    after_s = case.seen_by_rows(case.points_body_m)[1]
    moment_s, rays = np.nan, None
    for i in np.flatnonzero(visibility != NOT_IN_FRAME):
        point = case.keypoints_cam_m[i]
        if after_s[i] != moment_s or rays is None:
            moment_s = after_s[i]
            vertices = case.in_camera(case.mesh.vertices_body_m, after_s=moment_s)
            rays = RayMeeting(vertices[case.mesh.faces])
        before_m = point[2] - rays.depth_m(point / point[2])
        if visibility[i] == VISIBLE and before_m > SEEN_KEYPOINT_DEPTH_SHARE * case.size_m:
            yield f"{names[i]} is labelled seen, and the mesh is {before_m:.3g} m before it"
        if visibility[i] != VISIBLE and before_m < HIDDEN_KEYPOINT_DEPTH_SHARE * case.size_m:
            yield f"{names[i]} is labelled hidden, and nothing is before it"


def _box(case: Case) -> Iterator[str]:
    rows, columns = np.flatnonzero(case.mask.any(axis=1)), np.flatnonzero(case.mask.any(axis=0))
    expected = None
    if len(rows):
        expected = [int(columns[0]), int(rows[0]), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]
    if not case.labels.has("box_visible_px"):
        return
    box = case.labels.box_visible_px
    given = None if box is None else list(box)
    if given != expected:
        yield f"box_visible_px is {given}, the mask's box is {expected}"


def _whole_box(case: Case) -> Iterator[str]:
    corners_cam_m = case.vertices_cam_m[case.dataset.mesh(case.craft.name).faces]
    low, high = extent_px(case.camera, corners_cam_m)
    if np.isnan(low).any():
        yield "box_whole_px is given, and a part of the craft is behind the camera or beyond its lens"
        return
    expected = np.concatenate([low, high - low])
    given = np.array(case.labels.box_whole_px)
    if np.abs(given - expected).max() > REPROJECTION_ERROR_PX:
        yield f"box_whole_px is {_short(given)}, the projected mesh's is {_short(expected)}"


def _short(values: FloatArray) -> str:
    return str(values.round(2).tolist())


def _mask(case: Case) -> Iterator[str]:
    area = int(case.mask.sum())
    if case.has("mask_area_px") and case.labels.mask_area_px != area:
        yield f"mask_area_px is {case.labels.mask_area_px}, the mask has {area} pixels"
    mesh = np.isfinite(case.mesh_depth_m)
    off = int((mesh != case.mask).sum())
    if off > OUTLINE_DISAGREEMENT_PX + OUTLINE_DISAGREEMENT_SHARE * _outline_px(mesh):
        union = int((mesh | case.mask).sum())
        yield f"the mask is not the mesh's outline: {off} pixels differ, IoU {1 - off / union:.3f}"
    whole = case.camera.project(case.vertices_cam_m)
    is_inside = np.all((whole >= -0.5) & (whole < np.array(case.mask.shape[::-1]) - 0.5))
    share = case.labels.fraction_visible if case.has("fraction_visible") else 1.0
    if is_inside and share != 1:
        yield f"fraction_visible is {share}, and all of the craft is in the image"


def _outline_px(mask: BoolArray) -> int:
    """Number of the mask's pixels that have a neighbour outside it."""
    padded = np.pad(mask, 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return int((mask & ~inner).sum())


def _parts(case: Case) -> Iterator[str]:
    part_id = case.truth["part_id"]
    if not np.array_equal(part_id >= 0, case.mask):
        yield f"part_id and the mask differ in {int(((part_id >= 0) != case.mask).sum())} pixels"
    if part_id.max() >= len(case.craft.parts):
        yield f"part_id has {part_id.max()}, and the craft has {len(case.craft.parts)} parts"
        return
    counts = np.bincount(part_id[part_id >= 0], minlength=len(case.craft.parts))
    areas = case.labels.part_area_px if case.has("part_area_px") else None
    for name, count in zip(case.craft.parts, counts.tolist(), strict=True):
        if areas is not None and areas.get(name, 0) != count:
            yield f"part_area_px of {name} is {areas.get(name, 0)}, part_id has {count} pixels of it"


def _depth(case: Case) -> Iterator[str]:
    depth_m = case.truth["depth_m"].astype(np.float64)
    if not np.array_equal(np.isfinite(depth_m), case.mask):
        yield f"depth_m and the mask differ in {int((np.isfinite(depth_m) != case.mask).sum())} pixels"
    both = np.isfinite(depth_m) & np.isfinite(case.mesh_depth_m)
    if not both.any():
        return
    difference = np.abs(depth_m - case.mesh_depth_m)[both]
    wrong = int((difference > DEPTH_ERROR_M + DEPTH_ERROR_SHARE * case.mesh_depth_m[both]).sum())
    if wrong > OUTLINE_DISAGREEMENT_PX + OUTLINE_DISAGREEMENT_SHARE * _outline_px(both):
        scale = float(np.median(depth_m[both] / case.mesh_depth_m[both]))
        yield f"depth_m is off the mesh in {wrong} of {both.sum()} pixels (median ratio {scale:.4g})"


def _normals(case: Case) -> Iterator[str]:
    normal = case.truth["normal_cam"].astype(np.float64)
    seen = np.isfinite(normal).all(axis=-1)
    if not np.array_equal(seen, case.mask):
        yield f"normal_cam and the mask differ in {int((seen != case.mask).sum())} pixels"
    v, u = np.nonzero(seen)
    rays = case.camera.rays(np.stack([u, v], axis=-1))
    if np.any(np.abs(np.linalg.norm(normal[seen], axis=-1) - 1) > NORMAL_ERROR):
        yield "normal_cam has normals that are not of length 1"
    elif np.any(np.sum(normal[seen] * rays, axis=-1) > NORMAL_ERROR * np.linalg.norm(rays, axis=-1)):
        yield "normal_cam has normals that point away from the camera"


def _albedo(case: Case) -> Iterator[str]:
    color = case.truth["base_color_rgb"]
    seen = np.isfinite(color).all(axis=-1)
    if not np.array_equal(seen, case.mask):
        yield f"base_color_rgb and the mask differ in {int((seen != case.mask).sum())} pixels"
    outside = int(((color < 0) | (color > 1)).any(axis=-1).sum())
    if outside:
        yield f"base_color_rgb is not within 0 and 1 in {outside} pixels"


SCHEMA = Check("schema", "every label is there, of its type and in its range", _schema)
CHECKS = (
    Check("files", "image and arrays can be read and are of the camera's size", _files),
    Check(
        "pose", "unit quaternion, scalar not negative, range", _pose, ("q_cam_from_body", "t_body_cam_m")
    ),
    Check(
        "sun",
        "phase angle by pose and Sun",
        _sun,
        ("sun_direction_body", "phase_angle_rad", "q_cam_from_body", "t_body_cam_m"),
    ),
    Check(
        "keypoints",
        f"keypoints by pose and camera, {REPROJECTION_ERROR_PX} px",
        _keypoints,
        ("keypoints", "q_cam_from_body", "t_body_cam_m"),
    ),
    Check(
        "visibility",
        "keypoints hidden by the mesh or not",
        _visibility,
        ("keypoints", "q_cam_from_body", "t_body_cam_m"),
    ),
    Check("box", "visible box is the mask's", _box, ("mask_rle",)),
    Check(
        "whole-box",
        f"whole box is the projected mesh's, {REPROJECTION_ERROR_PX} px",
        _whole_box,
        ("box_whole_px", "q_cam_from_body", "t_body_cam_m"),
    ),
    Check("mask", "mask is the mesh's outline", _mask, ("mask_rle", "q_cam_from_body", "t_body_cam_m")),
    Check("parts", "part ids fill the mask and are counted right", _parts, ("mask_rle",), ("part_id",)),
    Check(
        "depth",
        f"depth is the mesh's by the pose, {DEPTH_ERROR_M * 1e3:.0f} mm",
        _depth,
        ("mask_rle", "q_cam_from_body", "t_body_cam_m"),
        ("depth_m",),
    ),
    Check(
        "normals", "normals of length 1, towards the camera", _normals, ("mask_rle",), ("normal_cam",)
    ),
    Check(
        "albedo", "base colour on the mask, within 0 and 1", _albedo, ("mask_rle",), ("base_color_rgb",)
    ),
)
"""Checks of a frame whose schema is right."""
