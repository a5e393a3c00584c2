"""The Mitsuba scene, which is kept from frame to frame, and the parameters that each frame sets.

Mitsuba's world axes are the body axes, so only the camera, the Sun and the sky move between frames and
nothing is compiled again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from posse_core import CraftState, EnvironmentMap, Float32Array, FloatArray, Spacecraft

MITSUBA_FROM_CAM: FloatArray = np.diag([-1.0, -1.0, 1.0])
"""Rotates OpenCV camera axes to Mitsuba's (x left, y up, z forward); it is its own inverse."""


class World:
    """A Mitsuba scene without a sky, or with a sky map of a fixed size. The variant must be set before
    each call.

    Attributes:
        scene: the ``mitsuba.Scene``.
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
        """Set parameters of the scene as opaque values; Dr.Jit would compile constants into the
        kernel."""
        import drjit as dr

        for name, value in values.items():
            dr.make_opaque(value)
            self._parameters[name] = value
        self._parameters.update()

    def set_environment(self, environment: EnvironmentMap, craft: CraftState) -> None:
        """Set the sky of a frame.

        Mitsuba stores each row padded for wrap-around: its last column is repeated at the beginning and
        its first column at the end.
        """
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
    """Planar depth of a plane just in front of a spacecraft whose origin is at planar depth ``z_m``; at
    least a thousandth of the radius, so that the plane is in front of the camera."""
    return max(z_m - 1.01 * radius_m, 1e-3 * radius_m)


def homogeneous(rotation: FloatArray, translation: FloatArray) -> Float32Array:
    """(4, 4) homogeneous matrix of a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix
