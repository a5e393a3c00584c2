"""A dataset made by hand: a cuboid whose every label has a closed form.

Nothing here comes from the program's own geometry: a ray meets an axis-aligned box by its slabs, a
corner of a convex body is seen where one of its faces looks at the camera, and rotations are SciPy's.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pycocotools import mask as coco_mask
from scipy.spatial.transform import Rotation

from posse_core._dataset.camera import write_camera
from posse_core._dataset.sensors import SensorInfo, write_sensor
from posse_core._dataset.spacecraft import write_spacecraft
from posse_core._files.trajectory import load_trajectory, save_trajectory
from posse_core._model.camera import Camera
from posse_core._model.mount import Mount
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._model.trajectory import Trajectory

HALF = np.array([1.5, 0.8, 0.5])
"""Half sides of the cuboid, metres."""
CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5, 0.036)
SIDES = ("x-", "x+", "y-", "y+", "z-", "z+")
SUN_BODY = np.array([0.6, 0.0, 0.8])
LIT = (SIDES.index("x+"), SIDES.index("z+"))
"""The sides that face the Sun; nothing shades a convex body."""
NAMES = ("B1", "B2", "B3", "B4", "T1", "T2", "T3", "T4")
"""Corners, −x −y, +x −y, −x +y, +x +y of the bottom (−z), then of the top."""


def corners(half: np.ndarray = HALF) -> np.ndarray:
    signs = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    return np.array(signs) * half


def cuboid(name: str = "brick", half: np.ndarray = HALF) -> Spacecraft:
    parts = []
    for axis in range(3):
        for sign in (-1, 1):
            square = corners(half)[corners(half)[:, axis] * sign > 0]
            a, b, c, d = square
            if np.cross(b - a, c - a)[axis] * sign < 0:
                b, c = c, b
            parts.append(
                Part(
                    name=SIDES[2 * axis + (sign > 0)],
                    vertices_body_m=np.array([a, b, c, d]),
                    faces=np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32),
                    normals_body=np.tile(sign * np.eye(3, dtype=np.float32)[axis], (4, 1)),
                    uv=np.zeros((4, 2), dtype=np.float32),
                    material="grey",
                )
            )
    return Spacecraft(
        name=name,
        parts=tuple(parts),
        materials={"grey": Material("grey")},
        keypoints_body_m=dict(zip(NAMES, corners(half), strict=True)),
        skeleton=(("B1", "B2"), ("B1", "T1"), ("T1", "T2")),
        symmetries=(np.diag([1.0, -1.0, -1.0]),),
    )


def slabs(R: np.ndarray, t: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) planar depth, NaN for a miss, and (H, W) side, −1 for a miss: Kay and Kajiya (1986)."""
    v, u = np.mgrid[: CAMERA.height_px, : CAMERA.width_px].astype(float)
    rays = np.stack(
        [(u - CAMERA.cx_px) / CAMERA.fx_px, (v - CAMERA.cy_px) / CAMERA.fy_px, np.ones_like(u)], axis=-1
    )
    d, o = rays @ R, -R.T @ t
    low, high = np.sort(np.stack([(-half - o) / d, (half - o) / d]), axis=0)
    enter = low.max(axis=-1)
    hit = (enter < high.min(axis=-1)) & (enter > 0)
    axis = low.argmax(axis=-1)
    towards = np.take_along_axis(d, axis[..., None], axis=-1)[..., 0] < 0
    return np.where(hit, enter, np.nan), np.where(hit, 2 * axis + towards, -1)


def seen_corners(R: np.ndarray, t: np.ndarray, half: np.ndarray) -> np.ndarray:
    camera_body = -R.T @ t
    facing = corners(half) * camera_body > np.abs(corners(half)) * half
    return facing.any(axis=1)


