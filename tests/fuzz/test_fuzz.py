"""Damaged input of every kind ends as docs/running.md says: an exit code of 0 to 3, and one line.

Each case damages a copy of a sound input, by a seed and its number, and runs a command on it in a forked
process of limited time and memory. By default a few cases of each kind are tried, and others every day::

    POSSE_FUZZ_SECONDS=3600 POSSE_FUZZ_SEED=7 python -m pytest tests/fuzz

tries cases for an hour in all; ``POSSE_FUZZ_CASE=12`` repeats one case of each kind.
"""

from __future__ import annotations

import datetime
import json
import os
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import cuboid
import cv2
import numpy as np
import pytest
import trimesh
import yaml
from command import run_posse
from damage import VALUES, copied, damage, damaged_json, damaged_text, damaged_value
from forked import Ended, run_forked
from small_run import BOX_OBJ, SCENARIO

from posse_core import ModelCard
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import dump_scenario, load_scenario

SEED = os.environ.get("POSSE_FUZZ_SEED", datetime.date.today().isoformat())
SECONDS = float(os.environ.get("POSSE_FUZZ_SECONDS", "0"))
CASE = os.environ.get("POSSE_FUZZ_CASE")
CASES = 12
"""Cases of each kind where no time is given."""
SHOWN = 15

Case = Callable[[Path, random.Random], list[str]]
"""Damages the input in a folder, and returns the command to run there."""


# Scenarios


SCENARIOS = ("small.yaml", "posse-v1.yaml", "cluster.yaml", "transfer.yaml", "sensors.yaml")


def write_scenarios(folder: Path) -> None:
    registry = load_plugins().registry
    text = SCENARIO.replace("renderer: {name: flat, seconds: 0.05}\n", "")
    (folder / "small.yaml").write_text(text)
    (folder / "box.obj").write_text(BOX_OBJ)
    for name in ("posse-v1", "cluster"):
        (folder / f"{name}.yaml").write_text(dump_scenario(load_scenario(name, registry)))
    value = yaml.safe_load(text)
    value["relative"]["plan"] = {"transfer": {"to_roe_m": [0, 100, 0, 50, 0, 50], "end_s": 20000}}
    (folder / "transfer.yaml").write_text(yaml.safe_dump(value))
    del value["relative"]["plan"]
    value["sensors"] = {
        "side": {"type": "camera", "mount": {"rotation_vector_deg": [0, 5, 0]}, "rate_hz": 0.01},
        "scanner": {"type": "lidar", "mount": {"position_m": [0.3, 0, 0]}},
    }
    (folder / "sensors.yaml").write_text(yaml.safe_dump(value))


WORLDS = ("tracking.yaml", "company.yaml", "worn.yaml")


def write_worlds(folder: Path) -> None:
    """Scenarios with joints, several bodies, damage and varied materials."""
    registry = load_plugins().registry
    for name, scenario in (("tracking", "aqua-tracking"), ("company", "aqua-company")):
        made = load_scenario(scenario, registry, {"times.count": 3})
        (folder / f"{name}.yaml").write_text(dump_scenario(made))
    changed = {
        "target": {"name": "aqua", "materials": {"foil_amber": {"specular": 0.0}}},
        "damage": {"missing_parts": 1, "torn_parts": 1},
        "variation": {"per": "frame", "materials": {"*": {"brightness": [0.8, 1.2]}}},
        "times.count": 3,
    }
    made = load_scenario("aqua", registry, changed)
    (folder / "worn.yaml").write_text(dump_scenario(made))


def world(folder: Path, draw: random.Random) -> list[str]:
    path = folder / draw.choice(WORLDS)
    if draw.random() < 0.8:
        value = yaml.safe_load(path.read_text())
        parts = [key for key in ("bodies", "joints", "damage", "variation", "target") if value.get(key)]
        key = draw.choice(parts)
        value[key] = damaged_value(value[key], draw)
        path.write_text(yaml.safe_dump(value))
    else:
        damage(path, draw)
    (folder / "file").touch()
    return draw.choice((["propagate", path.name, "--out", "t.npz"], ["run", path.name, "--out", "file"]))


def write_flights(folder: Path) -> None:
    registry = load_plugins().registry
    for name in ("fly-approach", "fly-hold"):
        (folder / f"{name}.yaml").write_text(dump_scenario(load_scenario(name, registry)))


