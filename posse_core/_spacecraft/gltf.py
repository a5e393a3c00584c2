"""Reads glTF 2.0 files, with the help of trimesh.

trimesh reads the geometry. The node tree and the materials are read here, because trimesh knows no
animations, rounds material factors to 8 bits and needs another library for pictures. Each primitive is
passed to trimesh with its own material, named after the indices of mesh and primitive, so that its
geometry can be identified.

Source: Khronos glTF 2.0 specification; KHR_texture_transform, EXT_texture_webp,
KHR_draco_mesh_compression, KHR_materials_pbrSpecularGlossiness.
"""

from __future__ import annotations

import base64
import io
import json
import logging
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._errors import InputError
from posse_core._model.spacecraft import PLAIN, Material
from posse_core._spacecraft.cutouts import Alpha, cut_out
from posse_core._spacecraft.draco import check_draco
from posse_core._spacecraft.gltf_file import DRACO, GLOSSY, GltfFile, content, open_gltf, view
from posse_core._spacecraft.gltf_nodes import read_tree
from posse_core._spacecraft.raw import (
    RawMesh,
    RawPart,
    decoded,
    decoded_alpha,
    painted,
    raw_part,
    unique_names,
    untextured,
)


def read_gltf(path: Path) -> RawMesh:
    """Read all triangles of the scene in a .gltf or .glb file, in its own units, with the transforms of
    its nodes applied.

    Raises:
        InputError: the file needs an extension or another file that cannot be read.
        ValueError, KeyError, IndexError, TypeError: the file is damaged.
    """
    file = open_gltf(path)
    _check_draco(file)
    tree = read_tree(file)
    geometries = _geometries(file)
    parts: list[RawPart] = []
    materials: dict[str, Material] = {}
    found = [
        (node, mesh, number)
        for node in tree.nodes
        for mesh in [file.header["meshes"][node.mesh]]
        for number in range(len(mesh["primitives"]))
    ]
    transparent: list[str] = []
    names = unique_names([node.name or mesh.get("name", "") for node, mesh, _ in found])
    for name, (node, mesh, number) in zip(names, found, strict=True):
        geometry = geometries.get(f"{node.mesh}:{number}")
        if geometry is None:  # points or lines
            continue
        primitive = mesh["primitives"][number]
        material, transform = _material(file, primitive.get("material"))
        part = _placed(name, geometry, "NORMAL" in primitive["attributes"], node.matrix, material.name)
        uv = geometry.visual.uv
        if uv is None:
            material = untextured(material)
            part = replace(part, material=material.name)
        elif transform is not None:
            part = replace(part, uv=_transformed(part.uv, transform))
        alpha = _alpha(file, primitive.get("material"), with_texture=uv is not None)
        if alpha is not None:
            part = cut_out(part, alpha)
            if not len(part.faces):
                transparent.append(name)
        colors = geometry.visual.vertex_attributes.get("color")
        if "material" not in primitive and colors is not None:
            part, material = painted(part, np.asarray(colors)[geometry.faces, :3].mean(axis=1))
        parts.append(replace(part, joint=node.joint))
        materials[material.name] = material
    if transparent:
        warnings.warn(
            f"{path}: transparent and so left out: {', '.join(transparent)}",
            stacklevel=2,
        )
    return RawMesh(tuple(parts), materials, tree.joints)


def _check_draco(file: GltfFile) -> None:
    for mesh in file.header.get("meshes", []):
        for primitive in mesh["primitives"]:
            record = primitive.get("extensions", {}).get(DRACO)
            if record is not None:
                check_draco(view(file, record["bufferView"]), file.path)


