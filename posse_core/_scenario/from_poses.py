"""A scenario from the poses that another dataset's labels give: the same views of any spacecraft.

The labels give the pose of the spacecraft in camera axes, and nothing about orbit, time or illumination.
These are assumed for each frame by itself: the target is on a circular orbit between the Earth and the
Sun, so never in shadow; the Sun is in one direction of the camera axes; frames are one second apart, and
each is a sequence of its own. Labels of one motion in order of time are instead put on one circular
orbit, with the camera's axes fixed in the RTN axes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.interpolate import CubicSpline

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._environment.ephemeris import ECLIPTIC_NORTH_ECI, sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._files.tables import write_table
from posse_core._files.text import write_csv
from posse_core._frames import (
    R_a_from_b_by_directions,
    R_eci_from_rtn,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
    unit,
)
from posse_core._model.camera import Camera
from posse_core._model.poses import Poses
from posse_core._scenario.component import TargetChoice

EPOCH_UTC = "2022-03-20T12:00:00"
RADIUS_M = 7.0e6
_PARALLEL_SINE = 1e-6
"""Two directions count as parallel below this sine of the angle between them."""
_LEAST_SUN = 1e-100
"""The Sun's direction is given in numbers between this and its reciprocal."""
_HEADER = """\
# The {frames} poses of {labels}, to be rendered anew: posse run {scenario}
# Assumed, since labels do not say: the Sun at {sun} in camera axes (right, down, forward), never
# in eclipse; no Earth. With sky.earth true the Earth is opposite to the Sun, fully lit.
"""
_HEADER_OF_SEQUENCE = """\
# The {frames} poses of {labels}, to be rendered anew: posse run {scenario}
# Assumed, since labels do not say: one motion, the poses {every} s apart, on a circular orbit; the
# camera looks back along it, its image's top away from the Earth; the Sun at {sun} in camera axes
# (right, down, forward) at the first pose, and where the orbit takes it later; no Earth.
"""
R_RTN_FROM_CAM = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""The camera of a sequence: right along N, down along −R, forward along −T."""


def motion_of(poses: Poses, sun_cam: FloatArray) -> dict[str, FloatArray]:
    """Arrays of a trajectory in which the camera sees these poses, by the names of ``tables``.

    Args:
        sun_cam: (3,) direction of the Sun in camera axes, of any length.

    Raises:
        InputError: ``sun_cam`` is zero or not finite.
    """
    t_s = np.arange(len(poses.names), dtype=np.float64)
    sun_eci = _sun_eci(t_s)
    r_target_m = RADIUS_M * sun_eci
    along = unit(np.cross(ECLIPTIC_NORTH_ECI, sun_eci))
    v_target_m_s = np.sqrt(Constants().mu_earth_m3_s2 / RADIUS_M) * along
    R_eci_from_cam = _R_eci_from_cam(sun_eci, sun_cam)
    R_rtn_from_cam = np.swapaxes(R_eci_from_rtn(r_target_m, v_target_m_s), -1, -2) @ R_eci_from_cam
    R_eci_from_body = R_eci_from_cam @ matrix_from_quaternion(poses.q_cam_from_body)
    return {
        "t_s": t_s,
        "sequence": np.arange(len(t_s)),
        "r_target_eci_m": r_target_m,
        "v_target_eci_m_s": v_target_m_s,
        "r_chaser_rtn_m": -np.einsum("fij,fj->fi", R_rtn_from_cam, poses.t_body_cam_m),
        "v_chaser_rtn_m_s": np.zeros_like(r_target_m),
        "q_eci_from_body": quaternion_from_matrix(R_eci_from_body),
        "q_eci_from_camera": quaternion_from_matrix(R_eci_from_cam),
    }


def sequence_of(poses: Poses, sun_cam: FloatArray, every_s: float) -> dict[str, FloatArray]:
    """Arrays of a trajectory in which the camera sees these poses one after another.

    Velocities are those of cubic splines through the positions.

    Args:
        sun_cam: (3,) direction of the Sun in camera axes at the first pose, of any length.
        every_s: time from one pose to the next.

    Raises:
        InputError: ``sun_cam`` is zero or not finite, or there is one pose alone.
    """
    if len(poses.names) < 2:
        raise InputError("--every: there is one pose, and a sequence has two or more")
    t_s = every_s * np.arange(len(poses.names), dtype=np.float64)
    R_eci_from_cam = _R_eci_from_cam(_sun_eci(t_s[:1]), sun_cam)[0]
    rate_rad_s = np.sqrt(Constants().mu_earth_m3_s2 / RADIUS_M**3)
    turned = matrix_from_rotation_vector(rate_rad_s * t_s[:, None] * np.array([0.0, 0.0, 1.0]))
    R_eci_from_rtn = R_eci_from_cam @ R_RTN_FROM_CAM.T @ turned
    R_eci_from_cam = R_eci_from_rtn @ R_RTN_FROM_CAM
    r_rtn_m = -poses.t_body_cam_m @ R_RTN_FROM_CAM.T
    R_eci_from_body = R_eci_from_cam @ matrix_from_quaternion(poses.q_cam_from_body)
    return {
        "t_s": t_s,
        "sequence": np.zeros(len(t_s)),
        "r_target_eci_m": RADIUS_M * R_eci_from_rtn[:, :, 0],
        "v_target_eci_m_s": RADIUS_M * rate_rad_s * R_eci_from_rtn[:, :, 1],
        "r_chaser_rtn_m": r_rtn_m,
        "v_chaser_rtn_m_s": CubicSpline(t_s, r_rtn_m)(t_s, 1),
        "q_eci_from_body": quaternion_from_matrix(R_eci_from_body),
        "q_eci_from_camera": quaternion_from_matrix(R_eci_from_cam),
    }


def _sun_eci(t_s: FloatArray) -> FloatArray:
    """(F, 3) directions of the Sun."""
    return unit(sun_eci_m(*Epoch.from_iso(EPOCH_UTC).tdb(t_s)))


def _R_eci_from_cam(sun_eci: FloatArray, sun_cam: FloatArray) -> FloatArray:
    """(F, 3, 3) attitudes of a camera that has the Sun (F, 3) in one direction (3,) of its axes.

    A rotation about the Sun's direction is arbitrary: the image's top is kept near ecliptic north.
    """
    if not _LEAST_SUN < np.max(np.abs(sun_cam)) < 1 / _LEAST_SUN:  # false for NaN
        raise InputError(
            f"--sun {' '.join(map(str, np.asarray(sun_cam)))}: is no direction; give three numbers"
            " towards the Sun in camera axes"
        )
    up_cam = np.array([0.0, -1.0, 0.0])
    if np.linalg.norm(np.cross(unit(sun_cam), up_cam)) < _PARALLEL_SINE:
        up_cam = np.array([0.0, 0.0, 1.0])
    return R_a_from_b_by_directions(sun_eci, ECLIPTIC_NORTH_ECI, sun_cam, up_cam)


def write_scenario(
    labels: Path,
    poses: Poses,
    sun_cam: FloatArray,
    target: TargetChoice,
    camera: Camera | None,
    out: Path,
    *,
    every_s: float | None = None,
) -> Path:
    """Write ``scenario.yaml``, its ``trajectory.npz``, and ``images.csv``, the image of each frame.

    Args:
        sun_cam: (3,), as in :func:`motion_of`.
        target: the spacecraft to render.
        camera: the camera of the labels; None for the default camera of scenarios.
        every_s: as in :func:`sequence_of`; None for frames that have nothing to do with each other.

    Returns:
        The scenario's path.
    """
    arrays = motion_of(poses, sun_cam) if every_s is None else sequence_of(poses, sun_cam, every_s)
    out.mkdir(parents=True, exist_ok=True)
    write_table(out / "trajectory.npz", EPOCH_UTC, arrays)
    write_csv(out / "images.csv", ("frame", "filename"), enumerate(poses.names))
    recorded = {"law": "file", "path": "trajectory.npz"}
    state = {
        "epoch_utc": EPOCH_UTC,
        "r_m": arrays["r_target_eci_m"][0].tolist(),
        "v_m_s": arrays["v_target_eci_m_s"][0].tolist(),
    }
    value: dict[str, Any] = {
        "target": target.model_dump(mode="json"),
        "orbit": {"state_eci": state},
        "propagator": {"name": "file", "path": "trajectory.npz"},
        "attitude": {"target": recorded, "camera": dict(recorded)},
        **({} if camera is None else {"camera": _keys_of(camera)}),
        "sky": {"earth": False},
    }
    path = out / "scenario.yaml"
    header = (_HEADER if every_s is None else _HEADER_OF_SEQUENCE).format(
        frames=len(poses.names),
        labels=labels.name,
        scenario=path,
        sun=np.asarray(sun_cam).tolist(),
        every=every_s,
    )
    write_bytes(path, (header + yaml.safe_dump(value, sort_keys=False)).encode())
    return path


def _keys_of(camera: Camera) -> dict[str, Any]:
    """The scenario keys that describe this camera."""
    lens = camera.distortion
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "sensor_width_mm": camera.sensor_width_m * 1e3,
        "focal_px": [camera.fx_px, camera.fy_px],
        "centre_px": [camera.cx_px, camera.cy_px],
        **({} if lens is None else {"distortion_model": lens.model}),
        "distortion": lens and lens.coefficients.tolist(),
    }
