"""What must hold between the labels of one body in one frame, each proven from what did not make them.

A check yields one line for each thing that is wrong. It is asked only of bodies that have the labels
that it compares (:class:`BodyCheck`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import BoolArray, FloatArray
from posse_core._evaluation.body_case import BodyCase
from posse_core._evaluation.case import POSE, Case
from posse_core._evaluation.raster import extent_px
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
OUTLINE_DISAGREEMENT_SHARE = 0.01
"""Share of an outline's pixels that mask and mesh, or depth and mesh, may disagree in: edges that two
programs round differently. A mask that is one pixel off disagrees in more than half."""
OUTLINE_DISAGREEMENT_PX = 4
"""The same for the smallest outlines."""
SEEN_KEYPOINT_DEPTH_SHARE, HIDDEN_KEYPOINT_DEPTH_SHARE = 0.02, 1e-6
"""How far, over the craft's size, the mesh may stand in front of a keypoint that is seen; and how far it
must stand in front of one that is hidden."""
JOINT_ERROR = 1e-9
"""How far a link may be from where its joints put it: its attitude, rad, and its place, over the range,
and at least so many metres. So far may a joint be beyond its limits, too."""
SAME_RATE = 1e-12
"""How far rates of two bodies that say the same may be apart, rad/s or m/s."""


@dataclass(frozen=True)
class BodyCheck:
    """A check by name of each body of a frame whose labels have all of ``needs`` (not null)."""

    name: str
    proves: str
    of_body: Callable[[Case, BodyCase], Iterator[str]]
    needs: tuple[str, ...] = ()

    def applies(self, case: Case) -> bool:
        """Whether a body of the frame has what the check compares."""
        return any(body.has(*self.needs) for body in case.bodies)

    def run(self, case: Case) -> Iterator[str]:
        """What is wrong, with the name of the body unless it is the target."""
        for body in case.bodies:
            if body.has(*self.needs):
                for message in self.of_body(case, body):
                    yield f"{body.name}: {message}" if body.number else message


def _pose(case: Case, body: BodyCase) -> Iterator[str]:
    q, t_m = np.array(body.labels.q_cam_from_body), np.array(body.labels.t_body_cam_m)
    if abs(np.linalg.norm(q) - 1) > UNIT_LENGTH_ERROR:
        yield f"the quaternion's length is {np.linalg.norm(q):.6f}, not 1"
    elif q[0] < 0:
        yield "the quaternion's scalar part is negative; the other sign is to be written"
    range_m = np.linalg.norm(t_m)
    if body.has("range_m") and abs(body.labels.range_m - range_m) > RANGE_ERROR_SHARE * range_m:
        yield f"range_m is {body.labels.range_m:.6g}, the position's length is {range_m:.6g}"
    if body.has("omega_camera_rad_s") and case.has("omega_camera_rad_s"):
        cameras = np.subtract(body.labels.omega_camera_rad_s, case.labels.omega_camera_rad_s)
        if np.abs(cameras).max() > SAME_RATE:
            yield "omega_camera_rad_s is not that beside the target, and there is one camera"
    if body.placed.is_carried and _moves(body):
        yield "is_carried is true, and by its rates the body moves in camera axes"


def _moves(body: BodyCase) -> bool:
    """Whether a body moves in camera axes by its rates at the instant."""
    placed = body.placed
    turn_rad_s = placed.R_cam_from_body @ placed.omega_body_rad_s - placed.omega_camera_rad_s
    v_m_s = placed.v_body_cam_m_s - np.cross(placed.omega_camera_rad_s, placed.t_body_cam_m)
    return bool(max(np.abs(turn_rad_s).max(), np.abs(v_m_s).max()) > JOINT_ERROR)


def _joints(case: Case, body: BodyCase) -> Iterator[str]:
    for link, joint in enumerate(body.craft.joints, 1):
        said = body.labels.joints[joint.name]
        q, t_m = np.array(said.q_cam_from_link), np.array(said.t_link_cam_m)
        if abs(np.linalg.norm(q) - 1) > UNIT_LENGTH_ERROR or q[0] < 0:
            yield f"{joint.name}: q_cam_from_link is no unit quaternion with a scalar part of at least 0"
            continue
        R, by_joints_m = body.placed.link_pose(link)
        chord = np.linalg.norm(R - frames.matrix_from_quaternion(q)) / np.sqrt(8)
        if not 2 * chord <= JOINT_ERROR:
            off_deg = np.degrees(2 * np.arcsin(min(1.0, chord)))
            yield f"{joint.name}: q_cam_from_link is {off_deg:.3g}° from where pose and values put it"
        off_m = float(np.linalg.norm(t_m - by_joints_m))
        if not off_m <= JOINT_ERROR * max(1.0, float(np.linalg.norm(by_joints_m))):
            yield f"{joint.name}: t_link_cam_m is {off_m:.3g} m from where pose and values put it"
        least, greatest = joint.limits
        if not least - JOINT_ERROR <= said.value <= greatest + JOINT_ERROR:
            yield f"{joint.name}: value {said.value:.6g} is not within {least:.6g} and {greatest:.6g}"


def _sun(case: Case, body: BodyCase) -> Iterator[str]:
    sun = np.array(body.labels.sun_direction_body)
    if abs(np.linalg.norm(sun) - 1) > UNIT_LENGTH_ERROR:
        yield f"the Sun's direction has length {np.linalg.norm(sun):.6f}, not 1"
        return
    to_camera = -frames.unit(np.array(body.labels.t_body_cam_m))
    sun_cam = body.R_cam_from_body @ sun
    angle = np.arctan2(np.linalg.norm(np.cross(sun_cam, to_camera)), sun_cam @ to_camera)
    if abs(angle - body.labels.phase_angle_rad) > PHASE_ANGLE_ERROR_RAD:
        yield f"phase_angle_rad is {body.labels.phase_angle_rad:.6f}, by pose and Sun {angle:.6f}"
    if body.number and case.has("sun_direction_body", "q_cam_from_body"):
        beside_target = case.target.R_cam_from_body @ np.array(case.labels.sun_direction_body)
        if np.linalg.norm(sun_cam - beside_target) > UNIT_LENGTH_ERROR:
            yield "sun_direction_body is not the direction of the Sun that the target has"


def _keypoints(case: Case, body: BodyCase) -> Iterator[str]:
    uv, visibility = body.keypoints
    expected = body.camera.project(body.keypoints_seen[0])
    off = _apart(uv, expected)
    if off.size and off.max() > REPROJECTION_ERROR_PX:
        name = list(body.craft.keypoints_body_m)[int(off.argmax())]
        shown = "behind the camera" if np.isinf(off.max()) else f"{off.max():.2f} px off"
        yield f"{name} is {shown} where the pose puts it{_likely_cause(body, uv)}"
    size = np.array([body.camera.width_px, body.camera.height_px])
    inside = np.all((uv >= -0.5) & (uv < size - 0.5), axis=1)
    for i in np.flatnonzero(inside != (visibility != NOT_IN_FRAME)):
        name = list(body.craft.keypoints_body_m)[int(i)]
        where = "in" if inside[i] else "outside"
        yield f"{name} is {where} the image, and its visibility is {visibility[i]}"


def _apart(a: FloatArray, b: FloatArray) -> FloatArray:
    """(K,) distance of points; 0 where both are NaN, infinite where one is."""
    apart = np.linalg.norm(a - b, axis=1)
    gone = np.isnan(a).any(axis=1), np.isnan(b).any(axis=1)
    apart = np.where(gone[0] != gone[1], np.inf, apart)
    return np.where(gone[0] & gone[1], 0.0, apart)


def _likely_cause(body: BodyCase, uv: FloatArray) -> str:
    """What would explain keypoints that do not meet the pose, or nothing."""
    w, x, y, z = body.labels.q_cam_from_body
    rotations = {
        "the quaternion is scalar-last": (z, w, x, y),
        "the rotation is from the camera to the body": (w, -x, -y, -z),
    }
    for cause, q in rotations.items():
        R = frames.matrix_from_quaternion(np.array(q))
        if _meets(uv, body.keypoints_px(R)):
            return f": {cause}"
    if body.joints and _meets(uv, body.keypoints_px(joints={})):
        return ": all joints are taken as at zero"
    expected = body.camera.project(body.keypoints_seen[0])
    mirrored_x = np.stack([body.camera.width_px - 1 - expected[:, 0], expected[:, 1]], axis=1)
    mirrored_y = np.stack([expected[:, 0], body.camera.height_px - 1 - expected[:, 1]], axis=1)
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


def _visibility(case: Case, body: BodyCase) -> Iterator[str]:
    visibility = body.keypoints[1]
    names = list(body.craft.keypoints_body_m)
    points_m, after_s = body.keypoints_seen
    shown = np.flatnonzero(visibility != NOT_IN_FRAME)
    for i, before_m in zip(shown, case.hidden_by_m(points_m[shown], after_s[shown]), strict=True):
        if visibility[i] == VISIBLE and before_m > SEEN_KEYPOINT_DEPTH_SHARE * body.size_m:
            yield f"{names[i]} is labelled seen, and the mesh is {before_m:.3g} m before it"
        if visibility[i] != VISIBLE and before_m < HIDDEN_KEYPOINT_DEPTH_SHARE * body.size_m:
            yield f"{names[i]} is labelled hidden, and nothing is before it"


def _box(case: Case, body: BodyCase) -> Iterator[str]:
    rows, columns = np.flatnonzero(body.mask.any(axis=1)), np.flatnonzero(body.mask.any(axis=0))
    expected = None
    if len(rows):
        expected = [int(columns[0]), int(rows[0]), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]
    if not body.labels.has("box_visible_px"):
        return
    box = body.labels.box_visible_px
    given = None if box is None else list(box)
    if given != expected:
        yield f"box_visible_px is {given}, the mask's box is {expected}"


def _whole_box(case: Case, body: BodyCase) -> Iterator[str]:
    corners_cam_m = body.vertices_seen_m[body.mesh.faces]
    low, high = extent_px(body.camera, corners_cam_m)
    if np.isnan(low).any():
        yield "box_whole_px is given, and a part of the craft is behind the camera or beyond its lens"
        return
    expected = np.concatenate([low, high - low])
    given = np.array(body.labels.box_whole_px)
    if np.abs(given - expected).max() > REPROJECTION_ERROR_PX:
        yield f"box_whole_px is {_short(given)}, the projected mesh's is {_short(expected)}"


def _short(values: FloatArray) -> str:
    return str(values.round(2).tolist())


def _mask(case: Case, body: BodyCase) -> Iterator[str]:
    area = int(body.mask.sum())
    if body.has("mask_area_px") and body.labels.mask_area_px != area:
        yield f"mask_area_px is {body.labels.mask_area_px}, the mask has {area} pixels"
    if area and body.labels.has("fraction_visible") and body.labels.fraction_visible is None:
        yield f"fraction_visible is null, and the mask has {area} pixels"
    mesh = case.body_seen == body.number
    off = int((mesh != body.mask).sum())
    allowed = OUTLINE_DISAGREEMENT_PX + OUTLINE_DISAGREEMENT_SHARE * outline_px(mesh)
    if off > allowed:
        union = int((mesh | body.mask).sum())
        yield f"the mask is not the mesh's outline: {off} pixels differ, IoU {1 - off / union:.3f}"
    whole = body.camera.project(body.vertices_seen_m)
    is_inside = np.all((whole >= -0.5) & (whole < np.array(body.mask.shape[::-1]) - 0.5))
    alone_px = int(case.hits.covered_px[body.number])
    share = body.labels.fraction_visible if body.has("fraction_visible") else None
    if is_inside and alone_px and share is not None:
        shown = int(mesh.sum()) / alone_px
        if abs(share - shown) > (allowed / alone_px if len(case.bodies) > 1 else 0):
            yield f"fraction_visible is {share:.6g}, and the meshes leave {shown:.6g} of it to be seen"


def outline_px(mask: BoolArray) -> int:
    """Number of the mask's pixels that have a neighbour outside it."""
    padded = np.pad(mask, 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return int((mask & ~inner).sum())


BODY_CHECKS = (
    BodyCheck("pose", "unit quaternion, scalar not negative, range", _pose, POSE),
    BodyCheck("joints", "links are where pose and joints put them", _joints, ("joints", *POSE)),
    BodyCheck(
        "sun",
        "phase angle by pose and Sun",
        _sun,
        ("sun_direction_body", "phase_angle_rad", *POSE),
    ),
    BodyCheck(
        "keypoints",
        f"keypoints by pose and camera, {REPROJECTION_ERROR_PX} px",
        _keypoints,
        ("keypoints", *POSE),
    ),
    BodyCheck(
        "visibility",
        "keypoints hidden by the mesh or not",
        _visibility,
        ("keypoints", *POSE),
    ),
    BodyCheck("box", "visible box is the mask's", _box, ("mask_rle",)),
    BodyCheck(
        "whole-box",
        f"whole box is the projected mesh's, {REPROJECTION_ERROR_PX} px",
        _whole_box,
        ("box_whole_px", *POSE),
    ),
    BodyCheck("mask", "mask is the mesh's outline", _mask, ("mask_rle", *POSE)),
)
"""Checks of a body whose schema is right."""