def flight(folder: Path, draw: random.Random) -> list[str]:
    path = folder / draw.choice(("fly-approach.yaml", "fly-hold.yaml"))
    if draw.random() < 0.8:
        value = yaml.safe_load(path.read_text())
        value["flight"] = damaged_value(value["flight"], draw)
        path.write_text(yaml.safe_dump(value))
    else:
        damage(path, draw)
    (folder / "file").touch()  # a flight that is sound ends here, since it is no folder
    return ["fly", path.name, "--out", "file"]


def scenario(folder: Path, draw: random.Random) -> list[str]:
    path = folder / draw.choice(SCENARIOS)
    if draw.random() < 0.6:
        value = yaml.safe_load(path.read_text())
        for _ in range(draw.choice((1, 1, 2))):
            value = damaged_value(value, draw)
        path.write_text(yaml.safe_dump(value))
    else:
        damage(path, draw)
    ends = [["propagate", path.name, "--out", "t.npz"], ["manoeuvres", path.name]]
    ends += [["run", path.name, "--out", "box.obj"]]  # ends after its plan: this is a file
    command = draw.choice(ends)
    if draw.random() < 0.2:
        key = draw.choice(
            ("times.count", "seed", "frames", "propagator", "orbit", "camera.width_px", "x.y.z")
        )
        command += ["-o", f"{key}={draw.choice(VALUES)}".replace("\0", "")]
    return command


# Datasets


def write_dataset(folder: Path) -> None:
    cuboid.add_twin(cuboid.write_dataset(folder / "d"))
    code, _, error = run_posse("partition", folder / "d")
    assert code == 0, error
    for form in ("coco", "speed"):
        code, _, error = run_posse("export", folder / "d", "--format", form)
        assert code == 0, error
    write_boxes_model(folder / "m.onnx")


def dataset(folder: Path, draw: random.Random) -> list[str]:
    files = sorted(path for path in (folder / "d").rglob("*") if path.is_file())
    groups: dict[str, list[Path]] = {}
    for path in files:
        groups.setdefault(f"{path.parent.name}{path.suffix}", []).append(path)
    path = draw.choice(groups[draw.choice(sorted(groups))])
    if draw.random() < 0.1:
        name = draw.choice(("labels/shard-00009.jsonl", "spacecraft/other.json", "images/x.png"))
        path = folder / "d" / name
        path.write_text("{}\n")
    damage(path, draw)
    commands = [["validate", "d"], ["view", "d", "--out", "v.html"], ["partition", "d"]]
    commands += [
        ["collect", "d", "--out", "c"],
        ["detect", str(path.relative_to(folder)), "--model", "m.onnx"],
    ]
    commands += [
        ["export", "d", "--out", "e", "--format", form] for form in ("coco", "yolo", "bop", "posse")
    ]
    commands += [["eval", "d", "--model", "m.onnx", "--part", draw.choice(("all", "test"))]]
    return draw.choice(commands)


def write_foreign(folder: Path) -> None:
    write_dataset(folder)
    for form in ("bop", "yolo"):
        code, _, error = run_posse("export", folder / "d", "--format", form)
        assert code == 0, error


def foreign(folder: Path, draw: random.Random) -> list[str]:
    """Labels in other formats, as any program may have written them."""
    home = folder / "d"
    file, name = draw.choice(
        (
            ("coco.json", "coco.json"),
            ("speed.json", "speed.json"),
            ("bop/models/models_info.json", "bop"),
            ("bop/train/000000/scene_gt.json", "bop"),
            ("bop/train/000000/scene_camera.json", "bop"),
            ("bop/models/obj_000001.ply", "bop"),
            ("bop/train/000000/depth/000000.png", "bop"),
            ("yolo/data.yaml", "yolo"),
            ("yolo/train.txt", "yolo"),
            ("yolo/labels/000001.txt", "yolo"),
        )
    )
    if not (home / file).is_file():
        file = file.replace("train", "val")
    if file.endswith(".txt"):
        (home / file).write_text(damaged_text((home / file).read_text(), draw))
    elif (home / file).is_file():
        damage(home / file, draw)
    if name == "coco.json" and draw.random() < 0.5:
        return ["eval", "d/coco.json", "--model", "m.onnx", "--part", "all"]
    return ["validate", f"d/{name}"]


# Tables, messages and poses


