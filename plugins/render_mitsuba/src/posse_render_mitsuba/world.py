"""The Mitsuba scene, which is kept from frame to frame, and the parameters that each frame sets.

Mitsuba's world axes are those of :class:`posse_core.WorldPoses`, so for a rigid target only the camera,
the Sun and the sky move between frames. Otherwise the links move: nothing is loaded or compiled again.

In the compiled variants each link is an instance of a group of meshes, since recorded kernels keep the
normals of a mesh. In the scalar variant, where instances would cost 8 % of a frame and Mitsuba's path
tracer ends the process at one (3.9.1), the vertices of the links are moved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from posse_core import CraftState, EnvironmentMap, Float32Array, FloatArray, Scene, WorldPoses

if TYPE_CHECKING:
    from posse_render_mitsuba.craft import Shapes

MITSUBA_FROM_CAM: FloatArray = np.diag([-1.0, -1.0, 1.0])
"""Rotates OpenCV camera axes to Mitsuba's (x left, y up, z forward); it is its own inverse."""


@dataclass(frozen=True)
class Place:
    """Where the camera and the links are in one frame.

    Attributes:
        poses: of the camera and the links, in the world's axes.
        near_m, far_m: planar depth of planes in front of and behind all links that may be in view; the
            first is in front of the camera.
    """

    poses: WorldPoses
    near_m: float
    far_m: float

    @classmethod
    def of(cls, craft: CraftState, radii_m: FloatArray) -> Place:
        """The places of a frame; ``radii_m`` are those of the links, see
        :attr:`posse_core.Scene.link_radii_m`."""
        z_m = craft.link_poses().t_link_cam_m[:, 2]
        seen = (radii_m > 0) & (z_m + 1.01 * radii_m > 0)
        if not seen.any():
            seen[:] = True
        near_m = np.maximum(z_m - 1.01 * radii_m, 1e-3 * radii_m)
        far_m = np.maximum(z_m, 0.0) + 1.01 * radii_m
        return cls(craft.world_poses(), float(near_m[seen].min()), float(far_m[seen].max()))


class World:
    """A Mitsuba scene. The variant must be set before each call.

    Attributes:
        scene: the ``mitsuba.Scene``.
    """

    def __init__(
        self,
        scene: Scene,
        shapes: Shapes,
        lamps: Mapping[str, Any],
        environment: EnvironmentMap | None,
    ) -> None:
        """The pieces of a scene as shapes, entries of lamps, and a sky of the size of a map."""
        import mitsuba as mi

        links = len(scene.link_radii_m)
        entries = {"type": "scene", **lamps, **shapes.entries}
        if environment is not None:
            entries["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(environment.radiance_rgb.copy())}
        self.scene = mi.load_dict(entries)
        self._parameters = mi.traverse(self.scene)
        self._instances = [k for k in range(links) if f"link_{k}" in shapes.entries]
        self._pieces = () if self._instances else scene.pieces
        self._R_world_from_link = np.tile(np.eye(3), (links, 1, 1))
        self._t_link_world_m = np.zeros((links, 3))

    def move(self, poses: WorldPoses) -> None:
        """Put those links in their places that are elsewhere."""
        import mitsuba as mi

        R_world_from_link, t_link_world_m = poses.R_world_from_link, poses.t_link_world_m
        moved = (R_world_from_link != self._R_world_from_link).any(axis=(1, 2))
        moved |= (t_link_world_m != self._t_link_world_m).any(axis=1)
        values: dict[str, Any] = {}
        for link in self._instances:
            if moved[link]:
                pose = homogeneous(R_world_from_link[link], t_link_world_m[link])
                values[f"link_{link}.to_world"] = mi.Transform4f(pose)
        for i, (part, _, link) in enumerate(self._pieces):
            if moved[link]:
                R, t_m = R_world_from_link[link], t_link_world_m[link]
                positions_m, normals = part.vertices_body_m @ R.T + t_m, part.normals_body @ R.T
                values[f"part_{i}.vertex_positions"] = np.ravel(positions_m).astype(np.float32)
                values[f"part_{i}.vertex_normals"] = np.ravel(normals).astype(np.float32)
                # Mitsuba would make its own normals for new positions if these were not new too.
                self._parameters.set_dirty(f"part_{i}.vertex_normals")
        if values:
            self.set(values)
        self._R_world_from_link, self._t_link_world_m = R_world_from_link, t_link_world_m

    def set(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the scene as opaque values; Dr.Jit would compile constants into the
        kernel."""
        import drjit as dr

        for name, value in values.items():
            dr.make_opaque(value)
            self._parameters[name] = value
        self._parameters.update()

    def set_environment(self, environment: EnvironmentMap, poses: WorldPoses) -> None:
        """Set the sky of a frame.

        Mitsuba stores each row padded for wrap-around: its last column is repeated at the beginning and
        its first column at the end.
        """
        import mitsuba as mi

        rows = environment.radiance_rgb
        padded = np.concatenate([rows[:, -1:], rows, rows[:, :1]], axis=1)
        rotation = poses.R_cam_from_world.T @ MITSUBA_FROM_CAM
        self.set(
            {
                "sky.data": mi.TensorXf(np.ascontiguousarray(padded, dtype=np.float32)),
                "sky.to_world": mi.Transform4f(homogeneous(rotation, np.zeros(3))),
            }
        )


def homogeneous(rotation: FloatArray, translation: FloatArray) -> Float32Array:
    """(4, 4) homogeneous matrix of a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix
