"""Cameras and frame states for the tests of the sky."""

from __future__ import annotations

import numpy as np
import pytest

from posse_core._constants import Constants
from posse_core._model.camera import Camera
from posse_core._model.scene import FrameState

AU_M = Constants().au_m
SUN_RADIUS_RAD = float(np.arcsin(Constants().sun_radius_m / AU_M))


@pytest.fixture(scope="session")
def make_camera():
    """Returns a function that makes a camera with square pixels; by default 320×240 px and 90° wide."""
    return _camera


@pytest.fixture(scope="session")
def make_state():
    """Returns a function that makes a frame state; by default the camera is over the equator, looks
    along its velocity, and the Sun is in the zenith."""
    return _state


def _camera(width_px: int = 320, height_px: int = 240, hfov_deg: float = 90.0) -> Camera:
    f = width_px / 2 / np.tan(np.deg2rad(hfov_deg) / 2)
    return Camera(width_px, height_px, f, f, (width_px - 1) / 2, (height_px - 1) / 2, 0.036)


def _looking(forward, up=(0.0, 0.0, 1.0)) -> np.ndarray:
    """R_cam_from_eci of a camera that looks along ``forward``, with ``up`` upwards in the image; ECI
    axes."""
    z = np.asarray(forward, dtype=float) / np.linalg.norm(forward)
    x = np.cross(z, up)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _state(
    r_camera_m=(7.08e6, 0.0, 0.0),
    forward=(0.0, 1.0, 0.0),
    up=(0.0, 0.0, 1.0),
    sun=(1.0, 0.0, 0.0),
    jd_tt=2459610.58,
    **changes,
) -> FrameState:
    sun_unit = np.asarray(sun, dtype=float) / np.linalg.norm(sun)
    values = {
        "index": 0,
        "t_s": 0.0,
        "epoch_jd_tt": jd_tt,
        "R_cam_from_body": np.eye(3),
        "t_body_cam_m": np.array([0.0, 0.0, 20.0]),
        "R_cam_from_eci": _looking(forward, up),
        "R_ecef_from_eci": np.eye(3),
        "r_camera_eci_m": np.asarray(r_camera_m, dtype=float),
        "r_target_eci_m": np.asarray(r_camera_m, dtype=float),
        "r_sun_eci_m": np.asarray(r_camera_m, dtype=float) + AU_M * sun_unit,
        "r_moon_eci_m": np.array([0.0, 0.0, 3.844e8]),
        "solar_flux_w_m2": 1361.0,
        "sun_fraction_target": 1.0,
        "sun_fraction_camera": 1.0,
        "sun_angular_radius_rad": SUN_RADIUS_RAD,
        **changes,
    }
    return FrameState.of(**values)