def write_tables(folder: Path) -> None:
    (folder / "s.yaml").write_text(SCENARIO.replace("renderer: {name: flat, seconds: 0.05}\n", ""))
    (folder / "box.obj").write_text(BOX_OBJ)
    for name in ("t.npz", "t.csv"):
        code, _, error = run_posse("propagate", folder / "s.yaml", "--out", folder / name)
        assert code == 0, error
    rows = [f"2022-01-31T02:02:{30 + i} 7000 {i} 0 0 7.5 0.1" for i in range(4)]
    head = "CCSDS_{}_VERS = 2.0\nMETA_START\nOBJECT_NAME = X\nTIME_SYSTEM = UTC\n{}META_STOP\n"
    for name in ("t.oem", "c.oem"):
        meta = head.format("OEM", "CENTER_NAME = EARTH\nREF_FRAME = GCRF\n")
        (folder / name).write_text(meta + "\n".join(rows) + "\n")
    meta = head.format(
        "AEM", "REF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\nATTITUDE_TYPE = QUATERNION\n"
    )
    quaternions = ["2022-01-31T02:00:00 0 0 0 1", "2022-01-31T04:02:40 0 0 1 0"]
    (folder / "a.aem").write_text(meta + "DATA_START\n" + "\n".join(quaternions) + "\nDATA_STOP\n")


def table(folder: Path, draw: random.Random) -> list[str]:
    name = draw.choice(("t.npz", "t.csv", "t.oem", "a.aem"))
    damage(folder / name, draw)
    if name == "a.aem" or (name != "t.oem" and draw.random() < 0.3):
        options = ["attitude.target.law=file", f"attitude.target.path={folder / name}"]
    else:
        options = ["propagator.name=file", f"propagator.path={folder / name}"]
    if name == "t.oem":
        options.append(f"propagator.chaser_path={folder / 'c.oem'}")
    words = [word for option in options for word in ("-o", option)]
    return ["propagate", "s.yaml", "--out", "out.npz", *words]


def write_poses(folder: Path) -> None:
    entries = [
        {"filename": f"{i}.png", "q_vbs2tango_true": [1, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0.1, 9 + i]}
        for i in range(3)
    ]
    (folder / "speed.json").write_text(json.dumps(entries))
    (folder / "a_poses_gt.csv").write_text("x,y,z,q1,q2,q3,q4\n0,0,9,0,0,0,1\n0.1,0,8,0,0,1,0\n")
    (folder / "a_images.csv").write_text("a.png\nb.png\n")
    camera = {
        "Nu": 64,
        "Nv": 48,
        "ppx": 1e-5,
        "ppy": 1e-5,
        "fx": 1e-3,
        "fy": 1e-3,
        "distCoeffs": [0.1, 0, 0, 0, 0],
    }
    camera["cameraMatrix"] = [[100, 0, 32], [0, 100, 24], [0, 0, 1]]
    (folder / "camera.json").write_text(json.dumps(camera))


def poses(folder: Path, draw: random.Random) -> list[str]:
    labels = draw.choice(("speed.json", "a_poses_gt.csv"))
    damage(folder / draw.choice((labels, labels, "camera.json", "a_images.csv")), draw)
    sun = draw.choice(
        ([], [], ["--sun", *(str(draw.choice((0, 1, -1, "nan", "inf", 1e-300))) for _ in "xyz")])
    )
    return ["import-poses", labels, "--out", "p", "--target", "aqua", *sun]


CALIBRATIONS = ("c.yaml", "c.xml", "c.json", "camchain.yaml", "cameras.txt", "camera.json")


def write_calibrations(folder: Path) -> None:
    write_poses(folder)
    K = np.array([[100.0, 0, 32], [0, 100, 24], [0, 0, 1]])
    for suffix in ("yaml", "xml", "json"):
        storage = cv2.FileStorage(str(folder / f"c.{suffix}"), cv2.FILE_STORAGE_WRITE)
        storage.write("image_width", 64)
        storage.write("image_height", 48)
        storage.write("camera_matrix", K)
        storage.write("distortion_coefficients", np.full((8, 1), 0.01))
        storage.release()
    camera = {"camera_model": "pinhole", "intrinsics": [100, 100, 32, 24], "resolution": [64, 48]}
    lens = {"distortion_model": "equidistant", "distortion_coeffs": [0.01, 0.0, 0.0, 0.0]}
    chain = {f"cam{n}": {**camera, **lens} for n in range(2)}
    (folder / "camchain.yaml").write_text(yaml.safe_dump(chain))
    (folder / "cameras.txt").write_text("# cameras\n1 OPENCV 64 48 100 100 32 24 0.1 0 0 0\n")


def calibration(folder: Path, draw: random.Random) -> list[str]:
    name = draw.choice(CALIBRATIONS)
    damage(folder / name, draw)
    chosen = draw.choice(("", "", "#cam0", "#1")) if name != "camchain.yaml" else "#cam1"
    return ["import-poses", "speed.json", "--out", "p", "--target", "aqua", "--camera", name + chosen]


