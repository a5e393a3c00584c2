"""What a glTF material's alpha makes transparent is not in the mesh."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from posse_core._spacecraft.cutouts import Alpha, cut_out
from posse_core._spacecraft.raw import raw_part
from posse_core._spacecraft.reader import read_mesh
from tests.support.animated_gltf import AnimatedScene


def plate(uv_low, uv_high):
    """A plate of 2 × 1 units in the xy plane, and texture coordinates of its corners."""
    vertices = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], dtype=float)
    share = vertices[:, :2] / (2, 1)
    uv = np.array(uv_low) + share * (np.array(uv_high) - uv_low)
    normals = np.tile((0.0, 0.0, 1.0), (4, 1))
    return raw_part("plate", vertices, np.array([(0, 1, 2), (0, 2, 3)]), normals, uv, "paint")


def is_there(part, points):
    """Whether a ray down to each point (N, 2) of the plane hits the part."""
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    start = np.column_stack([points, np.ones(len(points))])
    return mesh.ray.intersects_any(start, np.tile((0.0, 0.0, -1.0), (len(points), 1)))


@given(
    seed=st.integers(0, 2**32 - 1),
    sides=st.tuples(*[st.sampled_from([1, 2, 4, 8])] * 2),
    tiles=st.tuples(*[st.sampled_from([-2, -1, 1, 2])] * 2),
)
def test_each_texel_is_there_or_not(seed, sides, tiles):
    """Also where the texture repeats, or is a mirror image."""
    rng = np.random.default_rng(seed)
    texture = rng.integers(0, 256, sides, dtype=np.uint8)
    low = rng.integers(-2, 3, 2)
    part = plate(low, low + np.array(tiles))
    cut = cut_out(part, Alpha(0.8, texture, 0.4))
    points = rng.uniform(0, 1, (400, 2))
    places = (low + points * tiles) * (sides[1], sides[0])
    points = points[(np.abs(places - np.round(places)) > 1e-2).all(axis=1)]
    uv = low + points * tiles
    column = np.floor(uv[:, 0] % 1 * sides[1]).astype(int)
    row = np.floor((1 - uv[:, 1]) % 1 * sides[0]).astype(int)
    solid = 0.8 * texture[row, column] / 255 >= 0.4
    if len(cut.faces) == 0:
        assert not solid.any()
    else:
        np.testing.assert_array_equal(is_there(cut, points * (2, 1)), solid)
    # What is left has the coordinates and normals that it had.
    np.testing.assert_allclose(cut.uv, low + cut.vertices[:, :2] / (2, 1) * tiles, atol=1e-5)
    np.testing.assert_array_equal(cut.normals, np.tile((0, 0, 1), (len(cut.vertices), 1)))


def test_a_border_anywhere_is_within_a_texel():
    """A disc in a texture of 64 texels, on a part of it that lies across the texels."""
    row, column = np.mgrid[:64, :64] - 31.5
    texture = np.where(np.hypot(row, column) < 25, 255, 0).astype(np.uint8)
    cut = cut_out(plate((0.013, 0.057), (0.951, 0.989)), Alpha(1.0, texture, 0.5))
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 1, (4000, 2))
    uv = (0.013, 0.057) + points * (0.951 - 0.013, 0.989 - 0.057)
    distance = np.hypot(*((uv - 0.5) * 64).T) - 25
    clear = np.abs(distance) > 1.5
    np.testing.assert_array_equal(is_there(cut, points * (2, 1))[clear], distance[clear] < 0)
    assert len(cut.faces) < 3000


def test_opaque_parts_are_left_as_they_are():
    part = plate((0, 0), (1, 1))
    assert cut_out(part, Alpha(1.0, np.full((4, 4), 200, dtype=np.uint8), 0.5)) is part


def test_a_lattice_that_is_too_fine_is_divided_no_further():
    texture = np.random.default_rng(0).integers(0, 2, (1024, 1024), dtype=np.uint8) * 255
    cut = cut_out(plate((0, 0), (3, 3)), Alpha(1.0, texture, 0.5))
    assert len(cut.faces) <= 200_000
    area = trimesh.Trimesh(cut.vertices, cut.faces, process=False).area
    assert area == pytest.approx(1.0, abs=0.05)  # half of 2 × 1


# Files


def textured(tmp_path, picture=None, **material):
    """A box and a plate in front of it, whose material is given; the plate's picture is (H, W, 4)."""
    scene = AnimatedScene()
    scene.add("bus", None, trimesh.creation.box((1, 1, 1)))
    flat = trimesh.Trimesh(
        [(-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)], [(0, 1, 2), (0, 2, 3)], process=False
    )
    scene.add("decal", None, flat)

    def paint(header):
        colors = {"baseColorFactor": material.pop("color", [1, 1, 1, 1])}
        if picture is not None:
            done, data = cv2.imencode(".png", picture)
            assert done
            (tmp_path / "decal.png").write_bytes(data.tobytes())
            (tmp_path / "uv.bin").write_bytes(
                np.array([(0, 1), (1, 1), (1, 0), (0, 0)], dtype="<f4").tobytes()
            )
            header["buffers"].append({"uri": "uv.bin", "byteLength": 32})
            header["bufferViews"].append({"buffer": 1, "byteLength": 32})
            header["accessors"].append(
                {
                    "bufferView": len(header["bufferViews"]) - 1,
                    "componentType": 5126,
                    "count": 4,
                    "type": "VEC2",
                }
            )
            header["images"] = [{"uri": "decal.png"}]
            header["textures"] = [{"source": 0}]
            colors["baseColorTexture"] = {"index": 0}
            attributes = header["meshes"][1]["primitives"][0]["attributes"]
            attributes["TEXCOORD_0"] = len(header["accessors"]) - 1
        header["materials"] = [{"pbrMetallicRoughness": colors, **material}]
        header["meshes"][1]["primitives"][0]["material"] = 0

    return read_mesh(scene.write(tmp_path / "a.glb", paint))


