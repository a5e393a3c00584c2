"""A dataset of several bodies in each image, made by hand of cuboids, one of which a joint moves.

As in :mod:`cuboid`, nothing comes from the program's own geometry: each block of a body is met by its
slabs, the nearest wins, rotations are SciPy's, and silhouettes count pixels beyond the image too.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cuboid
import cv2
import numpy as np
from pycocotools import mask as coco_mask
from scipy.spatial.transform import Rotation

from posse_core._dataset.spacecraft import write_spacecraft
from posse_core._files.trajectory import save_trajectory
from posse_core._model.joints import Joint
from posse_core._model.spacecraft import Spacecraft

CAMERA = cuboid.CAMERA
PLATE = np.array([1.4, 1.4, 0.1])
WING_M, WING = np.array([0.0, 2.3, 0.0]), np.array([0.6, 1.3, 0.05])
"""Middle and half sides of the wing, body axes, with its joint at zero."""
AXIS = np.array([0.0, 1.0, 0.0])
BLOCKS = {
    "plate": [(None, np.zeros(3), PLATE)],
    "winged": [(None, np.zeros(3), cuboid.HALF), ("wing", WING_M, WING)],
}
"""Name of a spacecraft → its blocks: the joint that carries it, its middle and its half sides."""


def spacecraft(name: str, moving: bool = True) -> Spacecraft:
    """A spacecraft of blocks; where its joint does not move, it has none."""
    parts, points, carriers = [], {}, {}
    for joint, middle, half in BLOCKS[name]:
        box, prefix = cuboid.cuboid(name, half), "" if joint is None else f"{joint} "
        for part in box.parts:
            moved = part.vertices_body_m + middle
            carrier = joint if moving else None
            parts.append(replace(part, name=prefix + part.name, vertices_body_m=moved, joint=carrier))
        for key, x in box.keypoints_body_m.items():
            points[prefix + key] = x + middle
            if moving and joint is not None:
                carriers[prefix + key] = joint
    joints = {joint for joint, _, _ in BLOCKS[name] if joint is not None and moving}
    return Spacecraft(
        name=name,
        parts=tuple(parts),
        materials=box.materials,
        keypoints_body_m=points,
        skeleton=(("B1", "B2"), ("B1", "T1")),
        joints=tuple(Joint(each, "revolute", np.zeros(3), AXIS) for each in sorted(joints)),
        keypoint_joints=carriers,
    )


@dataclass(frozen=True)
class Member:
    """A body of an image: its spacecraft, its pose and the value of its joint; None where it has none
    that moves."""

    name: str
    R: np.ndarray
    t: np.ndarray
    wing_rad: float | None = None

    def link(self, joint: str | None) -> tuple[np.ndarray, np.ndarray]:
        """R_cam_from_link and t_link_cam_m."""
        turn = Rotation.from_rotvec(AXIS * (self.wing_rad or 0.0 if joint else 0.0)).as_matrix()
        return self.R @ turn, self.t

    def blocks(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """R_cam_from_block, its middle in camera axes, and its half sides."""
        found = []
        for joint, middle, half in BLOCKS[self.name]:
            R, t = self.link(joint)
            found.append((R, R @ middle + t, half))
        return found


@dataclass
class Image:
    """What the camera sees of several bodies."""

    members: list[Member]
    depth: np.ndarray = field(init=False)
    part: np.ndarray = field(init=False)
    body: np.ndarray = field(init=False)
    silhouettes: list[set[tuple[int, int]]] = field(init=False)
    """Column and row of every pixel that each body covers without the others, also beyond the image."""

    def __post_init__(self) -> None:
        shape = CAMERA.height_px, CAMERA.width_px
        self.depth, self.part = np.full(shape, np.inf), np.full(shape, -1)
        self.body = np.full(shape, -1)
        self.silhouettes = []
        first = 0
        for number, member in enumerate(self.members):
            self.silhouettes.append(set())
            for R, t, half in member.blocks():
                (u0, v0), (u1, v1) = window(R, t, half)
                v, u = np.mgrid[v0 : v1 + 1, u0 : u1 + 1]
                depth, side = slabs(R, t, half, u, v)
                hit = np.isfinite(depth)
                self.silhouettes[-1].update(zip(u[hit].tolist(), v[hit].tolist(), strict=True))
                hit &= (u >= 0) & (u < CAMERA.width_px) & (v >= 0) & (v < CAMERA.height_px)
                at = v[hit], u[hit]
                nearer = depth[hit] < self.depth[at]
                at = at[0][nearer], at[1][nearer]
                self.depth[at], self.body[at] = depth[hit][nearer], number
                self.part[at] = side[hit][nearer] + first
                first += 6

    def labels(self, number: int) -> dict[str, Any]:
        """The labels of a body."""
        member, mask = self.members[number], self.body == number
        rle = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
        first = 6 * sum(len(BLOCKS[each.name]) for each in self.members[:number])
        points, corners = {}, []
        for (joint, _, _), (R, t, half) in zip(BLOCKS[member.name], member.blocks(), strict=True):
            x_cam = cuboid.corners(half) @ R.T + t
            uv = x_cam[:, :2] / x_cam[:, 2:] * [CAMERA.fx_px, CAMERA.fy_px]
            uv += [CAMERA.cx_px, CAMERA.cy_px]
            corners.append(uv)
            inside = ((uv > -0.5) & (uv < [CAMERA.width_px - 0.5, CAMERA.height_px - 0.5])).all(axis=1)
            facing = cuboid.seen_corners(R, t, half)
            for key, x, px, is_in, looks in zip(cuboid.NAMES, x_cam, uv, inside, facing, strict=True):
                seen = looks and not self._is_behind(x)
                visibility = (2 if seen else 1) if is_in else 0
                points[("" if joint is None else f"{joint} ") + key] = [*map(float, px), visibility]
        uv = np.concatenate(corners)
        silhouette = len(self.silhouettes[number])
        x, y, z, w = Rotation.from_matrix(member.R).as_quat(canonical=True)
        parts = [part.name for part in spacecraft(member.name).parts]
        labels = {
            "spacecraft": member.name,
            "box_visible_px": [int(x) for x in coco_mask.toBbox(rle)] if mask.any() else None,
            "box_whole_px": [*uv.min(axis=0), *np.ptp(uv, axis=0)],
            "mask_rle": {"size": list(mask.shape), "counts": rle["counts"].decode()},
            "mask_area_px": int(mask.sum()),
            "fraction_visible": mask.sum() / silhouette if silhouette else None,
            "part_area_px": {name: int((self.part == first + i).sum()) for i, name in enumerate(parts)},
            "keypoints": points,
            "q_cam_from_body": [w, x, y, z],
            "t_body_cam_m": list(map(float, member.t)),
            "range_m": float(np.linalg.norm(member.t)),
            "phase_angle_rad": float(
                np.arccos(cuboid.SUN_BODY @ (-member.R.T @ member.t) / np.linalg.norm(member.t))
            ),
            "sun_direction_body": list(cuboid.SUN_BODY),
        }
        if member.wing_rad is not None:
            R, t = member.link("wing")
            x, y, z, w = Rotation.from_matrix(R).as_quat(canonical=True)
            wing = {"value": member.wing_rad, "rate": 0.0}
            wing |= {"q_cam_from_link": [w, x, y, z], "t_link_cam_m": list(map(float, t))}
            labels["joints"] = {"wing": wing}
        return labels

    def _is_behind(self, x_cam: np.ndarray) -> bool:
        """Whether the segment from the camera to a point passes through a block."""
        for member in self.members:
            for R, t, half in member.blocks():
                d, o = x_cam @ R, -R.T @ t
                low, high = np.sort(np.stack([(-half - o) / d, (half - o) / d]), axis=0)
                enter, leave = low.max(), high.min()
                if enter < leave and 0 < enter < 1 - 1e-6:
                    return True
        return False


def window(R: np.ndarray, t: np.ndarray, half: np.ndarray) -> tuple[list[int], list[int]]:
    """First and last column and row that a block in front of the camera may cover."""
    x_cam = cuboid.corners(half) @ R.T + t
    uv = x_cam[:, :2] / x_cam[:, 2:] * [CAMERA.fx_px, CAMERA.fy_px] + [CAMERA.cx_px, CAMERA.cy_px]
    return np.floor(uv.min(axis=0)).astype(int).tolist(), np.ceil(uv.max(axis=0)).astype(int).tolist()


def slabs(
    R: np.ndarray, t: np.ndarray, half: np.ndarray, u: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`cuboid.slabs` for any pixels, with infinite depth for a miss."""
    rays = np.stack(
        [(u - CAMERA.cx_px) / CAMERA.fx_px, (v - CAMERA.cy_px) / CAMERA.fy_px, np.ones(u.shape)], axis=-1
    )
    d, o = rays @ R, -R.T @ t
    low, high = np.sort(np.stack([(-half - o) / d, (half - o) / d]), axis=0)
    enter = low.max(axis=-1)
    hit = (enter < high.min(axis=-1)) & (enter > 0)
    axis = low.argmax(axis=-1)
    towards = np.take_along_axis(d, axis[..., None], axis=-1)[..., 0] < 0
    return np.where(hit, enter, np.inf), np.where(hit, 2 * axis + towards, -1)