# Meshes and packages


def write_meshes(folder: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)))
    for suffix in ("obj", "ply", "stl", "glb"):
        box.export(folder / f"a.{suffix}")
    (folder / "draco.glb").write_bytes(trimesh.exchange.gltf.export_glb(box, extension_draco=True))
    for name, data in trimesh.exchange.gltf.export_gltf(box).items():
        (folder / name).write_bytes(data)
    (folder / "b.obj").write_text("mtllib b.mtl\n" + BOX_OBJ.replace("f 1 4", "usemtl m\nf 1 4"))
    (folder / "b.mtl").write_text("newmtl m\nKd 1 0.5 0\nNs 10\nmap_Kd b.png\n")
    cv2.imwrite(str(folder / "b.png"), np.zeros((4, 4, 3), np.uint8))
    (folder / "k.yaml").write_text(
        "keypoints:\n  B1: [0, 0, 1]\n  T1: {part: box, corner: [1, 1, -1]}\n"
    )


def mesh(folder: Path, draw: random.Random) -> list[str]:
    names = (
        "a.obj",
        "a.ply",
        "a.stl",
        "a.glb",
        "draco.glb",
        "model.gltf",
        "b.obj",
        "b.mtl",
        "b.png",
        "k.yaml",
    )
    name = draw.choice(names)
    path = folder / name
    data = path.read_bytes()
    if name.endswith("glb") and draw.random() < 0.5:  # the header is JSON
        length = int.from_bytes(data[12:16], "little")
        text = damaged_json(data[20 : 20 + length].decode(), draw).encode()
        path.write_bytes(
            data[:12] + len(text).to_bytes(4, "little") + data[16:20] + text + data[20 + length :]
        )
    elif name.endswith("gltf"):
        path.write_text(damaged_json(data.decode(), draw))
    else:
        damage(path, draw)
    model = {"b.mtl": "b.obj", "b.png": "b.obj", "k.yaml": "a.obj"}.get(name, name)
    more = ["--keypoints", "k.yaml"] if name == "k.yaml" else []
    if draw.random() < 0.2:
        more += ["--axes", draw.choice(("x y z", "x x x", "-z y x", "", "x y"))]
    return [
        "import",
        model,
        "--out",
        "p",
        "--scale",
        draw.choice(("1", "1", "1e-300", "1e300", "0")),
        *more,
    ]


def write_package(folder: Path) -> None:
    (folder / "box.obj").write_text(BOX_OBJ)
    code, _, error = run_posse("import", folder / "box.obj", "--out", folder / "p", "--scale", "1")
    assert code == 0, error


def package(folder: Path, draw: random.Random) -> list[str]:
    path = folder / "p" / draw.choice(("spacecraft.yaml", "spacecraft.yaml", "box.obj", "scenario.yaml"))
    if path.suffix == ".yaml" and draw.random() < 0.6:
        path.write_text(yaml.safe_dump(damaged_value(yaml.safe_load(path.read_text()), draw)))
    else:
        damage(path, draw)
    return ["run", "p/scenario.yaml", "--out", "box.obj"]


# Models


def write_boxes_model(path: Path) -> None:
    """A graph that finds the same box in every picture."""
    onnx = pytest.importorskip("onnx")
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    outputs = {
        "boxes": np.array([[[16, 24, 8, 4]]], np.float32),
        "scores": np.array([[0.5]], np.float32),
        "labels": np.array([[0]], np.int64),
    }
    nodes, values = [], []
    for name, array in outputs.items():
        nodes.append(helper.make_node("Constant", [], [name], value=numpy_helper.from_array(array)))
        kind = helper.np_dtype_to_tensor_dtype(array.dtype)
        values.append(helper.make_tensor_value_info(name, kind, array.shape))
    picture = helper.make_tensor_value_info("picture", onnx.TensorProto.FLOAT, ("B", 1, 64, 64))
    graph = helper.make_graph(nodes, "g", [picture], values)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    for key, value in card("boxes", "by-hand").metadata().items():
        model.metadata_props.add(key=key, value=value)
    onnx.save(model, path)


def card(task: str, net: str) -> ModelCard:
    points = {"B1": [0.0, 0.0, 1.0], "B2": [1.0, 0.0, 1.0]}
    return ModelCard(
        *(net, task, ("brick",), 64, "", "", "0", {"brick": points}),
        {"brick": [np.eye(3).tolist()]},
        {"depth": 18, "detections": 4} if task == "boxes" else {"size": "small"},
    )


