"""Files of every kind that are not what their names say: exit code 2, one line, nothing left behind."""

import json
import os
import resource
import zlib

import cuboid
import cv2
import numpy as np
import pytest
import trimesh
from command import run_posse
from small_run import BOX_OBJ, SCENARIO

from posse_core import InputError
from posse_core._dataset.files import read_arrays
from posse_core._files.pictures import decoded_image
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.component import target_named

ORBIT = SCENARIO.replace("renderer: {name: flat, seconds: 0.05}\n", "")


def refused(*arguments, words=()):
    code, _, error = run_posse(*arguments)
    assert code == 2, error
    (line,) = error.splitlines()
    assert line.startswith("posse: ")
    for word in words:
        assert word in line


def names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.fixture
def dataset(tmp_path):
    return cuboid.write_dataset(tmp_path / "d")


# Datasets


def pipe(path):
    path.unlink(missing_ok=True)
    os.mkfifo(path)


def link(path):
    path.symlink_to("nothing")


def deep(path):
    path.write_text('{"a": ' + "[" * 10_000 + "]" * 10_000 + "}")


def changed(**keys):
    def change(path):
        path.write_text(json.dumps({**json.loads(path.read_text()), **keys}))

    return change


@pytest.mark.parametrize(
    ("file", "spoil", "words"),
    [
        ("labels/shard-00001.jsonl", lambda path: path.mkdir(), ["is a folder"]),
        ("labels/shard-00001.jsonl", pipe, ["is a pipe"]),
        ("labels/shard-00001.jsonl", link, ["no such file"]),
        ("camera.json", deep, ["not a camera file", "recursion"]),
        ("camera.json", pipe, ["is a pipe"]),
        ("camera.json", changed(Nu=0), ["Nu", "greater than"]),
        ("camera.json", changed(Nv=-3), ["Nv", "-3"]),
        ("camera.json", changed(cameraMatrix=[[0, 0, 0]] * 3), ["cameraMatrix.0.0"]),
        ("camera.json", changed(ppx=float("nan")), ["ppx", "finite"]),
        ("spacecraft/brick.json", changed(keypoints={"B1": [1, 2]}), ["keypoints.B1.2", "missing"]),
        ("spacecraft/brick.json", changed(symmetries=[[[1], [2, 3], []]]), ["symmetries.0.0.1"]),
        ("spacecraft/brick.json", changed(name="../../x"), ["'../../x'"]),
        ("manifest.json", deep, ["manifest.json"]),
    ],
)
def test_files_of_a_dataset(dataset, tmp_path, file, spoil, words):
    spoil(dataset / file)
    before = names(tmp_path)
    for command in (
        ("export", dataset, "--format", "coco", "--out", tmp_path / "e"),
        ("validate", dataset),
    ):
        refused(*command, words=[file, *words])
    assert names(tmp_path) == before


def test_an_index_beyond_all_numbers_is_a_damaged_line(dataset):
    with open(dataset / "labels/shard-00000.jsonl", "a") as shard:
        shard.write('{"index": 1000000000000000000000000000000, "x": 1}\n')
    refused("view", dataset, words=["shard-00000.jsonl, line 7", "not a label line"])


def test_a_word_too_long_for_a_path_is_no_craft():
    with pytest.raises(InputError, match="no scene named 'xxx"):
        target_named("x" * 5000, load_plugins().registry)


def png_of(width_px, height_px):
    """A PNG whose header claims a size, and whose data are of none."""

    def chunk(kind, data):
        return len(data).to_bytes(4) + kind + data + zlib.crc32(kind + data).to_bytes(4)

    header = width_px.to_bytes(4) + height_px.to_bytes(4) + bytes([8, 0, 0, 0, 0])
    data = zlib.compress(b"\0" * 100)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def test_a_picture_that_claims_a_billion_pixels(dataset, capfd):
    (dataset / "images/000000.png").write_bytes(png_of(32_000, 32_000))
    code, out, error = run_posse("validate", dataset)
    assert code == 1
    assert "000000.png: not an image" in out
    assert len(error.splitlines()) == 1
    assert capfd.readouterr().err == ""


