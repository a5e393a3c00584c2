"""A spacecraft as Mitsuba meshes and materials. The variant must be set before anything here runs."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from posse_core.model.arrays import AnyArray, Float32Array
from posse_core.model.spacecraft import Material, Part, Spacecraft


def craft_shapes(craft: Spacecraft) -> dict[str, Any]:
    """Scene entries of all parts: world axes are the body's."""
    materials = {name: _bsdf(material) for name, material in craft.materials.items()}
    return {f"part_{i}": _mesh(part, materials[part.material]) for i, part in enumerate(craft.parts)}


def _mesh(part: Part, bsdf: Any) -> Any:
    properties = mi.Properties()
    properties["mesh_bsdf"] = bsdf
    mesh = mi.Mesh(
        part.name,
        len(part.vertices_body_m),
        len(part.faces),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=properties,
    )
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"] = np.ravel(part.vertices_body_m).astype(np.float32)
    buffers["vertex_normals"] = np.ravel(part.normals_body).astype(np.float32)
    buffers["vertex_texcoords"] = np.ravel(part.uv).astype(np.float32)
    buffers["faces"] = np.ravel(part.faces).astype(np.uint32)
    buffers.update()
    return mesh


def _bsdf(material: Material) -> Any:
    """glTF metallic-roughness as Mitsuba's ``principled``; without any specular, ``diffuse``."""
    base_color = _base_color(material)
    bsdf: dict[str, Any]
    if material.specular == 0 and material.metallic == 0:
        bsdf = {"type": "diffuse", "reflectance": base_color}
    else:
        metallic: Any = material.metallic
        roughness: Any = material.roughness
        if material.metallic_roughness_texture is not None:
            share = material.metallic_roughness_texture.astype(np.float32) / 255
            metallic = _bitmap(material.metallic * share[..., :1])
            roughness = _bitmap(material.roughness * share[..., 1:])
        bsdf = {
            "type": "principled",
            "base_color": base_color,
            "metallic": metallic,
            "roughness": roughness,
            # Mitsuba's 0.5 is F0 = 4 %; it refuses 0, which would be a surface without an index.
            "specular": max(0.5 * material.specular, 1e-3),
        }
    if material.normal_texture is not None:
        normals = _bitmap(material.normal_texture.astype(np.float32) / 255)
        bsdf = {"type": "normalmap", "normalmap": normals, "bsdf": bsdf}
    return mi.load_dict({"type": "twosided", "bsdf": bsdf})


def _base_color(material: Material) -> dict[str, Any]:
    if material.base_color_texture is None:
        return {"type": "rgb", "value": list(material.base_color)}
    return _bitmap(_linear(material.base_color_texture) * np.array(material.base_color, np.float32))


def _bitmap(values: AnyArray) -> dict[str, Any]:
    """A repeating texture of linear values; row 0 is at v = 1."""
    data = mi.TensorXf(np.ascontiguousarray(values[::-1], dtype=np.float32))  # v is upward
    return {"type": "bitmap", "data": data, "raw": True}


def _linear(srgb: AnyArray) -> Float32Array:
    """uint8 sRGB code → linear (IEC 61966-2-1)."""
    code = np.arange(256) / 255
    table = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return np.asarray(table.astype(np.float32)[srgb])