NAMES = ("companion", "twin")
"""The bodies beside the target: a plate, and a spacecraft like the target, whose wing does not move."""
HIDDEN_TARGET, ALONE, TARGET_OUT, HIDDEN_PLATE = 1, 2, 3, 4
"""Frames: the plate hides the target; neither body is in the image; the target is not; the plate is
hidden."""


def images(frames: int = 8, *, moving: bool = True) -> list[Image]:
    """Frames of a target with a wing, which moves or not, a plate and a twin."""
    random = np.random.default_rng(11)
    out, found = np.array([11.0, 0, 10]), []
    for index in range(frames):
        target = np.array([-0.6, 0.2, 12.0]) + random.normal(0, 0.3, 3)
        plate = np.array([0.8, 0.4, 9.0]) + random.normal(0, 0.3, 3)
        twin = np.array([3.0, -1.5, 18.0]) + random.normal(0, 0.3, 3)
        turns = [Rotation.random(random_state=random).as_matrix() for _ in range(3)]
        wing = float(random.uniform(-2, 2))
        if index == HIDDEN_TARGET:
            target, plate, twin = np.array([0, 0, 60.0]), np.array([0, 0, 6.0]), out
            turns[1] = np.eye(3)
        if index == ALONE:
            plate, twin = out, -out * [1, 1, -1]
        if index == TARGET_OUT:
            target = -out * [1, 1, -1]
        if index == HIDDEN_PLATE:
            target, plate, twin = np.array([0, 0, 6.0]), np.array([0, 0, 80.0]), out
            turns[0] = np.eye(3)
        found.append(
            Image(
                [
                    Member("winged", turns[0], target, wing if moving else None),
                    Member("plate", turns[1], plate),
                    Member("winged", turns[2], twin),
                ]
            )
        )
    return found