def test_a_damaged_picture_is_told_by_posse_alone(tmp_path, capfd):
    data = cv2.imencode(".png", np.zeros((9, 9), np.uint8))[1].tobytes()
    (tmp_path / "a.png").write_bytes(data[:45] + b"\xff" + data[46:])
    refused("detect", tmp_path / "a.png", words=["a.png: not an image"])
    assert capfd.readouterr().err == ""


def jpeg_of(width_px, height_px):
    """A JPEG whose header claims a size, and that ends soon after."""
    data = bytearray(cv2.imencode(".jpg", np.zeros((16, 16), np.uint8))[1].tobytes())
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = height_px.to_bytes(2) + width_px.to_bytes(2)
    return bytes(data[: at + 300])


def bmp_of(width_px, height_px):
    data = bytearray(cv2.imencode(".bmp", np.zeros((16, 16), np.uint8))[1].tobytes())
    data[18:26] = width_px.to_bytes(4, "little") + height_px.to_bytes(4, "little")
    return bytes(data)


def tiff_of(width_px, height_px):
    data = bytearray(cv2.imencode(".tif", np.zeros((16, 17), np.uint8))[1].tobytes())
    for tag, value in ((256, width_px), (257, height_px)):
        at = data.index(tag.to_bytes(2, "little") + b"\x03\0\x01\0\0\0")
        data[at + 2 : at + 4] = (4).to_bytes(2, "little")
        data[at + 8 : at + 12] = value.to_bytes(4, "little")
    return bytes(data)


@pytest.mark.parametrize(("suffix", "made"), [("jpg", jpeg_of), ("bmp", bmp_of), ("tif", tiff_of)])
def test_a_picture_of_any_format_that_claims_a_billion_pixels_makes_no_room_for_them(
    tmp_path, suffix, made
):
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(made(32_000, 32_000))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert decoded_image(path.read_bytes(), cv2.IMREAD_UNCHANGED) is None
    assert (
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300 << 10
    )  # a byte a pixel: 1 GB


@pytest.mark.parametrize(
    ("suffix", "spoil"),
    [
        ("jpg", lambda data: data[:-120] + b"\xff\xc4" + data[-118:]),
        ("tif", lambda data: data[:8] + b"\x07" * 40 + data[48:]),
        ("bmp", lambda data: data[:-200]),
    ],
)
def test_a_damaged_picture_of_any_format_is_told_by_posse_alone(capfd, suffix, spoil):
    picture = np.arange(64 * 48, dtype=np.uint16).astype(np.uint8).reshape(48, 64)
    decoded_image(spoil(cv2.imencode(f".{suffix}", picture)[1].tobytes()), cv2.IMREAD_UNCHANGED)
    os.write(2, b"what others say is heard again\n")
    assert capfd.readouterr().err == "what others say is heard again\n"


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "bmp", "webp"])
@pytest.mark.parametrize("shape", [(48, 64), (3, 641, 3)])
def test_sound_pictures_are_as_opencv_reads_them(suffix, shape):
    picture = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    data = cv2.imencode(f".{suffix}", picture)[1]
    expected = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(decoded_image(data.tobytes(), cv2.IMREAD_UNCHANGED), expected)


def test_arrays_that_cannot_be_parsed_are_told_in_words(dataset):
    np.savez(dataset / "truth/000001.npz", depth_m=np.zeros(3))
    data = bytearray((dataset / "truth/000001.npz").read_bytes())
    at = data.index(b"'shape': (3,)")
    data[at : at + 13] = b"'shape': (3, "
    (dataset / "truth/000001.npz").write_bytes(data)
    with pytest.raises(InputError, match=r"cannot be read as NPZ: [^(]*$"):
        read_arrays(dataset / "truth/000001.npz")


