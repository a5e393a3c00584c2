"""Reads glTF 2.0 files, with the help of trimesh.

trimesh reads the geometry. The node tree and the materials are read here, because trimesh rounds
material factors to 8 bits and needs another library for pictures. Each primitive is passed to trimesh
with its own material, named after the indices of mesh and primitive, so that its geometry can be
identified.

Source: Khronos glTF 2.0 specification; KHR_texture_transform, EXT_texture_webp,
KHR_draco_mesh_compression, KHR_materials_pbrSpecularGlossiness.
"""

from __future__ import annotations

import base64
import binascii
import importlib.util
import io
import json
import os
import struct
import urllib.parse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from posse_core._arrays import AnyArray, FloatArray
from posse_core._errors import InputError
from posse_core._files.reading import parsed_json, read_bytes
from posse_core._frames import matrix_from_quaternion
from posse_core._model.spacecraft import Material
from posse_core._spacecraft.draco import MOST_VALUES, check_draco
from posse_core._spacecraft.raw import (
    RawMesh,
    RawPart,
    decoded,
    painted,
    raw_part,
    unique_names,
    untextured,
)

_DRACO = "KHR_draco_mesh_compression"
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"
_READ = {_DRACO, _GLOSSY, "EXT_texture_webp", "KHR_texture_transform", "KHR_mesh_quantization"}
_HARMLESS = ("KHR_materials_", "KHR_lights_")


def read_gltf(path: Path) -> RawMesh:
    """Read all triangles of the scene in a .gltf or .glb file, in its own units, with the transforms of
    its nodes applied.

    Raises:
        InputError: the file needs an extension or another file that cannot be read.
        ValueError, KeyError, IndexError, TypeError: the file is damaged.
    """
    file = _open(path)
    _check_draco(file)
    geometries = _geometries(file)
    parts: list[RawPart] = []
    materials: dict[str, Material] = {}
    found = [
        (node, mesh, number)
        for node in _nodes(file.header, path)
        for mesh in [file.header["meshes"][node.mesh]]
        for number in range(len(mesh["primitives"]))
    ]
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
        colors = geometry.visual.vertex_attributes.get("color")
        if "material" not in primitive and colors is not None:
            part, material = painted(part, np.asarray(colors)[geometry.faces, :3].mean(axis=1))
        parts.append(part)
        materials[material.name] = material
    return RawMesh(tuple(parts), materials)


@dataclass(frozen=True)
class _File:
    path: Path
    header: dict[str, Any]
    buffers: list[bytes]


@dataclass(frozen=True)
class _Node:
    name: str
    mesh: int
    matrix: FloatArray


def _open(path: Path) -> _File:
    data = read_bytes(path)
    binary = b""
    try:
        if data[:4] == b"glTF":
            version, length = struct.unpack_from("<II", data, 4)
            if version != 2 or length > len(data):
                raise InputError(f"{path}: not a complete glTF 2.0 file; export it again")
            offset = 12
            chunks: dict[int, bytes] = {}
            while offset + 8 <= length:
                size, kind = struct.unpack_from("<II", data, offset)
                chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
                offset += 8 + size
            text, binary = chunks.get(0x4E4F534A, b""), chunks.get(0x004E4942, b"")
        else:
            text = data
    except struct.error:
        raise InputError(f"{path}: not a glTF file; export it again") from None
    header = parsed_json(text, f"{path}: not a glTF file")
    if not isinstance(header, dict):
        raise InputError(f"{path}: not a glTF file; export it again")
    _check_extensions(path, header)
    _check_counts(path, header)
    buffers = [
        _content(path, buffer["uri"]) if "uri" in buffer else binary
        for buffer in header.get("buffers", [])
    ]
    return _File(path, header, buffers)


def _check_extensions(path: Path, header: dict[str, Any]) -> None:
    for extension in header.get("extensionsRequired", []):
        if extension not in _READ and not extension.startswith(_HARMLESS):
            raise InputError(
                f"{path}: needs the glTF extension {extension}, which cannot be read;"
                " export it without compression or with Draco"
            )
    used = {*header.get("extensionsUsed", []), *header.get("extensionsRequired", [])}
    if _DRACO in used and importlib.util.find_spec("DracoPy") is None:
        raise InputError(
            f"{path}: compressed with Draco, but the decoder is not installed;"
            " pip install 'posse-core[draco]', or export it without Draco"
        )


def _check_counts(path: Path, header: dict[str, Any]) -> None:
    for accessor in header.get("accessors", []):
        if not 0 <= int(accessor["count"]) <= MOST_VALUES:
            raise InputError(f"{path}: an accessor has {accessor['count']} values; export it again")


def _check_draco(file: _File) -> None:
    for mesh in file.header.get("meshes", []):
        for primitive in mesh["primitives"]:
            record = primitive.get("extensions", {}).get(_DRACO)
            if record is not None:
                check_draco(_view(file, record["bufferView"]), file.path)


def _content(path: Path, uri: str) -> bytes:
    """The content of a URI, which is data or the path of a file in the model's folder."""
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except binascii.Error:
            raise InputError(f"{path}: the file contains damaged data; export it again") from None
    return read_bytes(beside(path, urllib.parse.unquote(uri)))