def _geometries(file: GltfFile) -> dict[str, Any]:
    """trimesh's geometries by the indices of mesh and primitive, ``mesh:primitive``."""
    import trimesh  # slow to import, and seldom needed

    header = {
        key: value for key, value in file.header.items() if key not in ("images", "textures", "samplers")
    }
    keys: list[str] = []
    meshes = []
    for m, mesh in enumerate(file.header.get("meshes", [])):
        primitives = []
        for p, primitive in enumerate(mesh["primitives"]):
            primitives.append({**primitive, "material": len(keys)})
            keys.append(f"{m}:{p}")
        meshes.append({"primitives": primitives, "name": f"m{m}"})
    header["meshes"] = meshes
    header["materials"] = [{"name": key} for key in keys]
    # trimesh gets a flat scene that contains each mesh once; ``read_tree`` evaluates the node tree.
    header["nodes"] = [{"mesh": m, "name": f"n{m}"} for m in range(len(meshes))]
    header["scenes"] = [{"nodes": list(range(len(meshes)))}]
    header["scene"] = 0
    for key in ("skins", "animations", "cameras"):
        header.pop(key, None)
    header["buffers"] = [
        {
            "byteLength": len(data),
            "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
        }
        for data in file.buffers
    ]
    told: list[str] = []

    def is_told(record: logging.LogRecord) -> bool:
        told.append(record.getMessage())
        return False

    trimesh.util.log.addFilter(is_told)
    try:
        scene = trimesh.load_scene(
            io.BytesIO(json.dumps(header).encode()), file_type="gltf", process=False
        )
    except Exception:  # trimesh raises many kinds of exceptions for broken files
        raise InputError(f"{file.path}: the geometry cannot be read; export it again") from None
    finally:
        trimesh.util.log.removeFilter(is_told)
    # trimesh only says so, and goes on with zeros.
    if any("didn't decode" in text for text in told):
        raise InputError(f"{file.path}: compressed geometry cannot be decoded; export it again")
    geometries: list[Any] = [g for g in scene.geometry.values() if isinstance(g, trimesh.Trimesh)]
    return {geometry.visual.material.name: geometry for geometry in geometries}


def _placed(name: str, geometry: Any, has_normals: bool, matrix: FloatArray, material: str) -> RawPart:
    linear = matrix[:3, :3]
    vertices = np.asarray(geometry.vertices) @ linear.T + matrix[:3, 3]
    faces = np.asarray(geometry.faces)
    if np.linalg.det(linear) < 0.0:
        faces = faces[:, ::-1]
    normals = None
    if has_normals:
        normals = np.asarray(geometry.vertex_normals) @ np.linalg.inv(linear)
    return raw_part(name, vertices, faces, normals, geometry.visual.uv, material)


_Transform = tuple[tuple[float, float], float, tuple[float, float]]
"""The offset, rotation in rad and scale of KHR_texture_transform."""


def _transformed(uv: AnyArray, transform: _Transform) -> AnyArray:
    """Apply KHR_texture_transform to texture coordinates (V, 2) whose v points up; the extension's v
    points down."""
    offset, angle, scale = transform
    down = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]) * scale
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = down @ np.array([[cosine, -sine], [sine, cosine]]) + offset
    return np.column_stack([turned[:, 0], 1.0 - turned[:, 1]]).astype(np.float32)


