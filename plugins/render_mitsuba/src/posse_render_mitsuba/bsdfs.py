"""The materials of a scene as Mitsuba's BSDFs, for the scalar variant, which must be set before this
module is imported."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from posse_core import AnyArray, Float32Array, Material, Scene, linear_from_srgb

SURFACE_SHARE = 0.25
"""Share of sampled paths that reflect at a dielectric's surface; the others reflect at its base."""
BELOW_SURFACE = 0.955
"""Share of light that reaches the base of a dielectric with F0 = 4 %: 1 − F averaged over facet
angles."""


def bsdfs(scene: Scene) -> dict[int, Any]:
    """The BSDFs of the materials of all pieces, by the identity of the material."""
    materials = {id(piece.material): piece.material for piece in scene.pieces}
    return {key: bsdf_of(material) for key, material in materials.items()}


def bsdf_of(material: Material) -> Any:
    """The glTF metallic-roughness material (glTF 2.0, Appendix B), built from Mitsuba's BSDFs.

    Mitsuba's ``principled`` agrees with glTF for metals only. For dielectrics its base is Disney's,
    which does not subtract the light that the surface reflects and brightens at the limb: 4 to 11 %
    above glTF.
    """
    bsdf = _mixed(material)
    if material.normal_texture is not None:
        normals = _bitmap(material.normal_texture.astype(np.float32) / 255)
        bsdf = {"type": "normalmap", "normalmap": normals, "bsdf": bsdf}
    return mi.load_dict({"type": "twosided", "bsdf": bsdf})


def _mixed(material: Material) -> dict[str, Any]:
    """A blend of metal and dielectric, by the material's metallic factor and texture."""
    texture = material.metallic_roughness_texture
    metallic: AnyArray | None = None
    roughness: AnyArray | None = None
    if texture is not None:
        share = texture.astype(np.float32) / 255
        metallic, roughness = material.metallic * share[..., :1], material.roughness * share[..., 1:]
    if material.metallic == 0 or (metallic is not None and metallic.max() == 0):
        return _dielectric(material, roughness)
    metal = {
        "type": "principled",
        "base_color": _base_color(material, 1.0),
        "metallic": 1.0,
        "roughness": material.roughness if roughness is None else _bitmap(roughness),
    }
    if (material.metallic if metallic is None else metallic.min()) == 1:
        return metal
    return {
        "type": "blendbsdf",
        "weight": material.metallic if metallic is None else _bitmap(metallic),
        "dielectric": _dielectric(material, roughness),
        "metal": metal,
    }


def _dielectric(material: Material, roughness: AnyArray | None) -> dict[str, Any]:
    """A Lambertian base with GGX facets above it, or the base alone if ``specular`` is 0.

    Each is divided by its weight in the blend, so that they add up. The facets are those of a conductor
    without absorption, whose Fresnel term equals the dielectric's.
    """
    if material.specular == 0:
        return {"type": "diffuse", "reflectance": _base_color(material, 1.0)}
    f0 = 0.04 * material.specular
    below = 1 - (1 - BELOW_SURFACE) * material.specular
    alpha = material.roughness**2 if roughness is None else _bitmap(np.maximum(roughness, 0.01) ** 2)
    return {
        "type": "blendbsdf",
        "weight": SURFACE_SHARE,
        "base": {"type": "diffuse", "reflectance": _base_color(material, below / (1 - SURFACE_SHARE))},
        "facets": {
            "type": "roughconductor",
            "distribution": "ggx",
            "alpha": alpha,
            "eta": (1 + np.sqrt(f0)) / (1 - np.sqrt(f0)),
            "k": 0.0,
            "specular_reflectance": _bitmap(np.full((2, 2, 3), 1 / SURFACE_SHARE)),
        },
    }


def _base_color(material: Material, scale: float) -> dict[str, Any]:
    """Linear base colour times ``scale``, as a bitmap, because bitmap values may exceed 1."""
    factor = np.array(material.base_color, np.float32) * scale
    if material.base_color_texture is None:
        return _bitmap(np.broadcast_to(factor, (2, 2, 3)))
    return _bitmap(_linear(material.base_color_texture) * factor)


def _bitmap(values: AnyArray) -> dict[str, Any]:
    """A repeating texture of linear ``values`` (h, w, channels), whose row 0 is at v = 1."""
    data = mi.TensorXf(np.ascontiguousarray(values[::-1], dtype=np.float32))  # v points up
    return {"type": "bitmap", "data": data, "raw": True}


def _linear(srgb: AnyArray) -> Float32Array:
    """uint8 sRGB codes → linear values in 0 … 1, of the same shape."""
    return np.asarray(linear_from_srgb(np.arange(256) / 255).astype(np.float32)[srgb])