def beside(path: Path, name: str) -> Path:
    """The path of a file that a model refers to, which must be within the model's folder.

    Raises:
        InputError: the file is outside the folder or missing.
    """
    target = within(path, name)
    if not target.is_file():
        raise InputError(f"{path}: refers to {name!r}, which is missing; put it into the model's folder")
    return target


def within(path: Path, name: str) -> Path:
    """The path of a file that a model refers to, whether or not it exists.

    Raises:
        InputError: it would be outside the model's folder.
    """
    if "\0" in name:
        raise InputError(f"{path}: refers to {name!r}, which is no name of a file")
    folder = path.parent.resolve()
    target = Path(os.path.realpath(folder / name))  # Path.resolve raises for a loop of links
    if not target.is_relative_to(folder):
        raise InputError(
            f"{path}: refers to {name!r}, which is outside its folder; move it into the model's folder"
        )
    return target


def gltf_side_files(path: Path) -> list[str]:
    """The buffers and pictures that a .gltf or .glb file refers to, by their paths from its folder."""
    header = _open(path).header
    uris = [item.get("uri", "data:") for key in ("buffers", "images") for item in header.get(key, [])]
    return [urllib.parse.unquote(uri) for uri in uris if not uri.startswith("data:")]


def _geometries(file: _File) -> dict[str, Any]:
    """trimesh's geometries by the indices of mesh and primitive, ``mesh:primitive``."""
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
    # trimesh gets a flat scene that contains each mesh once; ``_nodes`` evaluates the node tree.
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
    try:
        scene = trimesh.load_scene(
            io.BytesIO(json.dumps(header).encode()), file_type="gltf", process=False
        )
    except Exception as error:  # trimesh raises many kinds of exceptions for broken files
        raise InputError(
            f"{file.path}: the geometry cannot be read ({type(error).__name__}); export it again"
        ) from None
    geometries: list[Any] = [g for g in scene.geometry.values() if isinstance(g, trimesh.Trimesh)]
    return {geometry.visual.material.name: geometry for geometry in geometries}


def _nodes(header: dict[str, Any], path: Path) -> list[_Node]:
    """The nodes of the file's scene that have a mesh, with their transforms to the scene's axes."""
    nodes = header.get("nodes", [])
    scenes = header.get("scenes")
    roots = scenes[header.get("scene", 0)].get("nodes", []) if scenes else range(len(nodes))
    result = []
    seen: set[int] = set()
    stack = [(index, np.eye(4)) for index in reversed(list(roots))]
    while stack:
        index, above = stack.pop()
        if index in seen:
            raise InputError(f"{path}: the nodes form a loop or share children; export it again")
        seen.add(index)
        node = nodes[index]
        matrix = above @ _local(node)
        if "mesh" in node:
            result.append(_Node(node.get("name", ""), node["mesh"], matrix))
        stack.extend((child, matrix) for child in reversed(node.get("children", [])))
    return result


def _local(node: dict[str, Any]) -> FloatArray:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix[:3, :3] = matrix_from_quaternion(np.array([w, x, y, z])) * node.get("scale", (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


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


def _material(file: _File, index: int | None) -> tuple[Material, _Transform | None]:
    if index is None:
        return Material("plain", metallic=0.0, roughness=0.8, base_color=(0.7, 0.7, 0.7)), None
    record = file.header["materials"][index]
    name = f"{index}_{record.get('name', 'material')}"
    transforms: list[_Transform | None] = []

    def picture(texture: dict[str, Any] | None) -> AnyArray | None:
        if texture is None:
            return None
        transforms.append(_transform(file, texture))
        return _picture(file, texture["index"])

    glossy = record.get("extensions", {}).get(_GLOSSY)
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


def _transform(file: _File, texture: dict[str, Any]) -> _Transform | None:
    given = texture.get("extensions", {}).get("KHR_texture_transform")
    if texture.get("texCoord", 0) != 0 or (given or {}).get("texCoord", 0) != 0:
        raise InputError(
            f"{file.path}: a texture uses a second set of coordinates; export it with one set only"
        )
    if given is None:
        return None
    offset, scale = given.get("offset", (0.0, 0.0)), given.get("scale", (1.0, 1.0))
    return (offset[0], offset[1]), float(given.get("rotation", 0.0)), (scale[0], scale[1])


def _picture(file: _File, index: int) -> AnyArray:
    texture = file.header["textures"][index]
    source = texture.get("source")
    for extension in texture.get("extensions", {}).values():
        source = extension.get("source", source)
    if source is None:
        raise InputError(f"{file.path}: texture {index} has no picture; export it again")
    image = file.header["images"][source]
    data = _content(file.path, image["uri"]) if "uri" in image else _view(file, image["bufferView"])
    return decoded(data, file.path, f"picture {image.get('name') or source}")


def _view(file: _File, index: int) -> bytes:
    """The bytes of a buffer view."""
    view = file.header["bufferViews"][index]
    start = view.get("byteOffset", 0)
    data: bytes = file.buffers[view["buffer"]][start : start + view["byteLength"]]
    return data


def _scaled(bumps: AnyArray, scale: float) -> AnyArray:
    if scale == 1.0:
        return bumps
    normal = (bumps / 127.5 - 1.0) * (scale, scale, 1.0)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    return np.asarray(np.rint(127.5 * (normal + 1.0)), dtype=np.uint8)
