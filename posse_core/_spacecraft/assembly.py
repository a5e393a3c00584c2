"""Assembles a spacecraft from named parts, materials and keypoints."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import FloatArray
from posse_core._model.joints import Joint
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._spacecraft.shapes import Mesh, joined


@dataclass
class Assembly:
    """A spacecraft being built, in layout coordinates: body axes with any origin."""

    name: str
    _parts: dict[str, tuple[Mesh, str]] = field(default_factory=dict)
    _keypoints: dict[str, tuple[str, FloatArray]] = field(default_factory=dict)
    _joints: list[Joint] = field(default_factory=list)
    _carriers: dict[str, str] = field(default_factory=dict)

    def add(self, name: str, material: str, *meshes: Mesh, joint: str | None = None) -> None:
        """Add a part made of one or more solids with one material, which a joint carries or the body."""
        if name in self._parts:
            raise ValueError(f"two parts are named {name!r}")
        self._parts[name] = (joined(meshes), material)
        if joint is not None:
            self._carriers[name] = joint

    def hang(self, joint: Joint) -> None:
        """Add a joint, after the one that carries it; its origin is in layout coordinates."""
        self._joints.append(joint)

    @property
    def bounds_m(self) -> FloatArray:
        """(2, 3) lower and upper corner of the parts so far, m."""
        points = np.concatenate([mesh.vertices_m for mesh, _ in self._parts.values()])
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @property
    def part_names(self) -> list[str]:
        """The names of the parts so far."""
        return list(self._parts)

    @property
    def material_names(self) -> list[str]:
        """The names of the materials of the parts so far, each once, in their order."""
        return list(dict.fromkeys(material for _, material in self._parts.values()))

    def remove(self, names: Collection[str]) -> None:
        """Remove parts and the keypoints on them."""
        self._parts = {name: part for name, part in self._parts.items() if name not in names}
        self._keypoints = {
            name: keypoint for name, keypoint in self._keypoints.items() if keypoint[0] in self._parts
        }

    def mark(self, name: str, part: str, point_m: ArrayLike) -> None:
        """Add a keypoint (3,) on the surface of a part."""
        self._keypoints[name] = (part, np.asarray(point_m, dtype=np.float64))

    def finish(
        self,
        materials: Mapping[str, Material],
        centre_of_mass_m: ArrayLike,
        skeleton: Sequence[tuple[str, str]],
    ) -> Spacecraft:
        """Make the spacecraft, with the origin at the centre of mass (3,), given in layout coordinates.

        Pairs of the skeleton with a missing keypoint are left out. A keypoint moves with its part.
        """
        origin = np.asarray(centre_of_mass_m, dtype=np.float64)
        return Spacecraft(
            name=self.name,
            parts=tuple(
                Part(
                    name,
                    mesh.vertices_m - origin,
                    mesh.faces,
                    mesh.normals,
                    mesh.uv,
                    material,
                    self._carriers.get(name),
                )
                for name, (mesh, material) in self._parts.items()
            ),
            materials=materials,
            keypoints_body_m={name: point - origin for name, (_, point) in self._keypoints.items()},
            skeleton=tuple(pair for pair in skeleton if set(pair) <= set(self._keypoints)),
            joints=tuple(
                replace(joint, origin_body_m=joint.origin_body_m - origin) for joint in self._joints
            ),
            keypoint_joints={
                name: self._carriers[part]
                for name, (part, _) in self._keypoints.items()
                if part in self._carriers
            },
        )