def _material(file: GltfFile, index: int | None) -> tuple[Material, _Transform | None]:
    if index is None:
        return PLAIN, None
    record = file.header["materials"][index]
    # in glTF, several materials may have one name, or none
    given = [m.get("name") or "material" for m in file.header["materials"]]
    _, *names = unique_names([PLAIN.name, *given])
    name = names[index]
    transforms: list[_Transform | None] = []

    def picture(texture: dict[str, Any] | None) -> AnyArray | None:
        if texture is None:
            return None
        transforms.append(_transform(file, texture))
        return _picture(file, texture["index"])

    glossy = record.get("extensions", {}).get(GLOSSY)
    if glossy is not None and "pbrMetallicRoughness" not in record:
        color = glossy.get("diffuseFactor", (1.0, 1.0, 1.0))
        metallic, roughness = 0.0, 1.0 - float(glossy.get("glossinessFactor", 1.0))
        base, mixed = picture(glossy.get("diffuseTexture")), None
    else:
        pbr = record.get("pbrMetallicRoughness", {})
        color = pbr.get("baseColorFactor", (1.0, 1.0, 1.0))
        metallic, roughness = (
            float(pbr.get("metallicFactor", 1.0)),
            float(pbr.get("roughnessFactor", 1.0)),
        )
        base = picture(pbr.get("baseColorTexture"))
        mixed = picture(pbr.get("metallicRoughnessTexture"))
    bumps = picture(record.get("normalTexture"))
    if bumps is not None:
        bumps = _scaled(bumps, float(record["normalTexture"].get("scale", 1.0)))
    if len(set(transforms)) > 1:
        raise InputError(
            f"{file.path}: the textures of material {record.get('name', index)!r} have different"
            " transforms; bake the transforms and export it again"
        )
    red, green, blue = (float(np.clip(c, 0.0, 1.0)) for c in color[:3])
    material = Material(
        name,
        base_color=(red, green, blue),
        # Some exporters write factors outside the range that the specification allows.
        metallic=float(np.clip(metallic, 0.0, 1.0)),
        roughness=float(np.clip(roughness, 0.0, 1.0)),
        base_color_texture=base,
        metallic_roughness_texture=None if mixed is None else np.ascontiguousarray(mixed[..., [2, 1]]),
        normal_texture=bumps,
    )
    return material, transforms[0] if transforms else None


def _alpha(file: GltfFile, index: int | None, *, with_texture: bool) -> Alpha | None:
    """What makes a material transparent; None if it is opaque.

    with_texture: the part has texture coordinates.
    """
    record = {} if index is None else file.header["materials"][index]
    mode = record.get("alphaMode", "OPAQUE")
    if mode == "OPAQUE":
        return None
    colors = record.get("pbrMetallicRoughness")
    factor, texture = "baseColorFactor", "baseColorTexture"
    if colors is None:
        colors = record.get("extensions", {}).get(GLOSSY, {})
        factor, texture = "diffuseFactor", "diffuseTexture"
    values = None
    if with_texture and texture in colors:
        values = decoded_alpha(*_picture_data(file, colors[texture]["index"]))
    opacity = float(colors.get(factor, (1.0, 1.0, 1.0, 1.0))[3])
    return Alpha(opacity, values, float(record.get("alphaCutoff", 0.5)) if mode == "MASK" else 0.5)


def _transform(file: GltfFile, texture: dict[str, Any]) -> _Transform | None:
    given = texture.get("extensions", {}).get("KHR_texture_transform")
    if texture.get("texCoord", 0) != 0 or (given or {}).get("texCoord", 0) != 0:
        raise InputError(
            f"{file.path}: a texture uses a second set of coordinates; export it with one set only"
        )
    if given is None:
        return None
    offset, scale = given.get("offset", (0.0, 0.0)), given.get("scale", (1.0, 1.0))
    return (offset[0], offset[1]), float(given.get("rotation", 0.0)), (scale[0], scale[1])


def _picture(file: GltfFile, index: int) -> AnyArray:
    return decoded(*_picture_data(file, index))


def _picture_data(file: GltfFile, index: int) -> tuple[bytes, Path, str]:
    """The picture of a texture as a file's bytes, with what messages call it."""
    texture = file.header["textures"][index]
    source = texture.get("source")
    for extension in texture.get("extensions", {}).values():
        source = extension.get("source", source)
    if source is None:
        raise InputError(f"{file.path}: texture {index} has no picture; export it again")
    image = file.header["images"][source]
    data = content(file.path, image["uri"]) if "uri" in image else view(file, image["bufferView"])
    return data, file.path, f"picture {image.get('name') or source}"


def _scaled(bumps: AnyArray, scale: float) -> AnyArray:
    if scale == 1.0:
        return bumps
    normal = (bumps / 127.5 - 1.0) * (scale, scale, 1.0)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    return np.asarray(np.rint(127.5 * (normal + 1.0)), dtype=np.uint8)
