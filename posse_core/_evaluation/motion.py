"""Whether the labels are those of the motion: the trajectory's frame, and no other frame's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import TRAJECTORY
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._evaluation.result import Fault, Result
from posse_core._files.trajectory import load_trajectory
from posse_core._model.label_line import JointLabels, LabelLine
from posse_core._model.trajectory import Trajectory

ANGLE_ERROR_RAD = 1e-9
"""Of rotations and of the Sun's direction, rad."""
LENGTH_ERROR_SHARE = 1e-9
"""Of the position, over the range, and at least so many metres."""
SPEED_ERROR_M_S = 1e-6
TIME_ERROR_S = 1e-6
STEADY_FRAMES, STEADY_SHARE, RATE_SHARE = 5, 1e-3, 0.01
"""A joint that moves by so many frames as steadily as this has the rate by which it moves, as nearly as
this; of fewer, or less steady ones, the values do not tell the rate between them."""
WHOLE_TURN = 0.05
"""How near to whole turns are some."""
EARTH_ROTATION_ERROR_RAD = 1e-4
"""Of the Earth's rotation: 1.4 s, more than a leap second."""
_J2000 = datetime(2000, 1, 1, 12)


def check_motion(dataset: Dataset) -> Result:
    """Compare each frame's time, pose and Sun with its row of ``trajectory.npz``."""
    result = Result("trajectory", "time, pose and Sun are those of the frame's row in the trajectory")
    try:
        trajectory = load_trajectory(dataset.folder / TRAJECTORY)
    except InputError as error:
        result.faults.append(Fault(None, str(error)))
        return result
    result.faults += _trajectory_faults(trajectory)
    joints: dict[tuple[str, str], list[JointState]] = {}
    for line in dataset.label_lines:
        labels = LabelLine.from_json(line)
        index = labels.index
        for body, name, joint in _joints_of(labels):
            state = JointState(index, labels.sequence, labels.t_s, joint.value, joint.rate)
            joints.setdefault((body, name), []).append(state)
        result.checked += 1
        if index >= len(trajectory):
            result.faults.append(Fault(index, f"the trajectory has {len(trajectory)} frames"))
        else:
            result.faults += [Fault(index, message) for message in _faults(labels, trajectory, index)]
    for (body, name), states in joints.items():
        where = f"bodies.{body}.joints.{name}" if body else f"joints.{name}"
        result.faults += [Fault(i, f"{where}: {text}") for i, text in rate_faults(states)]
    return result


class JointState(NamedTuple):
    """What a frame's labels say of a joint."""

    frame: int
    sequence: int
    t_s: float
    value: float
    rate: float


def _joints_of(labels: LabelLine) -> Iterator[tuple[str, str, JointLabels]]:
    """Name of the body (empty for the target), of the joint, and its labels."""
    beside = labels.bodies.items() if labels.has("bodies") else ()
    for body, each in (("", labels), *beside):
        if each.has("joints"):
            yield from ((body, name, joint) for name, joint in each.joints.items())


def rate_faults(states: Sequence[JointState]) -> Iterator[tuple[int, str]]:
    """Index of each frame in which a joint that moves steadily has another rate, and what is wrong.

    Args:
        states: of one joint, by their frames.
    """
    indices, sequences, times_s, values, rates = (np.array(each) for each in zip(*states, strict=True))
    for first in range(len(states) - STEADY_FRAMES + 1):
        some = slice(first, first + STEADY_FRAMES)
        steps_s = np.diff(times_s[some])
        if len(set(sequences[some])) > 1 or (np.diff(indices[some]) != 1).any() or (steps_s <= 0).any():
            continue
        slopes = np.diff(values[some]) / steps_s
        slope = float(slopes.mean())
        if slope == 0 or np.abs(slopes - slope).max() > STEADY_SHARE * abs(slope):
            continue
        middle = first + STEADY_FRAMES // 2
        # A joint that turns without end may turn by whole turns more between the frames.
        turns = float((rates[middle] - slope) * steps_s.mean() / (2 * np.pi))
        is_whole = round(turns) != 0 and abs(turns - round(turns)) < WHOLE_TURN
        if abs(rates[middle] - slope) > RATE_SHARE * abs(slope) and not is_whole:
            yield (
                int(indices[middle]),
                f"rate is {rates[middle]:.4g}, and it moves by {slope:.4g} a second",
            )


