"""Whether the labels are those of the motion: the trajectory's frame, and no other frame's."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posse_core import _frames as frames
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import TRAJECTORY
from posse_core._errors import InputError
from posse_core._evaluation.result import Fault, Result
from posse_core._files.trajectory import load_trajectory
from posse_core._model.label_line import LabelLine
from posse_core._model.trajectory import Trajectory

ANGLE_ERROR_RAD = 1e-9
"""Of rotations and of the Sun's direction, rad."""
LENGTH_ERROR_SHARE = 1e-9
"""Of the position, over the range, and at least so many metres."""


def check_motion(dataset: Dataset) -> Result:
    """Compare each frame's time, pose and Sun with its row of ``trajectory.npz``."""
    result = Result("trajectory", "time, pose and Sun are those of the frame's row in the trajectory")
    try:
        trajectory = load_trajectory(dataset.folder / TRAJECTORY)
    except InputError as error:
        result.faults.append(Fault(None, str(error)))
        return result
    for line in dataset.label_lines:
        labels = LabelLine.from_json(line)
        index = labels.index
        result.checked += 1
        if index >= len(trajectory):
            result.faults.append(Fault(index, f"the trajectory has {len(trajectory)} frames"))
        else:
            result.faults += [Fault(index, message) for message in _faults(labels, trajectory, index)]
    return result


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
