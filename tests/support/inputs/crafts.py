"""Meshes and packages of spacecraft."""

from __future__ import annotations

import random
from pathlib import Path

import cv2
import numpy as np
import trimesh
import yaml
from animated_gltf import AnimatedScene, turning
from command import run_posse
from damage import damage, damaged_value
from small_run import BOX_OBJ

from inputs.kind import Kind

MESHES = ("a.obj", "a.ply", "a.stl", "a.glb", "draco.glb", "arm.glb", "model.gltf", "b.obj")


def write_arm(path: Path) -> None:
    """A base, a turret that turns, and a finger on it that slides."""
    arm = AnimatedScene()
    base = arm.add("base", None, trimesh.creation.box((2, 2, 1)))
    turret = arm.add("turret", base, trimesh.creation.box((1, 1, 1)), translation=(0, 0, 1))
    finger = arm.add("finger", turret, trimesh.creation.box((0.2, 0.2, 1)), translation=(0, 0, 1))
    arm.animate(turret, "rotation", [0, 1, 2], turning((0, 0, 1), [0, 60, 90]))
    arm.animate(finger, "translation", [0, 2], [(0, 0, 1), (0, 0, 1.5)], "STEP")
    arm.write(path)


def write_meshes(folder: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)))
    for suffix in ("obj", "ply", "stl", "glb"):
        box.export(folder / f"a.{suffix}")
    (folder / "draco.glb").write_bytes(trimesh.exchange.gltf.export_glb(box, extension_draco=True))
    for name, data in trimesh.exchange.gltf.export_gltf(box).items():
        (folder / name).write_bytes(data)
    write_arm(folder / "arm.glb")
    (folder / "b.obj").write_text("mtllib b.mtl\n" + BOX_OBJ.replace("f 1 4", "usemtl m\nf 1 4"))
    (folder / "b.mtl").write_text("newmtl m\nKd 1 0.5 0\nNs 10\nmap_Kd b.png\n")
    cv2.imwrite(str(folder / "b.png"), np.zeros((4, 4, 3), np.uint8))
    (folder / "k.yaml").write_text(
        "keypoints:\n  B1: [0, 0, 1]\n  T1: {part: part_0, corner: [1, 1, -1]}\n"
    )


def mesh(folder: Path, draw: random.Random) -> list[str]:
    name = draw.choice((*MESHES, "b.mtl", "b.png", "k.yaml"))
    damage(folder / name, draw)
    model = {"b.mtl": "b.obj", "b.png": "b.obj", "k.yaml": "a.obj"}.get(name, name)
    command = ["import", model, "--out", "p"]
    command += ["--scale", "1" if draw.random() < 0.9 else draw.choice(("1e-300", "1e300", "0"))]
    if name == "k.yaml":
        command += ["--keypoints", "k.yaml"]
    if draw.random() < 0.1:
        command += ["--axes", draw.choice(("x y z", "x x x", "-z y x", "", "x y"))]
    return command


PACKAGES = ("p", "arm")


def write_packages(folder: Path) -> None:
    """A package without joints, and one with joints of its file and others; one's mesh has a texture."""
    (folder / "box.obj").write_text(BOX_OBJ)
    write_arm(folder / "arm.glb")
    for mesh_name, name in zip(("box.obj", "arm.glb"), PACKAGES, strict=True):
        code, _, error = run_posse("import", folder / mesh_name, "--out", folder / name, "--scale", "1")
        assert code == 0, error
    path = folder / "arm" / "spacecraft.yaml"
    value = yaml.safe_load(path.read_text())
    value["joints"]["tip"] = {
        "kind": "prismatic",
        "parts": ["base"],
        "axis": [1, 0, 0],
        "limits_m": [0, 0.4],
    }
    path.write_text(yaml.safe_dump(value))
    path = folder / "arm" / "scenario.yaml"
    value = yaml.safe_load(path.read_text())
    value["joints"] = {"tip": {"law": "table", "path": "tip.csv"}, "turret": {"law": "animation"}}
    path.write_text(yaml.safe_dump(value))
    (folder / "arm" / "tip.csv").write_text("t_s,value_m\n-100000,0\n0,0.1\n100000,0.2\n")


def package(folder: Path, draw: random.Random) -> list[str]:
    home = folder / draw.choice(PACKAGES)
    files = sorted(path for path in home.iterdir() if path.suffix != ".html")
    path = draw.choice([*files, home / "spacecraft.yaml", home / "spacecraft.yaml"])
    if path.suffix == ".yaml" and draw.random() < 0.6:
        path.write_text(yaml.safe_dump(damaged_value(yaml.safe_load(path.read_text()), draw)))
    else:
        damage(path, draw)
    return ["run", f"{home.name}/scenario.yaml", "--out", "box.obj"]


KINDS = {
    "mesh": Kind(
        write_meshes,
        mesh,
        (
            *(f"import {name} --out p --scale 1" for name in MESHES),
            "import a.obj --out p --scale 1 --keypoints k.yaml",
        ),
    ),
    "package": Kind(
        write_packages, package, tuple(f"run {name}/scenario.yaml --out box.obj" for name in PACKAGES)
    ),
}