def area_of(raw, name):
    (part,) = (part for part in raw.parts if part.name == name)
    return trimesh.Trimesh(part.vertices, part.faces, process=False).area


CORNER = np.full((2, 2, 4), 255, dtype=np.uint8)
CORNER[0, 0, 3] = 100  # 0.39; the upper left quarter


@pytest.mark.parametrize(
    ("material", "quarters"),
    [
        ({}, 4),  # opaque, whatever the picture says
        ({"alphaMode": "MASK"}, 3),
        ({"alphaMode": "MASK", "alphaCutoff": 0.3}, 4),
        ({"alphaMode": "BLEND"}, 3),
        ({"alphaMode": "MASK", "alphaCutoff": 0.3, "color": [1, 1, 1, 0.6]}, 3),
    ],
)
def test_alpha_of_pictures_is_cut_out(tmp_path, material, quarters):
    raw = textured(tmp_path, CORNER, **material)
    assert area_of(raw, "decal") == pytest.approx(quarters)
    assert area_of(raw, "bus") == pytest.approx(6)
    if quarters == 3:
        (part,) = (part for part in raw.parts if part.name == "decal")
        points = np.array([(-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])
        lifted = part.vertices - (0, 0, 2)
        mesh = trimesh.Trimesh(lifted, part.faces, process=False)
        start = np.column_stack([points, np.ones(4)])
        hit = mesh.ray.intersects_any(start, np.tile((0.0, 0.0, -1.0), (4, 1)))
        np.testing.assert_array_equal(hit, [False, True, True, True])


def test_a_transparent_part_is_left_out_with_a_warning(tmp_path):
    with pytest.warns(UserWarning, match=r"a\.glb: transparent and so left out: decal"):
        raw = textured(tmp_path, alphaMode="BLEND", color=[1, 1, 1, 0.2])
    assert [part.name for part in raw.parts] == ["bus"]


def test_a_picture_without_alpha_is_opaque(tmp_path):
    raw = textured(tmp_path, CORNER[..., :3], alphaMode="BLEND")
    assert area_of(raw, "decal") == pytest.approx(4)