def write_models(folder: Path) -> None:
    write_boxes_model(folder / "m.onnx")
    cv2.imwrite(str(folder / "a.png"), np.full((48, 64), 90, np.uint8))
    torch = pytest.importorskip("torch")
    from posse_detect_torch.checkpoint import write_model
    from posse_detect_torch.heatmap import HeatMaps
    from posse_detect_torch.nano import Nano

    torch.set_num_threads(1)
    write_model(folder / "nano.safetensors", Nano(1).state_dict(), card("boxes", "nano"))
    write_model(folder / "heatmap.safetensors", HeatMaps(2).state_dict(), card("keypoints", "heatmap"))


def model(folder: Path, draw: random.Random) -> list[str]:
    name = draw.choice(("m.onnx", "nano.safetensors", "heatmap.safetensors"))
    path = folder / name
    data = path.read_bytes()
    if draw.random() < 0.2:
        damage(path, draw)
    elif name == "m.onnx":
        import onnx

        loaded = onnx.load(path)
        (entry,) = loaded.metadata_props
        entry.value = damaged_json(entry.value, draw)
        if draw.random() < 0.2:
            shape = loaded.graph.input[0].type.tensor_type.shape
            shape.dim[draw.randrange(4)].dim_value = draw.choice((0, 1, 3, 65, 2**40))
        path.write_bytes(loaded.SerializeToString())
    else:
        length = int.from_bytes(data[:8], "little")
        header = json.loads(data[8 : 8 + length])
        if draw.random() < 0.7:
            key = "posse_model"
            header["__metadata__"][key] = damaged_json(header["__metadata__"][key], draw)
        else:
            header = damaged_value(header, draw)
        text = json.dumps(header).encode()
        path.write_bytes(len(text).to_bytes(8, "little") + text + data[8 + length :])
    if name == "heatmap.safetensors":
        return ["detect", "a.png", "--model", "m.onnx", "--keypoints", name]
    return ["detect", "a.png", "--model", name]


KINDS: dict[str, tuple[Callable[[Path], None], Case]] = {
    "scenario": (write_scenarios, scenario),
    "world": (write_worlds, world),
    "flight": (write_flights, flight),
    "dataset": (write_dataset, dataset),
    "foreign": (write_foreign, foreign),
    "table": (write_tables, table),
    "poses": (write_poses, poses),
    "mesh": (write_meshes, mesh),
    "package": (write_package, package),
    "calibration": (write_calibrations, calibration),
    "model": (write_models, model),
}


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_input_ends_in_one_line(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    prepare, case = KINDS[kind]
    (tmp_path / "sound").mkdir()
    prepare(tmp_path / "sound")
    until = time.monotonic() + SECONDS / len(KINDS)
    number = int(CASE or 0)
    failures = []
    while (
        number < CASES if not (SECONDS or CASE) else time.monotonic() < until or number == int(CASE or 0)
    ):
        folder = copied(tmp_path / "sound", tmp_path / f"{kind}-{number}")
        arguments = case(folder, random.Random(f"{SEED} {kind} {number}"))
        before = names_in(folder)
        ended = run_forked(folder, arguments)
        faults = faults_of(ended, sorted(names_in(folder) - before))
        if faults:
            failures.append(
                f"case {number}: posse {' '.join(arguments)[:300]}: {faults}\n{ended.error[-2000:]}"
            )
        else:
            shutil.rmtree(folder)
        number += 1
        if CASE:
            break
    print(f"{kind}: {number} cases, {len(failures)} failures")
    assert not failures, "\n".join([f"seed {SEED}, {len(failures)} of {number}", *failures[:SHOWN]])


def names_in(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def faults_of(ended: Ended, new: list[str]) -> str:
    """What is wrong with the end of a command, or nothing."""
    faults = []
    if ended.code not in (0, 1, 2, 3):
        faults.append(f"exit code {ended.code}")
    if "Traceback" in ended.error:
        faults.append("a traceback")
    lines = [line for line in ended.error.split("\n") if line.strip() and not is_progress(line)]
    strange = [line for line in lines if not line.startswith("posse: ")]
    if strange:
        faults.append(f"{strange[0][:100]!r}, which no message begins with")
    errors = [line for line in lines if not line.startswith("posse: warning: ")]
    if ended.code in (1, 2) and len(errors) != 1:
        faults.append(f"{len(errors)} lines of error")
    if ended.code == 2 and new:
        faults.append(f"left {', '.join(new[:5])}")
    return "; ".join(faults)


def is_progress(line: str) -> bool:
    return "%|" in line or "frame/s" in line or "0frame [" in line
