"""The Mitsuba scene: what is kept from frame to frame, and what is set anew in each.

The world is the spacecraft's body frame, so between frames only the camera, the Sun and the sky
move, and nothing is compiled again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from posse_core.model.arrays import Float32Array, FloatArray
from posse_core.model.scene import EnvironmentMap, FrameState
from posse_core.model.spacecraft import Spacecraft

MITSUBA_FROM_CAM: FloatArray = np.diag([-1.0, -1.0, 1.0])
"""OpenCV camera axes → Mitsuba's (x left, y up, z forward), and its own inverse."""
LEAST_WEIGHT = 1 / 9
"""Of the sky against the Sun, or the other way round, in choosing where to look for light: one
tenth of the samples at least, since what is dark in sum may be bright on the side that is seen."""


class World:
    """One scene: with or without a sky of one size. The variant must be set before each call.

    Attributes:
        scene, integrator: Mitsuba's.
    """

    def __init__(
        self,
        craft: Spacecraft,
        sun: dict[str, Any],
        environment: EnvironmentMap | None,
        max_depth: int,
    ) -> None:
        import mitsuba as mi

        from posse_render_mitsuba.craft import craft_shapes

        entries: dict[str, Any] = {"type": "scene", "sun": sun, **craft_shapes(craft)}
        if environment is not None:
            entries["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(environment.radiance_rgb.copy())}
        self.scene = mi.load_dict(entries)
        self.integrator = mi.load_dict({"type": "path", "max_depth": max_depth, "hide_emitters": True})
        self._parameters = mi.traverse(self.scene)

    def set(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the scene, as data: a constant would be compiled into the kernel."""
        import drjit as dr

        for name, value in values.items():
            dr.make_opaque(value)
            self._parameters[name] = value
        self._parameters.update()

    def set_environment(self, environment: EnvironmentMap, frame: FrameState) -> None:
        """The sky of this frame; Mitsuba keeps each row with its last column before the first and
        its first after the last."""
        import mitsuba as mi

        rows = environment.radiance_rgb
        padded = np.concatenate([rows[:, -1:], rows, rows[:, :1]], axis=1)
        rotation = frame.R_cam_from_body.T @ MITSUBA_FROM_CAM
        self.set(
            {
                "sky.data": mi.TensorXf(np.ascontiguousarray(padded, dtype=np.float32)),
                "sky.to_world": mi.Transform4f(homogeneous(rotation, np.zeros(3))),
                "sky.sampling_weight": sky_weight(environment, frame),
            }
        )


def sky_weight(environment: EnvironmentMap, frame: FrameState) -> float:
    """How often the sky is sampled for each time that the Sun is: as their light is, W/m² each."""
    rows = environment.radiance_rgb.sum(axis=-1, dtype=np.float64).mean(axis=1)
    polar_rad = np.pi * (np.arange(len(rows)) + 0.5) / len(rows)
    sky_w_m2 = float(rows @ np.sin(polar_rad)) * 2 * np.pi**2 / len(rows)
    sun_w_m2 = float(frame.sun_irradiance_rgb_w_m2.sum())
    share = sky_w_m2 / sun_w_m2 if sun_w_m2 > 0 else np.inf
    return float(np.clip(share, LEAST_WEIGHT, 1 / LEAST_WEIGHT))


def rotation_with_z(z: FloatArray) -> FloatArray:
    """(3, 3) rotation whose third column is the unit vector ``z`` (3,)."""
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def homogeneous(rotation: FloatArray, translation: FloatArray) -> Float32Array:
    """(4, 4) from a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix
