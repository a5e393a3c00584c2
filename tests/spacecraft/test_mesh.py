"""Users' mesh files: the spacecraft made from them, and the messages with which they are refused."""

from __future__ import annotations

import json
import re
import struct
import sys

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins
from posse_core._spacecraft.reader import obj_side_files, read_mesh

AXES = [
    f"{'-' if s[0] < 0 else ''}{p[0]} {'-' if s[1] < 0 else ''}{p[1]} {'-' if s[2] < 0 else ''}{p[2]}"
    for p in ("xyz", "yzx", "zxy", "xzy", "zyx", "yxz")
    for s in [(a, b, c) for a in (1, -1) for b in (1, -1) for c in (1, -1)]
]


def build(path, source="mesh", **options):
    registry = load_plugins().registry
    raw = {source: str(path), **options}
    return registry.create("scene", source, registry.options("scene", source, raw)).build()


def refusal(path, source="mesh", **options):
    """The one-line message with which the file is refused."""
    with pytest.raises(InputError) as caught:
        build(path, source, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message


def wedge():
    """A closed solid of 1 × 2 × 3 units without any symmetry, with its right-angled corner at the
    origin."""
    return trimesh.Trimesh(
        [(0, 0, 0), (1, 0, 0), (0, 2, 0), (0, 0, 3)],
        [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)],
        process=False,
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with the wedge in every format."""
    folder = tmp_path_factory.mktemp("wedge")
    for suffix in ("glb", "obj", "ply", "stl"):
        wedge().export(folder / f"wedge.{suffix}")
    for name, data in trimesh.exchange.gltf.export_gltf(wedge().scene()).items():
        (folder / name.replace("model.", "wedge.")).write_bytes(data)
    return folder


def glb(header, binary=b""):
    """The bytes of a GLB file."""
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def triangle_glb(picture=None, material=None, node=None, mesh_name="plate", **extra):
    """One triangle (0,0,0), (1,0,0), (0,1,0) with uv, and a material with a WebP picture."""
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], dtype="<f4")
    uv = np.array([(0.25, 0.25), (0.75, 0.25), (0.25, 0.75)], dtype="<f4")
    blobs = [points.tobytes(), uv.tobytes()] + ([picture] if picture else [])
    views, transform = [], 0
    for blob in blobs:
        views.append({"buffer": 0, "byteOffset": transform, "byteLength": len(blob)})
        transform += len(blob) + -len(blob) % 4
    binary = b"".join(blob + b"\0" * (-len(blob) % 4) for blob in blobs)
    bounds = {"min": [0, 0, 0], "max": [1, 1, 0]}
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node or {"mesh": 0}],
        "meshes": [
            {
                "name": mesh_name,
                "primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}],
            }
        ],
        "materials": [material or {"pbrMetallicRoughness": {}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", **bounds},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
        **extra,
    }
    if picture:
        header["images"] = [{"bufferView": 2, "mimeType": "image/webp"}]
        header["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
        header["extensionsRequired"] = header["extensionsUsed"] = ["EXT_texture_webp"]
    return glb(header, binary)


# Valid meshes


@given(axes=st.sampled_from(AXES), scale=st.floats(0.005, 300.0), suffix=st.sampled_from(["glb", "ply"]))
def test_units_and_axes_give_a_scaled_rotation(files, axes, scale, suffix):
    words = [(-1.0 if w[0] == "-" else 1.0, "xyz".index(w[-1])) for w in axes.split()]
    R = np.zeros((3, 3))
    for row, (sign, axis) in enumerate(words):
        R[row, axis] = sign
    path = files / f"wedge.{suffix}"
    options = {"scale_m_per_unit": scale, "body_axes": axes, "centre_of_mass_m": (0, 0, 0)}
    if np.linalg.det(R) < 0.0:
        message = refusal(path, **options)
        # Each alternative that the message offers is a rotation.
        offers = re.findall(r"'([^']+)'", message.split("; use ")[1].split("(it is")[0])
        assert len(offers) == 3
        for offer in offers:
            build(path, **{**options, "body_axes": offer})
        return
    craft = build(path, **options)
    (part,) = craft.parts
    corners = {tuple(np.round(v / scale, 5) + 0.0) for v in part.vertices_body_m}
    assert corners == {tuple(np.round(R @ v, 5) + 0.0) for v in wedge().vertices}
    volume = trimesh.Trimesh(part.vertices_body_m, part.faces, process=False).volume
    assert volume == pytest.approx(
        scale**3, rel=1e-5
    )  # 1·2·3/6 = 1; positive if the faces point outward


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl"])
def test_every_format_gives_the_same_solid(files, suffix):
    craft = build(files / f"wedge.{suffix}", scale_m_per_unit=2.0)
    (part,) = craft.parts
    mesh = trimesh.Trimesh(part.vertices_body_m, part.faces, process=False)
    assert mesh.volume == pytest.approx(8.0, rel=1e-6)
    np.testing.assert_allclose(np.ptp(part.vertices_body_m, axis=0), (2.0, 4.0, 6.0), rtol=1e-6)
    # If no centre of mass is given, the origin is the centroid of the surface.
    np.testing.assert_allclose(mesh.triangles_center.T @ mesh.area_faces, 0.0, atol=1e-5)


def test_a_mesh_without_normals_has_hard_edges_and_smooth_round_surfaces(tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    trimesh.creation.icosphere(subdivisions=4).export(tmp_path / "ball.stl")
    (box,) = build(tmp_path / "box.stl", scale_m_per_unit=1.0).parts
    assert set(np.abs(box.normals_body).max(axis=1)) == {1.0}
    (ball,) = build(tmp_path / "ball.stl", scale_m_per_unit=1.0).parts
    radial = ball.vertices_body_m / np.linalg.norm(ball.vertices_body_m, axis=1, keepdims=True)
    assert (radial * ball.normals_body).sum(axis=1).min() > 0.9999


def test_parts_are_the_nodes_of_the_scene_with_their_transforms(tmp_path):
    scene = trimesh.Scene()
    for name, x in (("bus", 0.0), ("left wing", 3.0), ("left_wing", -3.0)):
        transform = np.diag([2.0, 1.0, -1.0, 1.0])  # stretched and mirrored
        transform[0, 3] = x
        scene.add_geometry(
            trimesh.creation.box((1, 1, 1)), node_name=name, geom_name=name, transform=transform
        )
    scene.export(tmp_path / "a.glb")
    craft = build(tmp_path / "a.glb", scale_m_per_unit=1.0, centre_of_mass_m=(0.0, 0.0, 0.0))
    centers = {part.name: part.vertices_body_m.mean(axis=0)[0] for part in craft.parts}
    assert set(centers) == {"bus", "left_wing", "left_wing_2"}
    assert sorted(round(x, 6) for x in centers.values()) == [-3.0, 0.0, 3.0]
    for part in craft.parts:
        assert trimesh.Trimesh(part.vertices_body_m, part.faces).volume == pytest.approx(2.0)


def test_a_file_without_names_gets_numbered_parts(tmp_path):
    (tmp_path / "a.glb").write_bytes(triangle_glb(mesh_name=""))
    (part,) = build(tmp_path / "a.glb", scale_m_per_unit=1.0).parts
    assert part.name == "part_0"


def test_gltf_factors_stay_floats_and_webp_is_decoded(tmp_path):
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:4] = (200, 40, 10)  # the upper half red
    picture[4:] = (10, 40, 200)
    done, data = cv2.imencode(".webp", picture[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 101])
    assert done
    material = {
        "name": "panel",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.0123, 0.5, 1.0, 1.0],
            "metallicFactor": 0.25,
            "roughnessFactor": 0.333,
            "baseColorTexture": {"index": 0},
        },
    }
    (tmp_path / "a.glb").write_bytes(triangle_glb(data.tobytes(), material))
    craft = build(tmp_path / "a.glb", scale_m_per_unit=1.0)
    (part,) = craft.parts
    made = craft.materials[part.material]
    assert made.base_color == (0.0123, 0.5, 1.0)
    assert (made.metallic, made.roughness) == (0.25, 0.333)
    np.testing.assert_allclose(made.base_color_texture, picture, atol=2)
    # glTF's v points down from the top of the picture; POSSE's v points up from its bottom.
    np.testing.assert_allclose(part.uv, [(0.25, 0.75), (0.75, 0.75), (0.25, 0.25)], atol=1e-6)


def test_a_texture_transform_changes_the_coordinates(tmp_path):
    """The example of KHR_texture_transform: offset, quarter turn and scale of uv with v pointing
    down."""
    done, data = cv2.imencode(".webp", np.zeros((4, 4, 3), np.uint8))
    assert done
    transform = {"offset": [0.1, 0.2], "rotation": np.pi / 2.0, "scale": [2.0, 3.0]}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    material = {"pbrMetallicRoughness": {"baseColorTexture": texture}}
    (tmp_path / "a.glb").write_bytes(triangle_glb(data.tobytes(), material))
    (part,) = build(tmp_path / "a.glb", scale_m_per_unit=1.0).parts
    uv = np.array([(0.25, 0.25), (0.75, 0.25), (0.25, 0.75)])
    # translation · rotation · scale, rotation = [[cos, sin], [−sin, cos]] (the extension's GLSL).
    moved = np.column_stack([3.0 * uv[:, 1] + 0.1, -2.0 * uv[:, 0] + 0.2])
    np.testing.assert_allclose(part.uv, np.column_stack([moved[:, 0], 1.0 - moved[:, 1]]), atol=1e-6)


def test_vertex_colours_become_a_palette(tmp_path):
    mesh = trimesh.creation.box((1, 1, 1))
    mesh.unmerge_vertices()
    colors = np.repeat(np.random.default_rng(0).integers(0, 256, (12, 3)), 3, axis=0)
    mesh.visual.vertex_colors = np.column_stack([colors, np.full(36, 255)]).astype(np.uint8)
    for suffix in ("ply", "glb"):
        mesh.export(tmp_path / f"a.{suffix}")
        craft = build(tmp_path / f"a.{suffix}", scale_m_per_unit=1.0)
        (part,) = craft.parts
        texture = craft.materials[part.material].base_color_texture
        height, width = texture.shape[:2]
        column = np.floor(part.uv[:, 0] * width).astype(int)
        row = np.floor((1.0 - part.uv[:, 1]) * height).astype(int)
        seen = texture[row, column][part.faces[:, 0]]
        np.testing.assert_array_equal(seen, colors[::3])


@given(names=st.lists(st.sampled_from(["", "gold foil", "plain", "paint"]), min_size=1, max_size=4))
def test_materials_of_gltf_have_their_own_names(tmp_path_factory, names):
    """Those that share a name, have none, or are called like the material of parts without one, too."""
    header = json.loads(triangle_glb()[20 : 20 + struct.unpack("<I", triangle_glb()[12:16])[0]])
    primitives = [{**header["meshes"][0]["primitives"][0], "material": k} for k in range(len(names))]
    bare = {"attributes": {"POSITION": 0}}
    finishes = [
        {"name": name, "pbrMetallicRoughness": {"roughnessFactor": (k + 1) / 8}}
        for k, name in enumerate(names)
    ]
    path = tmp_path_factory.mktemp("named") / "a.glb"
    path.write_bytes(
        triangle_glb(materials=finishes, meshes=[{"name": "plate", "primitives": [*primitives, bare]}])
    )
    raw = read_mesh(path)
    assert len(raw.parts) == len(names) + 1
    for k, (name, part) in enumerate(zip(names, raw.parts, strict=False)):
        assert part.material.startswith((name or "material").replace(" ", "_"))
        assert raw.materials[part.material].roughness == (k + 1) / 8
        if names.count(name) == 1 and name not in ("", "plain"):
            assert part.material == name.replace(" ", "_")


def test_obj_materials_and_groups(tmp_path):
    cv2.imwrite(str(tmp_path / "cells.png"), np.full((4, 4, 3), (10, 20, 30), np.uint8))
    (tmp_path / "a.mtl").write_text(
        "newmtl foil\nKd 0.8 0.6 0.2\nPm 1\nPr 0.3\nnewmtl cells\nKd 0.5 0.5 0.5\nmap_Kd cells.png\n"
    )
    lines = ["mtllib a.mtl", "v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "vt 0 0", "vt 1 0", "vt 0 1"]
    lines += ["o bus", "usemtl foil", "f 1/1 3/3 2/2", "f 1/1 2/2 4/3"]
    lines += ["o wing", "usemtl cells", "f 2/2 3/3 4/1", "f 1/1 4/2 3/3"]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    craft = build(tmp_path / "a.obj", scale_m_per_unit=1.0)
    looks = {part.name.split("_")[0]: craft.materials[part.material] for part in craft.parts}
    assert looks["bus"].base_color == (0.8, 0.6, 0.2)
    assert (looks["bus"].metallic, looks["bus"].roughness) == (1.0, 0.3)
    assert tuple(looks["wing"].base_color_texture[0, 0]) == (30, 20, 10)


# Meshes that are refused


@pytest.mark.parametrize("key", ["images", "buffers", "meshes", "animations"])
@pytest.mark.parametrize("value", ["x", ["x"], {"a": {}}])
def test_a_gltf_key_that_is_no_list_of_objects_is_told(tmp_path, key, value):
    (tmp_path / "a.glb").write_bytes(triangle_glb(**{key: value}))
    with pytest.raises(InputError, match=f"{key} is not a list of objects"):
        read_mesh(tmp_path / "a.glb")


@pytest.mark.parametrize("line", ["Kd 1 nan 0", "Kd 1 0", "Ns nan", "Pr nan", "Pm x"])
def test_a_material_with_what_is_no_number_is_told_by_its_line(tmp_path, line):
    (tmp_path / "a.mtl").write_text(f"newmtl foil\n{line}\n")
    faces = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl foil\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(faces)
    with pytest.raises(InputError, match=rf"a\.mtl, line 2: '{line}' is not understood"):
        read_mesh(tmp_path / "a.obj")


def test_the_message_about_a_missing_scale_names_the_size_and_the_key(files):
    message = refusal(files / "wedge.stl")
    assert "scale_m_per_unit" in message
    assert "1 × 2 × 3" in message
    assert "3 m" in message


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("empty.glb", b"", ["empty"]),
        ("noise.glb", b"\x00\xffnoise" * 20, ["not a glTF file"]),
        ("cut.glb", triangle_glb()[:200], ["glTF"]),
        ("noise.ply", b"ply\nnoise", ["PLY"]),
        ("noise.obj", b"this is no mesh", ["no triangles"]),
        ("points.obj", b"v 0 0 0\nv 1 1 1\n", ["no triangles"]),
        ("flat.obj", b"v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n", ["no triangles"]),
        ("nan.obj", b"v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", ["NaN", "1 of 3"]),
        ("model.step", b"ISO-10303-21;", [".step", ".glb"]),
        ("away.obj", b"mtllib ../../etc/x.mtl\nv 0 0 0\nf 1 1 1\n", ["outside its folder"]),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    message = refusal(tmp_path / name, scale_m_per_unit=1.0)
    assert name in message or "mtl" in message
    for word in words:
        assert word in message


def test_nan_in_gltf_is_refused(tmp_path):
    data = triangle_glb().replace(struct.pack("<f", 1.0), struct.pack("<f", float("nan")), 1)
    (tmp_path / "a.glb").write_bytes(data)
    assert "NaN" in refusal(tmp_path / "a.glb", scale_m_per_unit=1.0)


def test_missing_files_and_folders_are_refused(tmp_path):
    assert "no such mesh" in refusal(tmp_path / "none.glb", scale_m_per_unit=1.0)
    (tmp_path / "folder.glb").mkdir()
    assert "folder" in refusal(tmp_path / "folder.glb", scale_m_per_unit=1.0)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_an_implausible_scale_is_refused_with_the_size(files, scale):
    assert f"{3.0 * scale:.4g} m" in refusal(files / "wedge.ply", scale_m_per_unit=scale)


@pytest.mark.parametrize("axes", ["x y", "x y y", "x y w", "x y zz", "x --y z", ""])
def test_invalid_axes_are_refused(files, axes):
    assert "body_axes" in refusal(files / "wedge.ply", scale_m_per_unit=1.0, body_axes=axes)


def test_draco_without_its_decoder_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "DracoPy", None)  # as if it were not installed
    used = ["KHR_draco_mesh_compression"]
    (tmp_path / "a.glb").write_bytes(triangle_glb(extensionsUsed=used, extensionsRequired=used))
    message = refusal(tmp_path / "a.glb", scale_m_per_unit=1.0)
    assert "Draco" in message
    assert "pip install" in message


def test_draco_is_read_with_its_decoder(tmp_path):
    pytest.importorskip("DracoPy")
    ball = trimesh.creation.icosphere()
    (tmp_path / "a.glb").write_bytes(trimesh.exchange.gltf.export_glb(ball, extension_draco=True))
    assert b"KHR_draco_mesh_compression" in (tmp_path / "a.glb").read_bytes()
    (part,) = build(tmp_path / "a.glb", scale_m_per_unit=1.0).parts
    volume = trimesh.Trimesh(part.vertices_body_m, part.faces, process=False).volume
    assert volume == pytest.approx(ball.volume, rel=1e-3)


def test_damaged_draco_is_refused_in_one_line(tmp_path, caplog):
    pytest.importorskip("DracoPy")
    ball = trimesh.creation.icosphere()
    data = trimesh.exchange.gltf.export_glb(ball, extension_draco=True)
    (tmp_path / "a.glb").write_bytes(data.replace(b"DRACO\x02", b"DRAC0\x02"))
    assert "export it again" in refusal(tmp_path / "a.glb", scale_m_per_unit=1.0)
    assert not caplog.records


def test_unreadable_extensions_are_named(tmp_path):
    (tmp_path / "a.glb").write_bytes(triangle_glb(extensionsRequired=["EXT_meshopt_compression"]))
    assert "EXT_meshopt_compression" in refusal(tmp_path / "a.glb", scale_m_per_unit=1.0)


def test_a_loop_of_nodes_is_refused(tmp_path):
    (tmp_path / "a.glb").write_bytes(triangle_glb(node={"mesh": 0, "children": [0]}))
    assert "loop" in refusal(tmp_path / "a.glb", scale_m_per_unit=1.0)


def test_a_picture_that_cannot_be_decoded_is_refused(tmp_path):
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    (tmp_path / "a.glb").write_bytes(triangle_glb(b"no picture", material))
    assert "cannot be decoded" in refusal(tmp_path / "a.glb", scale_m_per_unit=1.0)


# Keypoints


def test_keypoints_come_from_a_file(files, tmp_path):
    record = {"keypoints": {"T1": [0.1, 0.0, 0.0], "B1": [0, 0, 0.5]}, "skeleton": [["T1", "B1"]]}
    (tmp_path / "k.json").write_text(json.dumps({"name": "wedge", **record}))
    craft = build(files / "wedge.ply", scale_m_per_unit=1.0, keypoints=str(tmp_path / "k.json"))
    assert list(craft.keypoints_body_m) == ["T1", "B1"]
    np.testing.assert_array_equal(craft.keypoints_body_m["T1"], (0.1, 0.0, 0.0))
    assert craft.skeleton == (("T1", "B1"),)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("keypoints: {T1: [100, 0, 0]}", "outside"),
        ("keypoints: {T1: [1, 2]}", "keypoints.T1"),
        ("keypoints: {T1: [.nan, 0, 0]}", "keypoints.T1"),
        ("keypoints: {T1: [0, 0, 0]}\nskeleton: [[T1, T9]]", "T9"),
        ("keypoints: {T1: [0, 0, 0]}\nsymmetries: [[[1,0,0],[0,1,0],[0,0,-1]]]", "rotation"),
        ("[1, 2]", "mapping"),
        ("keypoints: {T1: [0, 0", "line 1"),
        ("{}", "keypoints"),
    ],
)
def test_invalid_keypoints_are_refused(files, tmp_path, text, word):
    (tmp_path / "k.yaml").write_text(text)
    message = refusal(files / "wedge.ply", scale_m_per_unit=1.0, keypoints=str(tmp_path / "k.yaml"))
    assert word in message
    assert "k.yaml" in message


# Packages


def package(folder, files, **changes):
    folder.mkdir()
    (folder / "wedge.ply").write_bytes((files / "wedge.ply").read_bytes())
    record = {
        "name": "wedge",
        "mesh": "wedge.ply",
        "scale_m_per_unit": 1.0,
        "body_axes": "x y z",
        "centre_of_mass_m": [0.1, 0.2, 0.3],
        "keypoints": {"T1": [-0.1, -0.2, -0.3]},
        **changes,
    }
    (folder / "spacecraft.yaml").write_text(json.dumps(record))
    return folder


def test_a_package_gives_a_spacecraft(files, tmp_path):
    craft = build(package(tmp_path / "p", files), source="package")
    assert craft.name == "wedge"
    np.testing.assert_allclose(craft.bounds_body_m[0], (-0.1, -0.2, -0.3), atol=1e-6)
    assert list(craft.keypoints_body_m) == ["T1"]


@pytest.mark.parametrize(
    "mesh", ["../wedge.ply", "/etc/wedge.ply", "a/../../wedge.ply", "..\\wedge.ply"]
)
def test_a_package_cannot_name_files_outside(files, tmp_path, mesh):
    folder = package(tmp_path / "p", files, mesh=mesh)
    assert "outside the package" in refusal(folder, source="package")


def test_a_package_cannot_link_outside(files, tmp_path):
    folder = package(tmp_path / "p", files, mesh="link.ply")
    (folder / "link.ply").symlink_to(files / "wedge.ply")
    assert "leads out of the package" in refusal(folder, source="package")


def test_faults_of_a_package_are_reported(files, tmp_path):
    assert "no such package" in refusal(tmp_path / "none", source="package")
    (tmp_path / "bare").mkdir()
    assert "spacecraft.yaml" in refusal(tmp_path / "bare", source="package")
    assert "did you mean 'mesh'" in refusal(package(tmp_path / "p", files, mehs="x"), source="package")


def test_an_obj_file_without_its_material_library_is_grey(tmp_path):
    """With a warning that names the file."""
    (tmp_path / "lost.obj").write_text(
        "mtllib lost.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl foil\nf 1 2 3\n"
    )
    with pytest.warns(UserWarning, match=r"lost\.obj: its material library 'lost\.mtl' is missing"):
        raw = read_mesh(tmp_path / "lost.obj")
    (part,) = raw.parts
    red, green, blue = raw.materials[part.material].base_color
    assert red == green == blue
    assert obj_side_files(tmp_path / "lost.obj") == []