@pytest.mark.parametrize(
    ("point", "words"),
    [
        ("[0, x, 1]", "k.yaml: keypoints.T1.1: input should be a valid number"),
        ("{at: [0, 0, 1], joint: null, atx: 3}", "keypoints.T1.atx: unknown key; did you mean 'at'?"),
        ("{at: [0, 0, 1], joint: 3}", "keypoints.T1.joint: input should be a valid string"),
        ("{part: box}", "keypoints.T1.corner: missing"),
        ("{corner: [1, 1, z]}", "keypoints.T1."),
        ("3", "keypoints.T1: input should be a valid tuple"),
    ],
)
def test_keypoints_are_told_by_their_keys_alone(tmp_path, point, words):
    (tmp_path / "box.obj").write_text(BOX_OBJ)
    (tmp_path / "k.yaml").write_text(f"keypoints:\n  B1: [0, 0, 1]\n  T1: {point}\n")
    command = ("import", tmp_path / "box.obj", "--out", tmp_path / "p", "--scale", "1")
    refused(*command, "--keypoints", tmp_path / "k.yaml", words=[words])


@pytest.mark.parametrize("form", ["bop", "coco", "colmap", "nerfstudio", "posse", "speed", "yolo"])
def test_an_export_that_fails_leaves_nothing(dataset, tmp_path, form):
    lines = cuboid.read_lines(dataset)
    lines[4]["keypoints"] = lines[4]["q_cam_from_body"] = "none"
    cuboid.write_lines(dataset, lines)
    before = names(tmp_path)
    refused("export", dataset, "--format", form, "--out", tmp_path / "e", words=["frame 4"])
    refused("export", dataset, "--format", form, words=["frame 4"])
    refused("partition", dataset, words=["frame 4"])
    assert names(tmp_path) == before


def test_an_export_leaves_other_files_alone(dataset, tmp_path):
    mine = tmp_path / "e" / "yolo" / "weights.pt"
    mine.parent.mkdir(parents=True)
    mine.write_text("years of work")
    code, _, error = run_posse("export", dataset, "--format", "yolo", "--out", tmp_path / "e")
    assert code == 0, error
    assert mine.read_text() == "years of work"
    assert (tmp_path / "e/yolo/data.yaml").is_file()
    assert not [name for name in names(tmp_path) if "partial" in name]


# Tables, messages and poses


def propagated(tmp_path, *options):
    (tmp_path / "s.yaml").write_text(ORBIT)
    (tmp_path / "box.obj").write_text(BOX_OBJ)
    words = [word for option in options for word in ("-o", option)]
    return ("propagate", tmp_path / "s.yaml", "--out", tmp_path / "out.npz", *words)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("r_target_eci_m", "0", ["t.csv", "no plane"]),
        ("v_target_eci_m_s", "0", ["t.csv", "no plane"]),
        ("v_target_eci_m_s", "nan", ["t.csv", "v_target_eci_m_s", "finite"]),
        ("r_target_eci_m", "1e6", ["below the Earth's surface"]),
    ],
)
def test_a_table_without_an_orbit(tmp_path, column, value, words):
    code, _, error = run_posse(*propagated(tmp_path)[:2], "--out", tmp_path / "t.csv")
    assert code == 0, error
    header, *rows = [line.split(",") for line in (tmp_path / "t.csv").read_text().splitlines()]
    for row in rows:
        row[:] = [value if name.startswith(column) else x for name, x in zip(header, row, strict=True)]
    (tmp_path / "t.csv").write_text("\n".join(map(",".join, [header, *rows])))
    table = ("propagator.name=file", f"propagator.path={tmp_path / 't.csv'}")
    refused(*propagated(tmp_path, *table), words=words)


def test_a_table_whose_last_column_claims_a_billion(tmp_path):
    names_ = ["t_s", *(f"{n}_{x}" for n in ("r_target_eci_m", "v_target_eci_m_s") for x in "xyz")]
    (tmp_path / "t.csv").write_text(",".join([*names_, "extra_x[999999999]"]) + "\n")
    table = ("propagator.name=file", f"propagator.path={tmp_path / 't.csv'}")
    refused(*propagated(tmp_path, *table), words=["t.csv", "extra_x"])


