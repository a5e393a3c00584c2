"""A scene of two triangles, and views and frames put together by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from posse_core._model.camera import Camera, PixelBox
from posse_core._model.labels import View
from posse_core._model.scene import FrameState, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft

WIDTH_PX, HEIGHT_PX = 30, 20


@pytest.fixture(scope="session")
def scene() -> Scene:
    """Parts ``bus``, ``panel``, ``boom``; keypoints ``T1``, ``S1``, ``A1``."""
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    normals, uv = np.tile(np.float32([0, 0, 1]), (3, 1)), np.zeros((3, 2), np.float32)
    faces = np.array([[0, 1, 2]], np.int32)
    parts = tuple(Part(name, triangle, faces, normals, uv, "grey") for name in ("bus", "panel", "boom"))
    keypoints = {name: np.zeros(3) for name in ("T1", "S1", "A1")}
    craft = Spacecraft("craft", parts, {"grey": Material("grey")}, keypoints)
    return Scene(craft, Camera(WIDTH_PX, HEIGHT_PX, 20.0, 20.0, 14.5, 9.5, 0.036))


@pytest.fixture(scope="session")
def make_view() -> Callable[..., View]:
    """(h, w) part ids at (x0, y0) → a view."""

    def make(part_id: np.ndarray, x0: int = 0, y0: int = 0, silhouette_px: int | None = None) -> View:
        mask = part_id >= 0
        return View(
            box=PixelBox(x0, y0, part_id.shape[1], part_id.shape[0]),
            part_id=part_id.astype(np.int16),
            triangle=part_id.astype(np.int32),
            depth_m=np.where(mask, np.float32(7.5), np.float32(np.nan)),
            normal_cam=np.where(mask[..., None], np.float32([0, 0, -1]), np.float32(np.nan)),
            lit=mask & (np.arange(part_id.shape[1]) % 2 == 0),
            silhouette_px=int(mask.sum()) if silhouette_px is None else silhouette_px,
            keypoints_px=np.array([[1.25, 2.5], [-3.0, 4.0], [np.nan, np.nan]]),
            keypoints_visibility=np.array([2, 0, 0], np.int8),
            whole_box_px=np.array([x0 - 0.25, y0 + 0.5, 3.5, 2.75]),
            target_parts=int(part_id.max(initial=-1)) + 1,
        )

    return make


@pytest.fixture(scope="session")
def make_frame() -> Callable[..., FrameState]:
    """Pose, and the Sun's direction in camera axes → a frame."""

    def make(t_body_cam_m: np.ndarray, R_cam_from_body: np.ndarray, sun_cam: np.ndarray) -> FrameState:
        return FrameState.of(
            index=3,
            t_s=0.0,
            epoch_jd_tt=2451545.0,
            R_cam_from_body=R_cam_from_body,
            t_body_cam_m=np.asarray(t_body_cam_m, dtype=np.float64),
            R_cam_from_eci=np.eye(3),
            R_ecef_from_eci=np.eye(3),
            r_camera_eci_m=np.zeros(3),
            r_target_eci_m=np.zeros(3),
            r_sun_eci_m=1.5e11 * np.asarray(sun_cam),
            r_moon_eci_m=np.array([3.8e8, 0.0, 0.0]),
            solar_flux_w_m2=1361.0,
            sun_fraction_target=1.0,
            sun_fraction_camera=1.0,
            sun_angular_radius_rad=0.00465,
        )

    return make