def _trajectory_faults(trajectory: Trajectory) -> Iterator[Fault]:
    """Whether the trajectory agrees with itself: times, the Earth's rotation, and both ways in which it
    has the chaser's motion."""
    t_s = trajectory.t_s
    for i in np.flatnonzero(t_s < 0):
        yield Fault(int(i), f"the trajectory's t_s is {t_s[i]:.6g}, before the epoch")
    same = np.diff(trajectory.sequence) == 0
    for i in np.flatnonzero(same & (np.diff(t_s) <= 0)) + 1:
        yield Fault(int(i), f"the trajectory's t_s is {t_s[i]:.6g}, not after the frame before")
    angle = _earth_rotation_rad(trajectory.epoch_utc, t_s)
    off = np.abs(np.angle(np.exp(1j * (trajectory.earth_rotation_rad - angle))))
    for i in np.flatnonzero(off > EARTH_ROTATION_ERROR_RAD):
        seconds = off[i] / _EARTH_RATE_RAD_S
        yield Fault(int(i), f"earth_rotation_rad is {seconds:.3g} s from that of epoch and t_s")
    r_m, v_m_s = trajectory.r_target_eci_m, trajectory.v_target_eci_m_s
    R = np.array([frames.R_eci_from_rtn(r, v) for r, v in zip(r_m, v_m_s, strict=True)])
    to_chaser_m = np.einsum("fij,fj->fi", R.reshape(-1, 3, 3), trajectory.r_chaser_rtn_m)
    off_m = np.linalg.norm(r_m + to_chaser_m - trajectory.r_chaser_eci_m, axis=1)
    for i in np.flatnonzero(off_m > LENGTH_ERROR_SHARE * np.linalg.norm(r_m, axis=1)):
        yield Fault(int(i), f"r_chaser_eci_m is {off_m[i]:.3g} m from r_chaser_rtn_m")
    turning = np.cross(r_m, v_m_s) / np.sum(r_m**2, axis=1, keepdims=True)
    moving = np.einsum("fij,fj->fi", R.reshape(-1, 3, 3), trajectory.v_chaser_rtn_m_s)
    v_chaser_m_s = v_m_s + moving + np.cross(turning, to_chaser_m)
    off_m_s = np.linalg.norm(v_chaser_m_s - trajectory.v_chaser_eci_m_s, axis=1)
    for i in np.flatnonzero(off_m_s > SPEED_ERROR_M_S):
        yield Fault(int(i), f"v_chaser_eci_m_s is {off_m_s[i]:.3g} m/s from v_chaser_rtn_m_s")


_EARTH_RATE_RAD_S = 2 * np.pi * 1.00273781191135448 / 86400


def _earth_rotation_rad(epoch_utc: str, t_s: FloatArray) -> FloatArray:
    """The Earth's rotation angle (IERS Conventions 2010, eq. 5.15), UT1 taken as UTC."""
    since_s = (datetime.fromisoformat(epoch_utc[:26]) - _J2000).total_seconds()
    return 2 * np.pi * 0.7790572732640 + _EARTH_RATE_RAD_S * (since_s + t_s)


def _faults(labels: LabelLine, trajectory: Trajectory, i: int) -> Iterator[str]:
    for key in ("t_s", "sequence", "sun_fraction_target", "sun_fraction_camera", "solar_flux_w_m2"):
        row = getattr(trajectory, key)[i]
        if getattr(labels, key) != row:
            yield f"{key} is {getattr(labels, key)}, the trajectory has {row}"
    R_cam_from_eci = frames.matrix_from_quaternion(trajectory.q_eci_from_camera[i]).T
    R_eci_from_body = frames.matrix_from_quaternion(trajectory.q_eci_from_body[i])
    if labels.has("q_cam_from_body"):
        R = frames.matrix_from_quaternion(np.array(labels.q_cam_from_body))
        if np.abs(R - R_cam_from_eci @ R_eci_from_body).max() > ANGLE_ERROR_RAD:
            yield "q_cam_from_body is not by the trajectory's attitudes"
    r_target_m, v_target_m_s = trajectory.r_target_eci_m[i], trajectory.v_target_eci_m_s[i]
    epoch = Epoch.from_iso(trajectory.epoch_utc)
    late_s = epoch.seconds_until(Epoch.from_iso(labels.epoch_utc)) - labels.t_s
    if abs(late_s) > TIME_ERROR_S:
        yield f"epoch_utc is {late_s:.6g} s after the trajectory's epoch and t_s"
    if labels.has("v_body_cam_m_s"):
        v_m_s = R_cam_from_eci @ (v_target_m_s - trajectory.v_chaser_eci_m_s[i])
        off_m_s = float(np.linalg.norm(np.array(labels.v_body_cam_m_s) - v_m_s))
        if off_m_s > SPEED_ERROR_M_S:
            yield f"v_body_cam_m_s is {off_m_s:.3g} m/s from the trajectory's"
    if labels.has("t_body_cam_m"):
        R_eci_from_rtn = frames.R_eci_from_rtn(r_target_m, v_target_m_s)
        t_m = -R_cam_from_eci @ R_eci_from_rtn @ trajectory.r_chaser_rtn_m[i]
        off_m = np.linalg.norm(np.array(labels.t_body_cam_m) - t_m)
        if off_m > LENGTH_ERROR_SHARE * max(1.0, float(np.linalg.norm(t_m))):
            yield f"t_body_cam_m is {off_m:.3g} m from the trajectory's"
    if labels.has("sun_direction_body"):
        sun = frames.unit(R_eci_from_body.T @ (trajectory.r_sun_eci_m[i] - r_target_m))
        if np.abs(np.array(labels.sun_direction_body) - sun).max() > ANGLE_ERROR_RAD:
            yield "sun_direction_body is not by the trajectory's Sun and attitude"
    for key in ("omega_body_rad_s", "omega_camera_rad_s"):
        if labels.has(key) and list(getattr(labels, key)) != getattr(trajectory, key)[i].tolist():
            yield f"{key} is not the trajectory's"