def test_an_attitude_message_without_its_time_system(tmp_path):
    text = "CCSDS_AEM_VERS = 2.0\nMETA_START\nREF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\n"
    text += "ATTITUDE_TYPE = QUATERNION\n"
    row = "2022-01-31T02:02:00 0 0 0 1\n"
    options = ("attitude.target.law=file", f"attitude.target.path={tmp_path / 'a.aem'}")
    for message, words in (
        (text + "META_STOP\n" + row, ["TIME_SYSTEM"]),
        (text + row, ["line 6", "META"]),
    ):
        (tmp_path / "a.aem").write_text(message)
        refused(*propagated(tmp_path, *options), words=["a.aem", *words])


@pytest.mark.parametrize(
    ("camera", "sun", "words"),
    [
        ({"Nu": 0}, (1, 0, 0), ["camera.json", "Nu"]),
        ({"cameraMatrix": [[0, 0, 0]] * 3}, (1, 0, 0), ["camera.json", "cameraMatrix"]),
        ({"ppx": -1e-6}, (1, 0, 0), ["camera.json", "ppx"]),
        ({}, ("nan", 0, 0), ["--sun nan", "no direction"]),
        ({}, ("1e300", "1e300", 0), ["no direction"]),
    ],
)
def test_poses_make_no_scenario_that_cannot_run(tmp_path, camera, sun, words):
    entry = {"filename": "a.png", "q_vbs2tango": [1, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0, 9]}
    (tmp_path / "l.json").write_text(json.dumps([entry]))
    sound = {"Nu": 64, "Nv": 48, "ppx": 1e-5, "cameraMatrix": [[100, 0, 32], [0, 100, 24], [0, 0, 1]]}
    (tmp_path / "camera.json").write_text(json.dumps({**sound, **camera}))
    out = tmp_path / "p"
    refused(
        *("import-poses", tmp_path / "l.json", "--out", out, "--target", "aqua", "--sun", *sun),
        words=words,
    )
    assert not out.exists()


# What a scenario would need


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["times.count=1000000000"], ["times.count", "500000"]),
        (
            [
                "times.count=1000",
                "relative={design: {name: algorithm-3-1-repaired, size_m: 20, relative_orbits: 1000}}",
            ],
            ["1000 times of 1000 relative orbits"],
        ),
        (
            ["relative.plan.transfer={to_roe_m: [0, 9, 0, 9, 0, 9], end_s: 1.0e+15}"],
            ["transfer", "shorter"],
        ),
        (
            ["relative.plan.transfer={to_roe_m: [0, 9, 0, 9, 0, 9], end_s: 2.6e+6}"],
            ["transfer", "shorter"],
        ),
    ],
)
def test_a_scenario_that_needs_too_much(tmp_path, options, words):
    refused(*propagated(tmp_path, *options), words=words)
    assert not (tmp_path / "out.npz").exists()


# Meshes


def test_meshes_that_are_not_what_they_claim(tmp_path):
    box = trimesh.creation.box((1, 2, 3))
    stl = box.export(file_type="stl")
    draco = trimesh.exchange.gltf.export_glb(box, extension_draco=True)
    at = draco.index(b"DRACO") + 11  # the number of triangles, seven bits a byte
    (tmp_path / "more.stl").write_bytes(stl + b"xx")
    (tmp_path / "cut.stl").write_bytes(stl[:-1])
    (tmp_path / "draco.glb").write_bytes(draco[:at] + b"\xff\xff\xff\xff\x7f" + draco[at + 5 :])
    (tmp_path / "deep.gltf").write_text("[" * 10_000)
    (tmp_path / "folder.obj").mkdir()
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "loop.obj").write_text("mtllib loop.mtl\n" + BOX_OBJ)
    (tmp_path / "loop.mtl").symlink_to("loop.mtl")
    out = tmp_path / "p"
    for name, words in {
        "more.stl": ["left-over"],
        "cut.stl": ["cut short"],
        "draco.glb": ["Draco", "34359738367"],
        "deep.gltf": ["not a glTF file"],
        "folder.obj": ["a folder"],
        "pipe.obj": ["a pipe"],
        "loop.obj": ["'loop.mtl'"],
        f"{'x' * 300}.obj": ["too long"],
    }.items():
        refused("import", tmp_path / name, "--scale", 1, "--out", out, words=[name[:20], *words])
        assert not out.exists()
