"""A spacecraft: named parts, materials in the glTF metallic-roughness model, keypoints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True)
class Material:
    """glTF 2.0 metallic-roughness. A texture multiplies the factor beside it.

    Textures have row 0 at v = 1 (the top), as image files have; they repeat.

    Attributes:
        base_color: (3,) linear reflectance in red, green, blue, 0 … 1.
        metallic, roughness: 0 … 1; roughness is perceptual, alpha = roughness².
        specular: 0 … 1, strength of the reflection at a non-metal's surface, whose F0 is 4 % at 1
            (``specularFactor`` of KHR_materials_specular). With 0 a non-metal is Lambertian.
        base_color_texture: (H, W, 3) uint8, sRGB-coded.
        metallic_roughness_texture: (H, W, 2) uint8, linear: metallic, roughness.
        normal_texture: (H, W, 3) uint8, tangent space, +Y up (OpenGL style): n = 2 t/255 − 1.
    """

    name: str
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 1.0
    base_color_texture: AnyArray | None = None
    metallic_roughness_texture: AnyArray | None = None
    normal_texture: AnyArray | None = None


@dataclass(frozen=True)
class Part:
    """One named part: a triangle mesh with one material, in the body frame.

    Attributes:
        name: unique within the spacecraft, as in ``panel``.
        vertices_body_m: (V, 3) float64.
        faces: (T, 3) int32, counter-clockwise seen from outside. Both sides are visible.
        normals_body: (V, 3) float32 unit shading normals.
        uv: (V, 2) float32 texture coordinates, v upward.
        material: key in :attr:`Spacecraft.materials`.
    """

    name: str
    vertices_body_m: FloatArray
    faces: IntArray
    normals_body: Float32Array
    uv: Float32Array
    material: str


@dataclass(frozen=True)
class Spacecraft:
    """What is looked at, in its body frame: the mesh's axes, the origin at the centre of mass.

    Attributes:
        name: as in ``aqua``; the class name in the labels.
        parts: at least one; a part's id in the labels is its place here.
        materials: by name.
        keypoints_body_m: name → (3,) metres; the order is the order in the labels.
        skeleton: pairs of keypoint names to draw lines between.
        symmetries: rotations (3, 3) about the origin that leave the craft's looks unchanged, without
            the identity.
    """

    name: str
    parts: tuple[Part, ...]
    materials: Mapping[str, Material]
    keypoints_body_m: Mapping[str, FloatArray] = field(default_factory=dict)
    skeleton: tuple[tuple[str, str], ...] = ()
    symmetries: tuple[FloatArray, ...] = ()

    @property
    def bounds_body_m(self) -> FloatArray:
        """(2, 3) lower and upper corner of the axis-aligned box around all parts."""
        low = np.min([part.vertices_body_m.min(axis=0) for part in self.parts], axis=0)
        high = np.max([part.vertices_body_m.max(axis=0) for part in self.parts], axis=0)
        return np.stack([low, high])

    @property
    def radius_m(self) -> float:
        """Radius of the sphere about the origin that holds every vertex."""
        return float(max(np.sqrt((part.vertices_body_m**2).sum(axis=1).max()) for part in self.parts))