def labels_of(
    index: int, R: np.ndarray, t: np.ndarray, craft: Spacecraft, half: np.ndarray, sequence: int
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    depth, side = slabs(R, t, half)
    mask = side >= 0
    rle = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    box = [int(x) for x in coco_mask.toBbox(rle)] if mask.any() else None
    x_cam = corners(half) @ R.T + t
    uv = x_cam[:, :2] / x_cam[:, 2:] * [CAMERA.fx_px, CAMERA.fy_px] + [CAMERA.cx_px, CAMERA.cy_px]
    inside = ((uv >= -0.5) & (uv < [CAMERA.width_px - 0.5, CAMERA.height_px - 0.5])).all(axis=1)
    visibility = np.where(inside, np.where(seen_corners(R, t, half), 2, 1), 0)
    x, y, z, w = Rotation.from_matrix(R).as_quat(canonical=True)
    to_camera = -R.T @ t / np.linalg.norm(t)
    normals = np.concatenate([[-axis, axis] for axis in np.eye(3)]) @ R.T
    labels = {
        "index": index,
        "t_s": 10.0 * index,
        "epoch_utc": instant(10.0 * index),
        "sequence": sequence,
        "spacecraft": craft.name,
        "image": f"images/{index:06d}.png",
        "truth": f"truth/{index:06d}.npz",
        "sun_fraction_target": 1 - index % 100 / 100,
        "sun_fraction_camera": 1.0,
        "solar_flux_w_m2": 1361.0,
        "box_visible_px": box,
        "box_whole_px": [*uv.min(axis=0), *np.ptp(uv, axis=0)],
        "mask_rle": {"size": list(mask.shape), "counts": rle["counts"].decode()},
        "mask_area_px": int(mask.sum()),
        "fraction_visible": 1.0 if inside.all() else 0.5,
        "fraction_lit": float(np.isin(side[mask], LIT).mean()) if mask.any() else None,
        "part_area_px": {name: int((side == i).sum()) for i, name in enumerate(SIDES)},
        "keypoints": {
            name: [*map(float, uv[i]), int(visibility[i])]
            for i, name in enumerate(craft.keypoints_body_m)
        },
        "q_cam_from_body": [w, x, y, z],
        "t_body_cam_m": list(t),
        "range_m": float(np.linalg.norm(t)),
        "phase_angle_rad": float(np.arccos(np.clip(SUN_BODY @ to_camera, -1, 1))),
        "sun_direction_body": list(SUN_BODY),
    }
    normal_cam = np.full((*mask.shape, 3), np.nan, dtype=np.float32)
    normal_cam[mask] = normals[side[mask]]
    arrays = {
        "part_id": side.astype(np.int16),
        "depth_m": depth.astype(np.float32),
        "normal_cam": normal_cam,
    }
    return labels, arrays


EPOCH = datetime(2022, 1, 31, 2, 2, 27, 580000)


def instant(t_s: float, epoch: datetime = EPOCH) -> str:
    return (epoch + timedelta(seconds=t_s)).isoformat()


def earth_rotation(t_s: np.ndarray, epoch: datetime = EPOCH) -> np.ndarray:
    """IERS Conventions 2010, eq. 5.15."""
    days = ((epoch - datetime(2000, 1, 1, 12)).total_seconds() + t_s) / 86400
    return 2 * np.pi * ((0.7790572732640 + 1.00273781191135448 * days) % 1)


def trajectory(lines: list[dict[str, Any]]) -> Trajectory:
    """A motion that leads to these labels: the target anywhere on an orbit, the camera turned anyhow."""
    random = np.random.default_rng(3)
    count = len(lines)
    r, v = 7e6 * _directions(random, count), 7e3 * _directions(random, count)
    normal = np.cross(r, v)
    axes = [x / np.linalg.norm(x, axis=1, keepdims=True) for x in (r, np.cross(normal, r), normal)]
    eci_from_camera = Rotation.random(count, random_state=random)
    q = np.array([line["q_cam_from_body"] for line in lines])
    eci_from_body = eci_from_camera * Rotation.from_quat(q[:, [1, 2, 3, 0]])
    to_chaser = -eci_from_camera.apply([line["t_body_cam_m"] for line in lines])
    turning = np.cross(normal / np.sum(r**2, axis=1, keepdims=True), to_chaser)
    still = np.zeros(3)
    v_cam = np.array([line.get("v_body_cam_m_s", still) for line in lines])
    given = np.array(["v_body_cam_m_s" in line for line in lines])[:, None]
    v_to_chaser = np.where(given, -eci_from_camera.apply(v_cam), turning)
    v_rtn = np.stack([np.sum(axis * (v_to_chaser - turning), axis=1) for axis in axes], axis=1)
    return Trajectory(
        epoch_utc=EPOCH.isoformat(),
        t_s=np.array([line["t_s"] for line in lines]),
        sequence=np.array([line["sequence"] for line in lines]),
        r_target_eci_m=r,
        v_target_eci_m_s=v,
        r_chaser_rtn_m=np.stack([np.sum(axis * to_chaser, axis=1) for axis in axes], axis=1),
        v_chaser_rtn_m_s=v_rtn,
        r_chaser_eci_m=r + to_chaser,
        v_chaser_eci_m_s=v + v_to_chaser,
        q_eci_from_body=eci_from_body.as_quat(canonical=True)[:, [3, 0, 1, 2]],
        q_eci_from_camera=eci_from_camera.as_quat(canonical=True)[:, [3, 0, 1, 2]],
        omega_body_rad_s=np.zeros((count, 3)),
        omega_camera_rad_s=np.zeros((count, 3)),
        r_sun_eci_m=r + 1.5e11 * eci_from_body.apply(SUN_BODY),
        r_moon_eci_m=4e8 * _directions(random, count),
        sun_fraction_target=np.array([line["sun_fraction_target"] for line in lines]),
        sun_fraction_camera=np.ones(count),
        solar_flux_w_m2=np.full(count, 1361.0),
        earth_albedo_w_m2=30.0 * np.arange(count),
        earth_infrared_w_m2=np.full(count, 200.0),
        earth_rotation_rad=earth_rotation(np.array([line["t_s"] for line in lines])),
    )


def _directions(random: np.random.Generator, count: int) -> np.ndarray:
    vectors = random.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def start_dataset(folder: Path, crafts: Iterable[Spacecraft]) -> None:
    """The folders of a dataset, its camera and its spacecraft: what a run writes before its frames."""
    for name in ("images", "truth", "labels", "spacecraft"):
        (folder / name).mkdir(parents=True)
    write_camera(CAMERA, folder / "camera.json")
    for craft in crafts:
        write_spacecraft(craft, folder / "spacecraft")


def write_dataset(folder: Path, crafts: tuple[tuple[str, np.ndarray], ...] = (("brick", HALF),)) -> Path:
    """Six frames of each craft: five in the image (the third cut by its border), the last out of it."""
    random = np.random.default_rng(7)
    places = [(0, 0, 8), (0.7, -0.4, 10), (4.5, 0, 9), (-1, 1, 12), (0.2, 0.2, 30), (20, 0, 10)]
    start_dataset(folder, [cuboid(name, half) for name, half in crafts])
    lines, index = [], 0
    for name, half in crafts:
        craft = cuboid(name, half)
        for place in places:
            R = Rotation.random(random_state=random).as_matrix()
            t = np.array(place, dtype=float)
            labels, arrays = labels_of(index, R, t, craft, half, sequence=index // 3)
            image = np.where(arrays["part_id"] >= 0, 40 * arrays["part_id"] + 30, index).astype(np.uint8)
            image[0, :: index + 2] = 200
            cv2.imwrite(str(folder / labels["image"]), image)
            np.savez_compressed(folder / labels["truth"], **arrays)
            lines.append(labels)
            index += 1
    save_trajectory(trajectory(lines), folder / "trajectory.npz")
    write_lines(folder, lines)
    return folder


def add_twin(folder: Path) -> Path:
    """Add a sensor ``twin``: a camera at the camera's place, whose readings are the frames."""
    info = SensorInfo("twin", "camera", Mount(), None, CAMERA)
    (folder / "sensors" / "twin").mkdir(parents=True)
    write_sensor(info, folder / "sensors" / "twin.json")
    lines = read_lines(folder)
    for line in lines:
        files = [f"sensors/twin/{line['index']:06d}{suffix}" for suffix in (".npz", ".png")]
        for name, source in zip(files, (line["truth"], line["image"]), strict=True):
            shutil.copyfile(folder / source, folder / name)
        rates = [
            line.get(key, [0.0, 0.0, 0.0])
            for key in ("v_body_cam_m_s", "omega_body_rad_s", "omega_camera_rad_s")
        ]
        own = ("keypoints", "mask_rle", "box_visible_px", "q_cam_from_body", "t_body_cam_m")
        reading = {
            "t_s": line["t_s"],
            "q_sensor_from_body": line["q_cam_from_body"],
            "t_body_sensor_m": line["t_body_cam_m"],
            "v_body_sensor_m_s": rates[0],
            "omega_body_rad_s": rates[1],
            "omega_sensor_rad_s": rates[2],
            "files": files,
            "labels": {key: line[key] for key in own},
        }
        line["sensors"] = {"twin": [reading]}
    write_lines(folder, lines)
    return folder


def add_flow(folder: Path) -> Path:
    """Add base colours and the flow to each next frame of a sequence, for the dataset of one cuboid."""
    lines = read_lines(folder)
    for line, following in zip(lines, [*lines[1:], None], strict=True):
        ahead = following if following and following["sequence"] == line["sequence"] else None
        line["flow_duration_s"] = ahead["t_s"] - line["t_s"] if ahead else None
        path = folder / line["truth"]
        with np.load(path) as file:
            arrays = dict(file)
        np.savez_compressed(path, **arrays, **flow_of(line, ahead, arrays))
    write_lines(folder, lines)
    return folder


def flow_of(
    line: dict[str, Any], ahead: dict[str, Any] | None, arrays: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """A face of a convex body is visible where it looks at the camera."""
    seen = arrays["part_id"] >= 0
    shape = seen.shape
    made = {
        "base_color_rgb": np.where(seen[..., None], np.float32(0.5), np.float32(np.nan)).repeat(3, -1),
        "optical_flow_px": np.full((*shape, 2), np.nan, np.float32),
        "flow_visible": np.zeros(shape, bool),
        "scene_flow_m": np.full((*shape, 3), np.nan, np.float32),
    }
    if ahead is None:
        return made
    (R, t), (R_next, t_next) = pose_of(line), pose_of(ahead)
    v, u = np.nonzero(seen)
    K = CAMERA
    rays = np.stack([(u - K.cx_px) / K.fx_px, (v - K.cy_px) / K.fy_px, np.ones(len(u))], axis=-1)
    x_cam = rays * arrays["depth_m"][seen][:, None].astype(float)
    x_next = (x_cam - t) @ R @ R_next.T + t_next
    ahead_px = x_next[:, :2] / x_next[:, 2:] * [K.fx_px, K.fy_px] + [K.cx_px, K.cy_px]
    axis, sign = np.divmod(arrays["part_id"][seen], 2)
    eye = -R_next.T @ t_next
    half = corners().max(axis=0)
    looks_on = eye[axis] * (2 * sign - 1) > half[axis]
    inside = ((ahead_px >= -0.5) & (ahead_px < [K.width_px - 0.5, K.height_px - 0.5])).all(axis=1)
    made["optical_flow_px"][seen] = ahead_px - np.stack([u, v], axis=-1)
    made["flow_visible"][seen] = looks_on & inside
    made["scene_flow_m"][seen] = x_next - x_cam
    return made


def pose_of(line: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    w, x, y, z = line["q_cam_from_body"]
    return Rotation.from_quat([x, y, z, w]).as_matrix(), np.array(line["t_body_cam_m"])


def repeat(folder: Path, frames: int) -> Path:
    """Make the dataset longer: its frames over and over, under numbers of their own; images shared."""
    lines = read_lines(folder)
    rows = np.arange(frames) % len(lines)
    old = load_trajectory(folder / "trajectory.npz")
    save_trajectory(old.rows(rows), folder / "trajectory.npz")
    write_lines(folder, [{**lines[row], "index": index} for index, row in enumerate(rows)])
    return folder


def write_lines(folder: Path, lines: list[dict[str, Any]], frames: int | None = None) -> None:
    """Write label lines, the list of checksums and the manifest, as a run would."""
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (folder / "labels" / "shard-00000.jsonl").write_text(text)
    seal(folder, len(lines) if frames is None else frames)


def seal(folder: Path, frames: int) -> None:
    """Sign the files as they are now."""

    def digest(path: Path) -> str:
        return hashlib.sha256(path.read_bytes()).hexdigest()

    readings = [path for path in folder.glob("sensors/*/*") if path.is_file()]
    files = sorted([*folder.glob("images/*.png"), *folder.glob("truth/*.npz"), *readings])
    rows = "".join(f"{digest(path)}  {path.relative_to(folder)}\n" for path in files)
    (folder / "checksums.sha256").write_text(rows)
    statics = [
        folder / "camera.json",
        folder / "trajectory.npz",
        *folder.glob("spacecraft/*"),
        *folder.glob("bodies/*/*"),
        *folder.glob("sensors/*.json"),
        *folder.glob("labels/*"),
    ]
    manifest = {
        "state": "complete",
        "frames": frames,
        "failed_frames": {},
        "sha256": {str(path.relative_to(folder)): digest(path) for path in statics},
        "frame_checksums": "checksums.sha256",
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))


def read_lines(folder: Path) -> list[dict[str, Any]]:
    text = (folder / "labels" / "shard-00000.jsonl").read_text()
    return [json.loads(line) for line in text.splitlines()]
