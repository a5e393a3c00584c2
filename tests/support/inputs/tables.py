"""Tables of motion, messages of the CCSDS, poses of other data sets and calibrations."""

from __future__ import annotations

import json
import random
from pathlib import Path

import cv2
import numpy as np
import yaml
from command import run_posse
from damage import damage
from small_run import BOX_OBJ, SCENARIO

from inputs.kind import Kind


def write_tables(folder: Path) -> None:
    (folder / "s.yaml").write_text(SCENARIO.replace("renderer: {name: flat, seconds: 0.05}\n", ""))
    (folder / "box.obj").write_text(BOX_OBJ)
    for name in ("t.npz", "t.csv"):
        code, _, error = run_posse("propagate", folder / "s.yaml", "--out", folder / name)
        assert code == 0, error
    head = "CCSDS_{}_VERS = 2.0\nMETA_START\nOBJECT_NAME = X\nTIME_SYSTEM = UTC\n{}META_STOP\n"
    for name, x_km in (("t.oem", 7000), ("c.oem", 7000.1)):
        rows = [f"2022-01-31T02:02:{30 + i} {x_km} {7.5 * i} 0 0 7.5 0.1" for i in range(4)]
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
        options += [f"propagator.chaser_path={folder / 'c.oem'}", "times=null"]
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
    every = draw.choice(([], [], ["--every", draw.choice(("2", "1e-300", "1e300", "nan"))]))
    return ["import-poses", labels, "--out", "p", "--target", "aqua", *sun, *every]


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


_OPTIONS = (
    "propagator.name=file -o propagator.path=t.npz",
    "propagator.name=file -o propagator.path=t.csv",
    "propagator.name=file -o propagator.path=t.oem -o propagator.chaser_path=c.oem -o times=null",
    "attitude.target.law=file -o attitude.target.path=a.aem",
)
_POSES = "import-poses {} --out p --target aqua"
KINDS = {
    "table": Kind(
        write_tables,
        table,
        tuple(f"propagate s.yaml --out out.npz -o {options}" for options in _OPTIONS),
    ),
    "poses": Kind(
        write_poses,
        poses,
        tuple(map(_POSES.format, ("speed.json", "a_poses_gt.csv", "speed.json --every 2"))),
    ),
    "calibration": Kind(
        write_calibrations,
        calibration,
        tuple(
            f"{_POSES.format('speed.json')} --camera {name}"
            for name in ("camchain.yaml#cam1", *CALIBRATIONS)
            if name != "camchain.yaml"
        ),
    ),
}
