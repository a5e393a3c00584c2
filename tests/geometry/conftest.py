"""Small spacecraft, cameras and frames made by hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
import trimesh

from posse_core._model.camera import Camera
from posse_core._model.craft_state import CraftState
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    """Returns a function that makes a scene from meshes by part name, keypoints and camera
    parameters."""

    def make(
        meshes: Mapping[str, trimesh.Trimesh],
        keypoints: Mapping[str, tuple[float, float, float]] | None = None,
        *,
        width_px: int = 64,
        height_px: int = 48,
        focal_px: float = 48.0,
        middle_px: tuple[float, float] | None = None,
    ) -> Scene:
        parts = tuple(
            Part(
                name=name,
                vertices_body_m=np.asarray(mesh.vertices, dtype=np.float64),
                faces=np.asarray(mesh.faces, dtype=np.int32),
                normals_body=np.asarray(mesh.vertex_normals, dtype=np.float32),
                uv=np.zeros((len(mesh.vertices), 2), dtype=np.float32),
                material="grey",
            )
            for name, mesh in meshes.items()
        )
        points = {name: np.array(point) for name, point in (keypoints or {}).items()}
        craft = Spacecraft("craft", parts, {"grey": Material("grey")}, points)
        u, v = middle_px or ((width_px - 1) / 2, (height_px - 1) / 2)
        return Scene(craft, Camera(width_px, height_px, focal_px, focal_px, u, v, 0.036))

    return make


@pytest.fixture(scope="session")
def make_state() -> Callable[..., CraftState]:
    """Returns a function that makes a spacecraft's state from its pose and the Sun's direction, body
    axes."""

    def make(
        t_body_cam_m: tuple[float, float, float],
        R_cam_from_body: np.ndarray | None = None,
        sun_body: tuple[float, float, float] = (0.0, 0.0, -1.0),
    ) -> CraftState:
        R = np.eye(3) if R_cam_from_body is None else R_cam_from_body
        to_sun = R @ np.array(sun_body)
        return CraftState(
            R_cam_from_body=R,
            t_body_cam_m=np.array(t_body_cam_m, dtype=np.float64),
            sun_direction_cam=to_sun / np.linalg.norm(to_sun),
            sun_irradiance_rgb_w_m2=np.full(3, 180.0),
            sun_angular_radius_rad=0.00465,
        )

    return make


@pytest.fixture(scope="session")
def make_plate() -> Callable[..., trimesh.Trimesh]:
    """Returns a function that makes a plate in a plane of constant z from its half sizes along x and y,
    its centre and its number of cells per side."""

    def make(
        half_x: float, half_y: float, middle: tuple[float, float, float] = (0, 0, 0), cells: int = 1
    ) -> trimesh.Trimesh:
        x, y = np.meshgrid(
            np.linspace(-half_x, half_x, cells + 1), np.linspace(-half_y, half_y, cells + 1)
        )
        vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3) + middle
        corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
        right, below = corner + 1, corner + cells + 1
        faces = np.concatenate(
            [np.stack([corner, below, right], -1), np.stack([right, below, below + 1], -1)]
        )
        return trimesh.Trimesh(vertices, faces, process=False)

    return make
