"""A spacecraft: named parts, materials of the glTF metallic-roughness model, and keypoints."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray, IntArray
from posse_core._model.joints import Joint


@dataclass(frozen=True)
class Material:
    """A material of the glTF 2.0 metallic-roughness model. A texture multiplies its factor.

    Row 0 of a texture is at v = 1 (the top), as in image files. Textures repeat.

    Attributes:
        name: name of the material.
        base_color: (3,) linear reflectance in red, green, blue, 0 … 1.
        metallic, roughness: 0 … 1; the roughness is perceptual, alpha = roughness².
        specular: 0 … 1, strength of the reflection at the surface of a non-metal, with F0 = 4 % at 1
            (``specularFactor`` of KHR_materials_specular). At 0 a non-metal is Lambertian.
        base_color_texture: (H, W, 3) uint8, sRGB-coded.
        metallic_roughness_texture: (H, W, 2) uint8, linear: metallic, roughness.
        normal_texture: (H, W, 3) uint8, tangent space, +Y up (OpenGL style): n = 2 t/255 − 1.
        patterns: textures of the size and coding of ``base_color_texture``, of which a frame's
            :class:`posse_core.Finish` may put one in its place.
    """

    name: str
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 1.0
    base_color_texture: AnyArray | None = None
    metallic_roughness_texture: AnyArray | None = None
    normal_texture: AnyArray | None = None
    patterns: tuple[AnyArray, ...] = ()


PLAIN: Final = Material("plain", base_color=(0.7, 0.7, 0.7), roughness=0.8)
"""What parts get to which a mesh file gives no material."""


def is_plain(material: Material) -> bool:
    """Whether a material is :data:`PLAIN`, so that nothing is known of what it stands for."""
    return (
        material.name == PLAIN.name
        and material.base_color == PLAIN.base_color
        and material.base_color_texture is None
    )


@dataclass(frozen=True)
class Part:
    """A named part: a triangle mesh with one material, in body axes.

    Attributes:
        name: unique within the spacecraft, for example ``panel``.
        vertices_body_m: (V, 3) float64, where they are with every joint at zero.
        faces: (T, 3) int32, counter-clockwise seen from outside. Both sides are visible.
        normals_body: (V, 3) float32 unit shading normals.
        uv: (V, 2) float32 texture coordinates, v pointing up.
        material: key in :attr:`Spacecraft.materials`.
        joint: name of the joint that carries the part; None if the body does.
    """

    name: str
    vertices_body_m: FloatArray
    faces: IntArray
    normals_body: Float32Array
    uv: Float32Array
    material: str
    joint: str | None = None


@dataclass(frozen=True)
class Spacecraft:
    """The spacecraft that is imaged, in body axes with the origin at the centre of mass.

    Attributes:
        name: for example ``aqua``; the class name in the labels.
        parts: at least one; the id of a part in the labels is its index here.
        materials: the materials by name.
        keypoints_body_m: name → (3,) position, m; the order is that of the labels.
        skeleton: pairs of keypoint names to draw lines between.
        symmetries: rotations (3, 3) about the origin that leave the spacecraft's appearance unchanged,
            without the identity.
        joints: the joints, each after the one that carries it.
        keypoint_joints: name of a keypoint → name of the joint that carries it, of those that the body
            does not carry.
    """

    name: str
    parts: tuple[Part, ...]
    materials: Mapping[str, Material]
    keypoints_body_m: Mapping[str, FloatArray] = field(default_factory=dict)
    skeleton: tuple[tuple[str, str], ...] = ()
    symmetries: tuple[FloatArray, ...] = ()
    joints: tuple[Joint, ...] = ()
    keypoint_joints: Mapping[str, str] = field(default_factory=dict)

    def link_of(self, joint: str | None) -> int:
        """Number of the link that a joint carries; 0, the body's own, for None."""
        return 0 if joint is None else [each.name for each in self.joints].index(joint) + 1

    def welded(self, moving: Container[str]) -> Spacecraft:
        """The spacecraft with the joints that are named in ``moving`` alone.

        What another joint carries stays where it is with that joint at zero.
        """
        by_name = {joint.name: joint for joint in self.joints}

        def carrier(name: str | None) -> str | None:
            while name is not None and name not in moving:
                name = by_name[name].parent
            return name

        if all(name in moving for name in by_name):
            return self
        carriers = {point: carrier(joint) for point, joint in self.keypoint_joints.items()}
        return replace(
            self,
            parts=tuple(replace(part, joint=carrier(part.joint)) for part in self.parts),
            joints=tuple(
                replace(joint, parent=carrier(joint.parent))
                for joint in self.joints
                if joint.name in moving
            ),
            keypoint_joints={point: joint for point, joint in carriers.items() if joint is not None},
        )

    @cached_property
    def bounds_body_m(self) -> FloatArray:
        """(2, 3) lower and upper corner of the axis-aligned box around all parts, m, with every joint at
        zero."""
        low = np.min([part.vertices_body_m.min(axis=0) for part in self.parts], axis=0)
        high = np.max([part.vertices_body_m.max(axis=0) for part in self.parts], axis=0)
        return np.stack([low, high])

    @cached_property
    def radius_m(self) -> float:
        """Radius of the smallest sphere about the origin that contains every vertex, m, with every joint
        at zero."""
        return float(max(np.sqrt((part.vertices_body_m**2).sum(axis=1).max()) for part in self.parts))
