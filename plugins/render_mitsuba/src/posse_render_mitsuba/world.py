"""The Mitsuba scene: what is kept from frame to frame, and what is set anew in each.

The world is the spacecraft's body frame, so between frames only the camera, the Sun and the sky
move, and nothing is compiled again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from posse_core import CraftState, EnvironmentMap, Float32Array, FloatArray, Spacecraft

MITSUBA_FROM_CAM: FloatArray = np.diag([-1.0, -1.0, 1.0])
"""OpenCV camera axes → Mitsuba's (x left, y up, z forward), and its own inverse."""


class World:
    """One scene: with or without a sky of one size. The variant must be set before each call.

    Attributes:
        scene: Mitsuba's.
    """

    def __init__(
        self, craft: Spacecraft, lamps: Mapping[str, Any], environment: EnvironmentMap | None
    ) -> None:
        import mitsuba as mi

        from posse_render_mitsuba.craft import craft_shapes

        entries: dict[str, Any] = {"type": "scene", **lamps, **craft_shapes(craft)}
        if environment is not None:
            entries["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(environment.radiance_rgb.copy())}
        self.scene = mi.load_dict(entries)
        self._parameters = mi.traverse(self.scene)

    def set(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the scene, as data: a constant would be compiled into the kernel."""
        import drjit as dr

        for name, value in values.items():
            dr.make_opaque(value)
            self._parameters[name] = value
        self._parameters.update()

    def set_environment(self, environment: EnvironmentMap, craft: CraftState) -> None:
        """The sky of this frame; Mitsuba keeps each row with its last column before the first and
        its first after the last."""
        import mitsuba as mi

        rows = environment.radiance_rgb
        padded = np.concatenate([rows[:, -1:], rows, rows[:, :1]], axis=1)
        rotation = craft.R_cam_from_body.T @ MITSUBA_FROM_CAM
        self.set(
            {
                "sky.data": mi.TensorXf(np.ascontiguousarray(padded, dtype=np.float32)),
                "sky.to_world": mi.Transform4f(homogeneous(rotation, np.zeros(3))),
            }
        )


def near_plane_m(z_m: float, radius_m: float) -> float:
    """Depth shortly before a craft whose origin is at planar depth ``z_m``, and before the camera."""
    return max(z_m - 1.01 * radius_m, 1e-3 * radius_m)


def homogeneous(rotation: FloatArray, translation: FloatArray) -> Float32Array:
    """(4, 4) from a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix
