"""Simple spacecraft, cameras and frames with closed-form images, for tests of renderers."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._frames import R_GL_FROM_CAM
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera
from posse_core._model.craft_state import BodyState
from posse_core._model.joints import RIGID, Articulation, Joint
from posse_core._model.scene import Body, FrameState, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft

__all__ = [
    "FACING",
    "SOLAR_FLUX_W_M2",
    "camera",
    "frame",
    "irradiance_rgb_w_m2",
    "rectangle",
    "scene",
    "sphere",
]

AU_M = 149_597_870_700.0
SUN_ANGULAR_RADIUS_RAD = 4.6525e-3
SOLAR_FLUX_W_M2 = 1361.0

FACING: FloatArray = R_GL_FROM_CAM
"""R_cam_from_body of a camera on the body axis +z that sees +x to the right and +y up."""


def camera(width_px: int = 96, height_px: int = 72, hfov_rad: float = np.pi / 4) -> Camera:
    """A pinhole camera with square pixels and the principal point at the centre of the image."""
    f = width_px / 2 / np.tan(hfov_rad / 2)
    return Camera(width_px, height_px, f, f, (width_px - 1) / 2, (height_px - 1) / 2, 0.036)


def frame(
    *,
    t_body_cam_m: tuple[float, float, float],
    sun_direction_body: tuple[float, float, float],
    R_cam_from_body: FloatArray = FACING,
    solar_flux_w_m2: float = SOLAR_FLUX_W_M2,
    sun_fraction: float = 1.0,
    sun_angular_radius_rad: float = SUN_ANGULAR_RADIUS_RAD,
    articulation: Articulation = RIGID,
    others: tuple[BodyState, ...] = (),
) -> FrameState:
    """A frame state with the target in a low orbit and body axes parallel to the ECI axes.

    ``articulation`` is the target's, and ``others`` are the bodies beside it.
    """
    r_target_eci_m = np.array([7.0e6, 0.0, 0.0])
    sun = np.asarray(sun_direction_body, dtype=np.float64)
    t = np.asarray(t_body_cam_m, dtype=np.float64)
    return FrameState.of(
        index=0,
        t_s=0.0,
        epoch_jd_tt=2459610.5,
        R_cam_from_body=R_cam_from_body,
        t_body_cam_m=t,
        R_cam_from_eci=R_cam_from_body,
        R_ecef_from_eci=np.eye(3),
        r_camera_eci_m=r_target_eci_m - R_cam_from_body.T @ t,
        r_target_eci_m=r_target_eci_m,
        r_sun_eci_m=r_target_eci_m + AU_M * sun / np.linalg.norm(sun),
        r_moon_eci_m=np.array([0.0, 3.844e8, 0.0]),
        solar_flux_w_m2=solar_flux_w_m2,
        sun_fraction_target=sun_fraction,
        sun_fraction_camera=sun_fraction,
        sun_angular_radius_rad=sun_angular_radius_rad,
        articulation=articulation,
        others=others,
    )


def irradiance_rgb_w_m2(flux_w_m2: float = SOLAR_FLUX_W_M2) -> FloatArray:
    """(3,) irradiance by the Sun on a plate that faces it, per band, W m⁻²."""
    return flux_w_m2 * SOLAR_BAND_FRACTIONS


def scene(
    *parts: Part,
    materials: tuple[Material, ...],
    camera: Camera,
    joints: tuple[Joint, ...] = (),
    others: tuple[Part, ...] = (),
) -> Scene:
    """A scene with a spacecraft of these parts, and beside it a body for each part in ``others``."""
    by_name = {material.name: material for material in materials}
    craft = Spacecraft("test", parts, by_name, joints=joints)
    beside = [Body(part.name, Spacecraft(part.name, (part,), by_name)) for part in others]
    return Scene(craft, camera, tuple(beside))


def rectangle(
    name: str,
    material: str,
    *,
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    u_m: tuple[float, float, float] = (1.0, 0.0, 0.0),
    v_m: tuple[float, float, float] = (0.0, 1.0, 0.0),
) -> Part:
    """A flat rectangle with the corners centre ± u ± v and the normal u × v; the texture coordinates u
    and v run along u and v."""
    c, u, v = (np.asarray(x, dtype=np.float64) for x in (centre_m, u_m, v_m))
    normal = np.cross(u, v)
    return Part(
        name=name,
        vertices_body_m=np.stack([c - u - v, c + u - v, c + u + v, c - u + v]),
        faces=np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        normals_body=np.tile(normal / np.linalg.norm(normal), (4, 1)).astype(np.float32),
        uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32),
        material=material,
    )


def sphere(
    name: str,
    material: str,
    *,
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    radius_m: float = 1.0,
    rings: int = 96,
) -> Part:
    """A sphere of 4·rings² triangles with the normals of the exact sphere."""
    theta = np.linspace(0, np.pi, rings + 1)
    phi = np.linspace(0, 2 * np.pi, 2 * rings + 1)
    grid_theta, grid_phi = np.meshgrid(theta, phi, indexing="ij")
    directions = np.stack(
        [
            np.sin(grid_theta) * np.cos(grid_phi),
            np.sin(grid_theta) * np.sin(grid_phi),
            np.cos(grid_theta),
        ],
        axis=-1,
    ).reshape(-1, 3)
    uv = np.stack([grid_phi / (2 * np.pi), 1 - grid_theta / np.pi], axis=-1).reshape(-1, 2)
    return Part(
        name=name,
        vertices_body_m=np.asarray(centre_m) + radius_m * directions,
        faces=_grid_faces(rings, 2 * rings),
        normals_body=directions.astype(np.float32),
        uv=uv.astype(np.float32),
        material=material,
    )


def _grid_faces(rows: int, columns: int) -> IntArray:
    """Triangles of a (rows + 1) × (columns + 1) grid of vertices."""
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a = (i * (columns + 1) + j).ravel()
    b = a + columns + 1
    triangles = np.concatenate([np.stack([a, b, b + 1], axis=-1), np.stack([a, b + 1, a + 1], axis=-1)])
    return triangles.astype(np.int32)
