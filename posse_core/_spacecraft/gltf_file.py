"""The JSON, the buffers and the accessors of a glTF 2.0 file.

Source: Khronos glTF 2.0 specification, sections 3.6 and 4.4.
"""

from __future__ import annotations

import base64
import binascii
import importlib.util
import os
import struct
import urllib.parse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._files.reading import parsed_json, read_bytes
from posse_core._spacecraft.draco import MOST_VALUES

DRACO = "KHR_draco_mesh_compression"
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
_READ = {DRACO, GLOSSY, "EXT_texture_webp", "KHR_texture_transform", "KHR_mesh_quantization"}
_HARMLESS = ("KHR_materials_", "KHR_lights_")
_LISTS = (
    *("accessors", "animations", "buffers", "bufferViews", "images", "materials", "meshes", "nodes"),
    *("samplers", "scenes", "textures"),
)
"""Keys of a header whose values are lists of objects."""

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Component types of accessors, as NumPy names them."""
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class GltfFile:
    """A file as it was read.

    Attributes:
        path: of the file.
        header: its JSON.
        buffers: its buffers, of its own and of other files.
    """

    path: Path
    header: dict[str, Any]
    buffers: list[bytes]


def open_gltf(path: Path) -> GltfFile:
    """Open a .gltf or .glb file.

    Raises:
        InputError: it is not such a file, or needs an extension or another file that cannot be read.
    """
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
    _check_lists(path, header)
    _check_extensions(path, header)
    _check_counts(path, header)
    buffers = [
        content(path, buffer["uri"]) if "uri" in buffer else binary
        for buffer in header.get("buffers", [])
    ]
    return GltfFile(path, header, buffers)


def _check_lists(path: Path, header: dict[str, Any]) -> None:
    for key in _LISTS:
        entries = header.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise InputError(f"{path}: {key} is not a list of objects; export it again")


def _check_extensions(path: Path, header: dict[str, Any]) -> None:
    for extension in header.get("extensionsRequired", []):
        if extension not in _READ and not extension.startswith(_HARMLESS):
            raise InputError(
                f"{path}: needs the glTF extension {extension}, which cannot be read;"
                " export it without compression or with Draco"
            )
    used = {*header.get("extensionsUsed", []), *header.get("extensionsRequired", [])}
    if DRACO in used and importlib.util.find_spec("DracoPy") is None:
        raise InputError(
            f"{path}: compressed with Draco, but the decoder is not installed;"
            " pip install 'posse-core[draco]', or export it without Draco"
        )


def _check_counts(path: Path, header: dict[str, Any]) -> None:
    for accessor in header.get("accessors", []):
        count = accessor.get("count")
        if not isinstance(count, int | float) or not 0 <= count <= MOST_VALUES:
            raise InputError(f"{path}: an accessor has {count} values; export it again")


def content(path: Path, uri: str) -> bytes:
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
    header = open_gltf(path).header
    uris = [item.get("uri", "data:") for key in ("buffers", "images") for item in header.get(key, [])]
    return [urllib.parse.unquote(uri) for uri in uris if not uri.startswith("data:")]


def view(file: GltfFile, index: int) -> bytes:
    """The bytes of a buffer view."""
    record = file.header["bufferViews"][index]
    start = record.get("byteOffset", 0)
    data: bytes = file.buffers[record["buffer"]][start : start + record["byteLength"]]
    return data


def accessed(file: GltfFile, index: int) -> FloatArray:
    """(N, C) the values of an accessor of scalars or vectors; normalised integers are −1 … 1.

    Raises:
        InputError: it is sparse.
        ValueError: the buffer view is too short, or a value is not finite.
    """
    accessor = file.header["accessors"][index]
    if "sparse" in accessor or "bufferView" not in accessor:
        raise InputError(
            f"{file.path}: accessor {index} is sparse, which cannot be read; export it again"
        )
    dtype, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
    start, stride = accessor.get("byteOffset", 0), width * dtype.itemsize
    stride = file.header["bufferViews"][accessor["bufferView"]].get("byteStride", stride)
    count, data = accessor["count"], view(file, accessor["bufferView"])
    if count and start + (count - 1) * stride + width * dtype.itemsize > len(data):
        raise ValueError(f"accessor {index} is longer than its buffer view")
    values = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize)).astype(np.float64)
    if accessor.get("normalized", False):
        values = np.maximum(values / np.iinfo(dtype).max, -1.0)
    if not np.isfinite(values).all():
        raise ValueError(f"accessor {index} has numbers that are not finite")
    return values
