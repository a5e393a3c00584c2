"""Poses that somebody's labels give, as a trajectory: the same views of another craft, by any renderer.

Labels say where the craft is in the camera, and nothing of orbit, time or light. These are assumed, for
each frame by itself: the target on a circular orbit, right under the Sun, so never in shadow; the Sun
in one direction of the camera's axes; frames a second apart, each a sequence of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from posse_core._arrays import FloatArray
from posse_core._attitude.target import ECLIPTIC_NORTH_ECI
from posse_core._constants import Constants
from posse_core._dataset.dataset import read_camera
from posse_core._environment.ephemeris import sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._files.tables import write_table
from posse_core._formats.speed import read_speed
from posse_core._formats.stream import write_csv
from posse_core._formats.urso import is_urso, read_urso
from posse_core._frames import (
    R_a_from_b_by_directions,
    R_eci_from_rtn,
    matrix_from_quaternion,
    quaternion_from_matrix,
    unit,
)
from posse_core._model.camera import Camera

EPOCH_UTC = "2022-03-20T12:00:00"
RADIUS_M = 7.0e6
_OFF_UNIT = 1e-3
_PARALLEL = 1e-6
_HEADER = """\
# The {frames} poses of {labels}, to be rendered anew: posse run {scenario}
# Assumed, since labels do not say: the Sun at {sun} in camera axes (right, down, forward), never
# in eclipse; no Earth. With sky.earth true it stands opposite to the Sun, in full light.
"""


@dataclass(frozen=True)
class Poses:
    """F poses.

    Attributes:
        names: (F,) of the images.
        q_cam_from_body: (F, 4) unit, scalar first.
        t_body_cam_m: (F, 3).
    """

    names: tuple[str, ...]
    q_cam_from_body: FloatArray
    t_body_cam_m: FloatArray


def read_poses(path: Path) -> Poses:
    """Read SPEED's or SPEED+'s JSON, or URSO's ``PART_poses_gt.csv``.

    Raises:
        InputError: the file is missing or of another kind, or a pose is none.
    """
    try:
        entries = list(read_urso(path) if is_urso(path) else read_speed(path))
        q = np.array([pose["q_cam_from_body"] for _, pose in entries], dtype=np.float64).reshape(-1, 4)
        t_m = np.array([pose["t_body_cam_m"] for _, pose in entries], dtype=np.float64).reshape(-1, 3)
    except FileNotFoundError:
        raise InputError(f"there is no file {path}") from None
    except (AttributeError, IndexError, KeyError, OSError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: not poses of SPEED, SPEED+ or URSO: {type(error).__name__}: {error}"
        ) from None
    if not entries or len(q) != len(t_m):
        raise InputError(f"{path}: has no poses, or one that is cut short")
    bad = ~(np.abs(np.linalg.norm(q, axis=1) - 1) < _OFF_UNIT) | ~(t_m[:, 2] > 0)
    if bad.any():
        raise InputError(
            f"{path}: {entries[np.argmax(bad)][0]}: the quaternion is not of length 1, or the target not"
            " before the camera"
        )
    return Poses(tuple(name for name, _ in entries), unit(q), t_m)


def motion_of(poses: Poses, sun_cam: FloatArray) -> dict[str, FloatArray]:
    """Arrays of a trajectory in which the camera sees these poses, by the names of ``tables``.

    Args:
        sun_cam: (3,) towards the Sun in camera axes, of any length.

    Raises:
        InputError: ``sun_cam`` is zero.
    """
    if not np.any(sun_cam):
        raise InputError("--sun 0 0 0: no direction; three numbers towards the Sun, in camera axes")
    t_s = np.arange(len(poses.names), dtype=np.float64)
    sun_eci = unit(sun_eci_m(*Epoch.from_iso(EPOCH_UTC).tdb(t_s)))
    r_target_m = RADIUS_M * sun_eci
    along = unit(np.cross(ECLIPTIC_NORTH_ECI, sun_eci))
    v_target_m_s = np.sqrt(Constants().mu_earth_m3_s2 / RADIUS_M) * along
    # Turning about the Sun's direction is free: the image's top is kept near ecliptic north.
    up_cam = np.array([0.0, -1.0, 0.0])
    if np.linalg.norm(np.cross(unit(sun_cam), up_cam)) < _PARALLEL:
        up_cam = np.array([0.0, 0.0, 1.0])
    R_eci_from_cam = R_a_from_b_by_directions(sun_eci, ECLIPTIC_NORTH_ECI, sun_cam, up_cam)
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


def write_scenario(
    labels: Path, poses: Poses, sun_cam: FloatArray, target: str, camera: Camera | None, out: Path
) -> Path:
    """Write ``scenario.yaml``, its ``trajectory.npz``, and ``images.csv``: which frame is which image.

    Args:
        sun_cam: as in :func:`motion_of`.
        target: name of the spacecraft to render.
        camera: that of the labels; None for a scenario's own default.

    Returns:
        The scenario's path.
    """
    arrays = motion_of(poses, sun_cam)
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
        "target": {"name": target},
        "orbit": {"state_eci": state},
        "propagator": {"name": "file", "path": "trajectory.npz"},
        "attitude": {"target": recorded, "camera": dict(recorded)},
        **({} if camera is None else {"camera": _keys_of(camera)}),
        "sky": {"earth": False},
    }
    path = out / "scenario.yaml"
    header = _HEADER.format(
        frames=len(poses.names), labels=labels.name, scenario=path, sun=np.asarray(sun_cam).tolist()
    )
    write_bytes(path, (header + yaml.safe_dump(value, sort_keys=False)).encode())
    return path


def camera_beside(labels: Path) -> Camera | None:
    """The camera by SPEED+'s ``camera.json``, in the labels' folder or the one above; None without one.

    Raises:
        InputError: it cannot be read.
    """
    for folder in (labels.parent, labels.absolute().parent.parent):
        if (folder / "camera.json").exists():
            return read_camera(folder / "camera.json")
    return None


def _keys_of(camera: Camera) -> dict[str, Any]:
    """The scenario's keys that give this very camera."""
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "sensor_width_mm": camera.sensor_width_m * 1e3,
        "focal_px": [camera.fx_px, camera.fy_px],
        "centre_px": [camera.cx_px, camera.cy_px],
        "distortion": camera.distortion and camera.distortion.coefficients.tolist(),
    }
