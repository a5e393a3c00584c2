"""Closed forms that rendered images are compared with."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._model.camera import Camera
from posse_core._model.scene import EnvironmentMap, FrameState
from posse_core._model.spacecraft import Material

__all__ = [
    "directions",
    "disc_share",
    "fine_rays",
    "gltf_brdf",
    "lambertian_sphere",
    "pixel_means",
    "plate_under_a_sky",
    "plate_under_the_sun",
    "polygon_area_and_centroid",
]


def directions(height: int) -> FloatArray:
    """(height, 2·height, 3) directions of an environment map's pixels, camera axes."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = np.pi * (np.arange(2 * height) + 0.5) / height - np.pi
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    return np.stack([np.sin(theta) * np.sin(phi), -np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1)


def disc_share(x: FloatArray) -> FloatArray:
    """Share of the unit disc's area to the left of the line at ``x`` (any shape): −1 → 0, 1 → 1."""
    x = np.clip(x, -1.0, 1.0)
    return np.asarray(0.5 + (np.arcsin(x) + x * np.sqrt(1 - x**2)) / np.pi)


def fine_rays(camera: Camera, fine: int) -> FloatArray:
    """(H·fine, W·fine, 3) unit rays, the centres of the square of ``fine`` × ``fine`` cells of each
    pixel."""
    u = (np.arange(fine * camera.width_px) + 0.5) / fine - 0.5
    v = (np.arange(fine * camera.height_px) + 0.5) / fine - 0.5
    rays = camera.rays(np.stack(np.meshgrid(u, v), axis=-1))
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def pixel_means(values: FloatArray, fine: int) -> FloatArray:
    """(H·fine, W·fine, c) values along :func:`fine_rays` → (H, W, c), their mean in each pixel."""
    height, width, channels = values.shape
    cells = values.reshape(height // fine, fine, width // fine, fine, channels)
    return np.asarray(cells.mean(axis=(1, 3)))


def lambertian_sphere(camera: Camera, frame: FrameState, radius_m: float, fine: int = 6) -> FloatArray:
    """(H, W, 3) radiance of a white Lambertian sphere at the origin of the body axes, E/π cos θ,
    averaged over the square of ``fine`` rays per pixel."""
    rays = fine_rays(camera, fine)
    along = rays @ frame.craft.t_body_cam_m
    inside = along**2 - frame.craft.range_m**2 + radius_m**2
    hits = rays * (along - np.sqrt(np.maximum(inside, 0.0)))[..., None]
    normals = (hits - frame.craft.t_body_cam_m) / radius_m
    cosine = np.where(inside > 0, np.maximum(normals @ frame.craft.sun_direction_cam, 0.0), 0.0)
    mean = pixel_means(cosine[..., None], fine)
    return np.asarray(mean * frame.craft.sun_irradiance_rgb_w_m2 / np.pi)


def gltf_brdf(
    material: Material, normal: FloatArray, to_viewer: FloatArray, to_light: FloatArray
) -> FloatArray:
    """(..., 3) share of the light from one direction that goes to another, sr⁻¹, by glTF 2.0,
    appendix B: GGX facets with height-correlated shadowing and Schlick's Fresnel term; below those of a
    dielectric a Lambertian base; a mixture of dielectric and metal. Textures are left aside.

    Args:
        material: its factors are those at the point.
        normal, to_viewer, to_light: (..., 3) unit vectors, which are broadcast.
    """
    halfway = to_viewer + to_light
    halfway = halfway / np.linalg.norm(halfway, axis=-1, keepdims=True)
    n_l = np.clip((normal * to_light).sum(axis=-1), 0.0, None)
    n_v = np.clip((normal * to_viewer).sum(axis=-1), 1e-9, None)
    n_h = (normal * halfway).sum(axis=-1)
    edge = ((1 - np.clip((to_viewer * halfway).sum(axis=-1), 0.0, 1.0)) ** 5)[..., None]
    a2 = material.roughness**4
    distribution = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    smith = n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2)
    facets = (distribution * 0.5 / np.maximum(smith, 1e-12))[..., None]
    color = np.asarray(material.base_color)
    metal = (color + (1 - color) * edge) * facets
    reflected = material.specular * (0.04 + 0.96 * edge)
    dielectric = (1 - reflected) * color / np.pi + reflected * facets
    mixed = material.metallic * metal + (1 - material.metallic) * dielectric
    return np.asarray(np.where((n_l > 0)[..., None], mixed, 0.0))


def plate_under_the_sun(
    camera: Camera, frame: FrameState, material: Material, fine: int = 3
) -> FloatArray:
    """(H, W, 3) radiance of a plate in the xy plane of the body axes that fills the image, by
    :func:`gltf_brdf`, averaged over the square of ``fine`` rays per pixel and over the Sun's disc."""
    rays, normal = fine_rays(camera, fine), frame.craft.R_cam_from_body[:, 2]
    lights = _points_of_disc(frame.craft.sun_direction_cam, frame.craft.sun_angular_radius_rad)
    light = np.zeros_like(rays)
    for each in lights:
        light += gltf_brdf(material, normal, -rays, each) * max(float(normal @ each), 0.0)
    mean = pixel_means(light / len(lights), fine)
    return np.asarray(mean * frame.craft.sun_irradiance_rgb_w_m2)


def plate_under_a_sky(frame: FrameState, material: Material, sky: EnvironmentMap) -> FloatArray:
    """(3,) radiance of a plate in the xy plane of the body axes that the camera's z axis meets, by
    :func:`gltf_brdf` under a sky. The material's roughness is at least 0.3, since the integral is a sum
    over directions."""
    n = 240
    cosine = ((np.arange(n) + 0.5) / n) ** 2  # finer where light grazes
    weight = 2 * np.sqrt(cosine) / n
    turn = 2 * np.pi * (np.arange(n) + 0.5) / n
    sine = np.sqrt(1 - cosine**2)[:, None]
    up = np.broadcast_to(cosine[:, None], (n, n))
    to_light = np.stack([sine * np.cos(turn), sine * np.sin(turn), up], axis=-1)
    R = frame.craft.R_cam_from_body
    to_viewer = R.T @ [0.0, 0.0, -1.0]
    light = gltf_brdf(material, np.array([0.0, 0.0, 1.0]), to_viewer, to_light) * up[..., None]
    incoming = sky.radiance_rgb[_texels(to_light @ R.T, sky)]
    return np.asarray((light * incoming * weight[:, None, None]).sum(axis=(0, 1)) * 2 * np.pi / n)


def _texels(directions_cam: FloatArray, sky: EnvironmentMap) -> tuple[IntArray, IntArray]:
    """Row and column of the map's pixel in each direction; see :func:`directions`."""
    height, width = sky.radiance_rgb.shape[:2]
    x, y, z = np.moveaxis(directions_cam, -1, 0)
    row = np.arccos(np.clip(-y, -1, 1)) / np.pi * height
    column = (np.arctan2(x, z) / (2 * np.pi) + 0.5) * width
    return np.clip(row.astype(np.int32), 0, height - 1), np.clip(column.astype(np.int32), 0, width - 1)


def _points_of_disc(direction: FloatArray, radius_rad: float) -> list[FloatArray]:
    """Unit vectors that fill the disc about a direction evenly: two rings of equal area."""
    across = np.cross(direction, [0.3, 0.9, 0.1])
    across /= np.linalg.norm(across)
    along = np.cross(direction, across)
    points = []
    for ring in range(2):
        radius = np.sin(radius_rad) * np.sqrt((ring + 0.5) / 2)
        for turn in np.arange(8) * np.pi / 4 + ring:
            point = direction + radius * (np.cos(turn) * across + np.sin(turn) * along)
            points.append(point / np.linalg.norm(point))
    return points


def polygon_area_and_centroid(corners: FloatArray) -> tuple[float, FloatArray]:
    """Area and centroid (2,) of a simple polygon (n, 2)."""
    a, b = corners, np.roll(corners, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = cross.sum() / 2
    return abs(float(area)), ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
