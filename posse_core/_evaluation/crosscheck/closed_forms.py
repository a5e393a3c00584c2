"""Scenes whose picture is known by formula: ``lambert-sphere``, ``mirror`` and their like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import AnyArray, FloatArray
from posse_core._evaluation.crosscheck.settings import Setting
from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import BodyState
from posse_core._model.joints import Articulation, Joint
from posse_core._model.scene import Body, EnvironmentMap, FrameState, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._model.srgb import linear_from_srgb
from posse_core.testing import scenes
from posse_core.testing.closed_forms import (
    directions,
    fine_rays,
    gltf_brdf,
    lambertian_sphere,
    pixel_means,
    polygon_area_and_centroid,
)

WHITE = Material("white", base_color=(1.0, 1.0, 1.0), specular=0.0)
CLAY = Material("clay", base_color=(0.8, 0.5, 0.2), specular=0.0)
SMOOTH = Material("smooth", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.1)
GLOSSY = Material("glossy", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.5)
PAINT = Material("paint", base_color=(0.5, 0.5, 0.5), roughness=0.75)
CHECKER_CODES = (255, 64)
CHECKER_CELLS = 8
CELL_TEXELS = 64
CELL_MARGIN = 0.25
"""Share of a checker's cell, on each side, where the texture's filter may blend it with the next."""
SKY_LEVEL_W_M2_SR = 100.0
FIDUCIAL_TURNS = ((0.0, 0.0, 0.1), (0.5, -0.3, 0.4), (-0.3, 0.6, 1.3))
"""Rotation vectors of the attitudes of plates, from the one that faces the camera."""
FINE = 6
"""Rays across a pixel over which closed forms on a sphere are averaged."""


@dataclass(frozen=True)
class ClosedFormCase:
    """One of :data:`CLOSED_FORMS`, by name."""

    name: str

    @property
    def needs_environment(self) -> bool:
        return self.name == "mirror"

    def build(self) -> Setting:
        """The setting, renamed and numbered."""
        setting = CLOSED_FORMS[self.name]()
        frames = tuple(replace(frame, index=i) for i, frame in enumerate(setting.frames))
        return replace(setting, name=self.name, frames=frames)


def _black(frame: FrameState) -> None:
    return None


def lambert_sphere() -> Setting:
    """A white Lambertian sphere at phase angles 0, 45° and 90°: E/π cos θ."""
    scene = scenes.scene(
        scenes.sphere("ball", "white"), materials=(WHITE,), camera=scenes.camera(128, 96, 0.6)
    )
    frames = _phases(0.0, np.pi / 4, np.pi / 2)

    def expected(frame: FrameState) -> FloatArray:
        return lambertian_sphere(scene.camera, frame, radius_m=1.0, fine=FINE)

    return Setting("", scene, frames, 0, _black, expected, lambertian=True)


def lambert_plate() -> Setting:
    """A Lambertian plate that fills the image, the Sun 0, 30° and 60° from its normal: E ρ/π cos θ."""
    plate = scenes.rectangle("plate", "clay", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))
    scene = scenes.scene(plate, materials=(CLAY,), camera=scenes.camera(64, 48))

    def expected(frame: FrameState) -> FloatArray:
        white = frame.craft.sun_irradiance_rgb_w_m2 / np.pi * frame.craft.sun_direction_body[2]
        return np.tile(white * CLAY.base_color, (48, 64, 1))

    return Setting("", scene, _phases(0.0, np.pi / 6, np.pi / 3), 0, _black, expected, lambertian=True)


def mirror() -> Setting:
    """A white metal plate in a sky that brightens evenly from one side to the other: in each pixel,
    the sky in the mirrored direction."""
    plate = scenes.rectangle("mirror", "smooth", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))
    scene = scenes.scene(plate, materials=(SMOOTH,), camera=scenes.camera(64, 48))
    axis = np.array([0.6, -0.64, -0.48])

    def level(directions_cam: FloatArray) -> FloatArray:
        share = 1 + 0.8 * directions_cam @ axis
        return np.asarray(SKY_LEVEL_W_M2_SR * share[..., None] * [1.0, 0.8, 0.6])

    def sky(frame: FrameState) -> EnvironmentMap:
        return EnvironmentMap(level(directions(64)).astype(np.float32))

    def expected(frame: FrameState) -> FloatArray:
        rays = _unit(scene.camera.rays(PixelBox(0, 0, 64, 48).pixel_centres_px()))
        normal = frame.craft.R_cam_from_body[:, 2]
        return level(rays - 2 * (rays @ normal)[..., None] * normal)

    frames = tuple(
        scenes.frame(
            t_body_cam_m=(0.0, 0.0, 4.0),
            sun_direction_body=(0, 0, 1),
            R_cam_from_body=Rotation.from_euler("y", tilt).as_matrix() @ scenes.FACING,
            sun_fraction=0.0,
        )
        for tilt in (0.0, 0.35, -0.35)
    )
    return Setting("", scene, frames, 0, sky, expected)


def glossy_sphere() -> Setting:
    """A white metal sphere of roughness 0.5 at phase angles 30°, 60°, 90°: see :func:`_gltf`."""
    return _sphere_of(GLOSSY)


def paint_sphere() -> Setting:
    """A grey painted sphere of roughness 0.75, likewise: diffuse under a dielectric surface."""
    return _sphere_of(PAINT)


def _sphere_of(material: Material) -> Setting:
    scene = scenes.scene(
        scenes.sphere("ball", material.name), materials=(material,), camera=scenes.camera(128, 96, 0.6)
    )

    def expected(frame: FrameState) -> FloatArray:
        return _gltf(scene.camera, frame, material)

    return Setting("", scene, _phases(np.pi / 6, np.pi / 3, np.pi / 2), 0, _black, expected)


def fiducials() -> Setting:
    """Nine small plates on a lattice in three attitudes: the centroids of their images are those of
    the projected polygons."""
    plates = [
        _plate(f"plate_{i}{j}", (0.55 * (i - 1), 0.55 * (j - 1), 0.1 * (i - j)))
        for i in range(3)
        for j in range(3)
    ]
    scene = scenes.scene(*plates, materials=(WHITE,), camera=scenes.camera(160, 120))
    frames = tuple(
        scenes.frame(
            t_body_cam_m=(0.1, -0.05, 3.7),
            sun_direction_body=(0.2, 0.1, 1.0),
            R_cam_from_body=Rotation.from_rotvec(vector).as_matrix() @ scenes.FACING,
        )
        for vector in FIDUCIAL_TURNS
    )

    def landmarks(frame: FrameState) -> FloatArray:
        centroids = []
        for plate in plates:
            corners_cam_m = (
                plate.vertices_body_m @ frame.craft.R_cam_from_body.T + frame.craft.t_body_cam_m
            )
            centroids.append(polygon_area_and_centroid(scene.camera.project(corners_cam_m))[1])
        return np.array(centroids)

    return Setting("", scene, frames, 0, _black, landmarks_px=landmarks)


def moved_fiducials() -> Setting:
    """Nine plates on a body, on a joint that turns and on one that slides on another that turns, and
    three on a second body. The centroids of their images are those of the polygons that the keypoints
    of the labels give: every corner of a plate is a keypoint of what carries it."""
    turn = Joint("turn", "revolute", np.array([0.1, 0.25, -0.2]), _unit(np.array([0.6, 0.3, 0.8])))
    swing = Joint("swing", "revolute", np.array([0.55, 0.2, 0.0]), _unit(np.array([0.1, 0.0, 1.0])))
    slide = Joint("slide", "prismatic", np.zeros(3), np.array([0.0, 1.0, 0.0]), "swing")
    carriers = (None, turn.name, slide.name)
    plates = [
        replace(_plate(f"plate_{i}{j}", (0.55 * (i - 1), 0.55 * (j - 1), 0.0)), joint=carriers[i])
        for i in range(3)
        for j in range(3)
    ]
    beside = [_plate(f"plate_{j}", (0.0, 0.5 * (j - 1), 0.1 * j)) for j in range(3)]
    joints = (turn, swing, slide)
    craft, other = (
        Spacecraft(
            name,
            tuple(parts),
            {WHITE.name: WHITE},
            {f"{part.name}_{k}": part.vertices_body_m[k] for part in parts for k in range(4)},
            joints=own,
            keypoint_joints={
                f"{part.name}_{k}": part.joint for part in parts if part.joint for k in range(4)
            },
        )
        for name, parts, own in (("craft", plates, joints), ("other", beside, ()))
    )
    scene = Scene(craft, scenes.camera(640, 480), (Body("other", other),))
    caster = RayCaster(scene)
    values = ((0.25, 0.3, 0.1), (-0.3, -0.2, -0.08), (0.2, 0.2, 0.05))
    frames = []
    for number, vector in enumerate(FIDUCIAL_TURNS):
        # The last attitude is turned back about the line of sight, so that the second body is free.
        R = Rotation.from_rotvec([*vector[:2], 0.1 * number + 0.05]).as_matrix() @ scenes.FACING
        there = Rotation.from_rotvec([-0.4, 0.3 * number, 0.2]).as_matrix() @ scenes.FACING
        frames.append(
            scenes.frame(
                t_body_cam_m=(-0.35, -0.05, 3.7),
                sun_direction_body=(0.2, 0.1, 1.0),
                R_cam_from_body=R,
                articulation=Articulation(joints, np.array(values[number]), np.zeros(3)),
                others=(BodyState(there, np.array([1.05, 0.05, 3.4 + 0.2 * number])),),
            )
        )

    def landmarks(frame: FrameState) -> FloatArray:
        corners_px = [view.keypoints_px.reshape(-1, 4, 2) for view in caster.views(frame.craft)]
        return np.array([polygon_area_and_centroid(four)[1] for four in np.concatenate(corners_px)])

    return Setting("", scene, tuple(frames), 0, _black, landmarks_px=landmarks)


def _plate(name: str, centre_m: tuple[float, float, float]) -> Part:
    """A small square plate that is a little turned."""
    return scenes.rectangle(name, "white", centre_m=centre_m, u_m=(0.12, 0.03, 0), v_m=(-0.03, 0.12, 0))


def checker() -> Setting:
    """A Lambertian plate with an sRGB-coded checker, upright and in two oblique views: E ρ/π cos θ in
    the middle of each cell."""
    pattern = np.indices((CHECKER_CELLS, CHECKER_CELLS)).sum(axis=0) % 2
    codes = np.array(CHECKER_CODES, dtype=np.uint8)[pattern]
    texture = np.kron(codes, np.ones((CELL_TEXELS, CELL_TEXELS), dtype=np.uint8))
    material = Material(
        "checker", (1.0, 1.0, 1.0), specular=0.0, base_color_texture=np.stack([texture] * 3, axis=-1)
    )
    plate = scenes.rectangle("plate", "checker", u_m=(1.0, 0, 0), v_m=(0, 1.0, 0))
    scene = scenes.scene(plate, materials=(material,), camera=scenes.camera(160, 120))
    reflectance = linear_from_srgb(np.array(CHECKER_CODES) / 255)
    frames = tuple(
        scenes.frame(
            t_body_cam_m=(0.0, 0.0, 3.0),
            sun_direction_body=(0.3, 0.2, 1.0),
            R_cam_from_body=Rotation.from_rotvec(vector).as_matrix() @ scenes.FACING,
        )
        for vector in ([0.0, 0.0, 0.0], [0.5, 0.3, 0.2], [-0.3, 0.6, -0.9])
    )

    def expected(frame: FrameState) -> FloatArray:
        rays = scene.camera.rays(PixelBox(0, 0, 160, 120).pixel_centres_px())
        normal = frame.craft.R_cam_from_body[:, 2]
        depth_m = (normal @ frame.craft.t_body_cam_m) / (rays @ normal)
        hit_body_m = (rays * depth_m[..., None] - frame.craft.t_body_cam_m) @ frame.craft.R_cam_from_body
        cells = (hit_body_m[..., :2] * [1, -1] + 1) / 2 * CHECKER_CELLS
        cell, rest = np.floor(cells).astype(int), cells % 1.0
        sure = (np.abs(cells - CHECKER_CELLS / 2) < CHECKER_CELLS / 2).all(axis=-1)
        sure &= (np.abs(rest - 0.5) < 0.5 - CELL_MARGIN).all(axis=-1)
        share = np.where(sure, reflectance[cell.sum(axis=-1) % 2], np.nan)
        white = frame.craft.sun_irradiance_rgb_w_m2 / np.pi * frame.craft.sun_direction_body[2]
        return np.asarray(share[..., None] * white)

    return Setting("", scene, frames, 0, _black, expected, lambertian=True)


CLOSED_FORMS: dict[str, Callable[[], Setting]] = {
    "lambert-sphere": lambert_sphere,
    "lambert-plate": lambert_plate,
    "mirror": mirror,
    "glossy-sphere": glossy_sphere,
    "paint-sphere": paint_sphere,
    "fiducials": fiducials,
    "moved-fiducials": moved_fiducials,
    "checker": checker,
}
ANCHORS = ("lambert-sphere", "lambert-plate")
"""What every crosscheck of a scenario begins with: that two agree does not make either right."""


def _phases(*phases_rad: float) -> tuple[FrameState, ...]:
    """A camera on the body's +z axis; the Sun at these angles from it."""
    return tuple(
        scenes.frame(
            t_body_cam_m=(0.0, 0.0, 4.0),
            sun_direction_body=(float(np.sin(phase)), 0.0, float(np.cos(phase))),
        )
        for phase in phases_rad
    )


def _gltf(camera: Camera, frame: FrameState, material: Material) -> FloatArray:
    """(H, W, 3) radiance of a sphere of 1 m by :func:`posse_core.testing.closed_forms.gltf_brdf`.

    Renderers differ in the shadowing, in the light that scatters between facets, and in what becomes
    of light between surface and base; so no threshold is put on it.
    """
    rays = fine_rays(camera, FINE)
    along = rays @ frame.craft.t_body_cam_m
    inside = along**2 - frame.craft.range_m**2 + 1
    normals = rays * (along - np.sqrt(np.maximum(inside, 0.0)))[..., None] - frame.craft.t_body_cam_m
    to_sun = frame.craft.sun_direction_cam
    light = gltf_brdf(material, normals, -rays, to_sun) * np.maximum(normals @ to_sun, 0.0)[..., None]
    mean = pixel_means(np.where((inside > 0)[..., None], light, 0.0), FINE)
    return np.asarray(mean * frame.craft.sun_irradiance_rgb_w_m2)


def _unit(vectors: AnyArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