def write_dataset(folder: Path, frames: int = 8, *, moving: bool = True) -> Path:
    """The frames of :func:`images` as a dataset."""
    cuboid.start_dataset(folder, [spacecraft("winged", moving)])
    for name, craft in zip(NAMES, (spacecraft("plate"), spacecraft("winged", False)), strict=True):
        (folder / "bodies" / name).mkdir(parents=True)
        write_spacecraft(craft, folder / "bodies" / name)
    lines = []
    for index, image in enumerate(images(frames, moving=moving)):
        target, *others = (image.labels(number) for number in range(3))
        lines.append(
            {
                "index": index,
                "t_s": 10.0 * index,
                "epoch_utc": cuboid.instant(10.0 * index),
                "sequence": index,
                "image": f"images/{index:06d}.png",
                "truth": f"truth/{index:06d}.npz",
                "sun_fraction_target": 1.0,
                "sun_fraction_camera": 1.0,
                "solar_flux_w_m2": 1361.0,
                **target,
                "bodies": dict(zip(NAMES, others, strict=True)),
            }
        )
        grey = np.where(image.part >= 0, 10 * image.part + 30, index % 20).astype(np.uint8)
        cv2.imwrite(str(folder / lines[-1]["image"]), grey)
        np.savez_compressed(
            folder / lines[-1]["truth"],
            part_id=image.part.astype(np.int16),
            body_id=image.body.astype(np.int16),
            depth_m=np.where(np.isfinite(image.depth), image.depth, np.nan).astype(np.float32),
        )
    save_trajectory(cuboid.trajectory(lines), folder / "trajectory.npz")
    cuboid.write_lines(folder, lines)
    return folder


def read_lines(folder: Path) -> list[dict[str, Any]]:
    text = (folder / "labels" / "shard-00000.jsonl").read_text()
    return [json.loads(line) for line in text.splitlines()]
