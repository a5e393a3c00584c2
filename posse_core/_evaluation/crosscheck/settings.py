"""What is rendered in a crosscheck: a scenario's craft in random poses or along its trajectory.

A case is small and goes to every worker; there it is built into the same setting each time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import FloatArray, evenly_spread
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._model.scene import EnvironmentMap, FrameState, Scene
from posse_core._plugins.loading import load_plugins
from posse_core._randomness import random_generator
from posse_core._scenario.model import Scenario
from posse_core._simulator.scene import scene_of
from posse_core._simulator.states import States
from posse_core._sky.sky import Sky

Poses = Literal["random", "trajectory"]
FIELD_SHARE = 0.5
"""The middle of the image, as a share of width and height, that random positions are drawn from."""
CLEARANCE_RADII = 1.1
"""Least range of a random pose over the craft's radius: else a part might be behind the camera."""
SUNLIT_DISC_SHARE = 0.99
"""Share of the Sun's disc from which on a time may serve a random pose."""


@dataclass(frozen=True)
class Setting:
    """A scene, its frames, and what is known of them without rendering.

    Attributes:
        seed: of the renderers' draws.
        environment: the sky that lights a frame; None where it is black.
        expected_rgb: (H, W, 3) radiance in closed form, W m⁻² sr⁻¹, NaN where there is none; or None.
        lambertian: ``expected_rgb`` is E ρ/π cos θ, which every renderer must reach.
        landmarks_px: (K, 2) centroids of the parts' images, in the parts' order, in closed form; or
            None. Parts must lie apart by two pixels.
    """

    name: str
    scene: Scene
    frames: tuple[FrameState, ...]
    seed: int
    environment: Callable[[FrameState], EnvironmentMap | None]
    expected_rgb: Callable[[FrameState], FloatArray | None] = lambda frame: None
    lambertian: bool = False
    landmarks_px: Callable[[FrameState], FloatArray | None] = lambda frame: None


class Case(Protocol):
    """A recipe for a setting."""

    @property
    def name(self) -> str:
        """As the user wrote it."""
        ...

    @property
    def needs_environment(self) -> bool:
        """All of its light comes from the sky, so a renderer without ``environment`` shows nothing."""
        ...

    def build(self) -> Setting:
        """The setting; the same whenever and wherever it is built."""
        ...


@dataclass(frozen=True)
class ScenarioCase:
    """The craft, camera, sky and light of a scenario."""

    name: str
    scenario: Scenario
    poses: Poses
    count: int
    needs_environment: bool = False

    def build(self) -> Setting:
        """Propagate, build the craft and the sky.

        Raises:
            InputError: the scenario asks for what cannot be made.
        """
        scenario = self.scenario
        registry = load_plugins().registry
        camera = replace(scenario.camera.camera(), line_time_s=0.0)  # a renderer draws an instant
        scene = replace(scene_of(scenario, registry), camera=camera)
        states = States(scenario, scene, registry, None)
        if self.poses == "random":
            scene = replace(scene, others=())
            frames = _random_frames(self, scene, states)
        else:
            chosen = evenly_spread(len(states.trajectory), self.count).tolist()
            frames = tuple(replace(states.own(row), index=i) for i, row in enumerate(chosen))
        sky = Sky(scenario.sky, camera, scenario.seed)
        return Setting(self.name, scene, frames, scenario.seed, sky.environment)


def _random_frames(case: ScenarioCase, scene: Scene, states: States) -> tuple[FrameState, ...]:
    """Frames of the trajectory's times, ranges and joints alone.

    Attitudes of craft and camera are drawn evenly from all rotations, the latter so that Sun and
    Earth stand anywhere about the craft; the craft's origin lies in the middle of the image.
    """
    trajectory = states.trajectory
    lit = np.flatnonzero(trajectory.sun_fraction_target >= SUNLIT_DISC_SHARE)
    if not len(lit):
        raise InputError(f"{case.name}: its target is never in full sunlight; take --poses trajectory")
    ranges_m = np.linalg.norm(trajectory.r_chaser_rtn_m, axis=-1)
    low_m = max(float(ranges_m.min()), CLEARANCE_RADII * scene.spacecraft.radius_m)
    high_m = max(float(ranges_m.max()), low_m)
    frames = []
    for i in range(case.count):
        draw = random_generator(case.scenario.seed, i, "crosscheck pose")
        time = int(draw.choice(lit))
        base = states.own(time)
        R_cam_from_eci = Rotation.random(random_state=draw).as_matrix()
        place_px = _middle_px(scene.camera) + (draw.uniform(size=2) - 0.5) * FIELD_SHARE * [
            scene.camera.width_px,
            scene.camera.height_px,
        ]
        ray = scene.camera.rays(place_px)
        t_body_cam_m = ray / np.linalg.norm(ray) * draw.uniform(low_m, high_m)
        frames.append(
            FrameState.of(
                index=i,
                t_s=base.t_s,
                epoch_jd_tt=base.epoch_jd_tt,
                R_cam_from_body=Rotation.random(random_state=draw).as_matrix(),
                t_body_cam_m=t_body_cam_m,
                R_cam_from_eci=R_cam_from_eci,
                R_ecef_from_eci=base.R_ecef_from_eci,
                r_camera_eci_m=base.r_target_eci_m - R_cam_from_eci.T @ t_body_cam_m,
                r_target_eci_m=base.r_target_eci_m,
                r_sun_eci_m=base.r_sun_eci_m,
                r_moon_eci_m=base.r_moon_eci_m,
                solar_flux_w_m2=base.solar_flux_w_m2,
                sun_fraction_target=base.sun_fraction_target,
                sun_fraction_camera=base.sun_fraction_target,
                sun_angular_radius_rad=base.craft.sun_angular_radius_rad,
                articulation=base.craft.articulation,
            )
        )
    return tuple(frames)


def _middle_px(camera: Camera) -> FloatArray:
    return np.array([(camera.width_px - 1) / 2, (camera.height_px - 1) / 2])
