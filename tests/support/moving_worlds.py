"""Datasets of spacecraft with joints and of several bodies, from states that are given by hand.

Labels and arrays are those of the program's own annotators; ``posse validate`` is what is tested.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cuboid
import cv2
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from posse_core._dataset.camera import write_camera
from posse_core._dataset.sensors import SensorInfo, write_sensor
from posse_core._dataset.spacecraft import write_spacecraft
from posse_core._environment.time import Epoch
from posse_core._files.trajectory import save_trajectory
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import Look, SensorLook, Standpoint
from posse_core._interfaces.sensor import SensorSetting
from posse_core._model.camera import Camera
from posse_core._model.craft_state import BodyState, Rates
from posse_core._model.joints import Articulation, Joint
from posse_core._model.label_line import ReadingLabels
from posse_core._model.mount import Mount
from posse_core._model.scene import Body, FrameState, Onward, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.component import ComponentChoice
from posse_core._scenario.sensor import SensorConfig
from posse_core._simulator.annotation import Annotation
from posse_core._simulator.sensing import reading_labels

ANNOTATORS = (
    *("box", "mask", "parts", "depth", "normals", "keypoints", "pose", "albedo"),
    *("optical-flow", "scene-flow"),
)
STEP_S = 2.0
MATERIALS = {"grey": Material("grey")}
MOUNT = Mount(np.array([0.3, -0.2, 0.1]), Rotation.from_rotvec([0.02, -0.03, 0.4]).as_matrix())
"""Of the scanner."""


def part(name: str, mesh: trimesh.Trimesh, joint: str | None = None) -> Part:
    return Part(
        name,
        np.asarray(mesh.vertices, dtype=np.float64),
        np.asarray(mesh.faces, dtype=np.int32),
        np.asarray(mesh.vertex_normals, dtype=np.float32),
        np.zeros((len(mesh.vertices), 2), dtype=np.float32),
        "grey",
        joint,
    )


def box(size: Sequence[float], at: Sequence[float]) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(at)
    return mesh


def winged(name: str = "winged") -> Spacecraft:
    """A bus, a wing that turns about y, a plate that slides on the wing's tip, and a dish on the bus."""
    dish = trimesh.creation.icosphere(1, 0.35)
    dish.apply_translation([0.0, 0.0, 0.9])
    joints = (
        Joint("wing", "revolute", np.array([0.0, 0.6, 0.1]), np.array([0.0, 1.0, 0.0])),
        Joint(
            "slide",
            "prismatic",
            np.array([0.0, 2.2, 0.1]),
            np.array([0.6, 0.8, 0.0]),
            parent="wing",
            limits=(-0.6, 0.6),
        ),
    )
    parts = (
        part("bus", box((1.0, 1.1, 0.9), (0, 0, 0))),
        part("wing", box((0.8, 1.4, 0.06), (0, 1.4, 0.1)), "wing"),
        part("plate", box((0.5, 0.3, 0.12), (0, 2.35, 0.16)), "slide"),
        part("dish", dish),
    )
    keypoints = {
        "bus": [0.5, 0.55, 0.45],
        "wing": [0.4, 2.1, 0.13],
        "inner": [-0.4, 0.7, 0.07],
        "tip": [0.25, 2.5, 0.22],
        "dish": [0.0, 0.0, 1.25],
    }
    carriers = {"wing": "wing", "inner": "wing", "tip": "slide"}
    return Spacecraft(
        name,
        parts,
        MATERIALS,
        {key: np.array(x) for key, x in keypoints.items()},
        joints=joints,
        keypoint_joints=carriers,
    )


def gripper() -> Spacecraft:
    """A structure of the chaser's own: a boom with a finger that turns."""
    finger = Joint("finger", "revolute", np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0]))
    return Spacecraft(
        "gripper",
        (
            part("boom", box((0.05, 0.06, 0.5), (0, 0, 0.25))),
            part("claw", box((0.12, 0.05, 0.2), (0, 0, 0.6)), "finger"),
        ),
        MATERIALS,
        {"root": np.zeros(3), "claw": np.array([0.06, 0.025, 0.7])},
        joints=(finger,),
        keypoint_joints={"claw": "finger"},
    )


def world(kind: str, camera: Camera) -> Scene:
    """One winged craft; or beside it two more and the gripper, which the chaser carries."""
    if kind == "rigid":
        return Scene(winged().welded(()), camera)
    others = (Body("left", winged("probe")), Body("right", winged("probe")), Body("arm", gripper()))
    return Scene(winged(), camera, others if kind == "many" else ())


def states(scene: Scene, frames: int = 3, *, spin_rad_s: float = 0.02) -> list[FrameState]:
    """Frames of random attitudes, joints and rates; the bodies overlap in the image."""
    made = [_state(scene, index, spin_rad_s) for index in range(frames)]

    def with_onward(index: int) -> FrameState:
        following = index + 1 < frames
        return replace(
            made[index],
            onward=Onward(
                STEP_S if following else 0.0,
                lambda after_s: made[index].after(after_s),
                lambda: with_onward(index + 1) if following else None,
            ),
        )

    return [with_onward(index) for index in range(frames)]


def _state(scene: Scene, index: int, spin_rad_s: float) -> FrameState:
    rng = np.random.default_rng([11, index])
    omega_camera_rad_s = rng.uniform(-0.3, 0.3, 3) * spin_rad_s
    places = {"": (0.2, -0.6, 8.0), "left": (-1.3, 0.1, 6.5), "right": (1.4, 0.5, 10.0)}

    def body(name: str, spacecraft: Spacecraft) -> BodyState:
        joints = spacecraft.joints
        moving = Articulation(
            joints,
            np.array([rng.uniform(*np.clip(joint.limits, -1.2, 1.2)) for joint in joints]),
            rng.uniform(-1, 1, len(joints)) * spin_rad_s,
        )
        if name == "arm":
            R, t_m = Rotation.from_rotvec([-0.5, 0.4, 0]).as_matrix(), np.array([0.1, 0.35, 0.9])
            rates = Rates(
                np.cross(omega_camera_rad_s, t_m), R.T @ omega_camera_rad_s, omega_camera_rad_s
            )
            return BodyState(R, t_m, rates, moving, is_carried=True)
        return BodyState(
            Rotation.random(random_state=rng).as_matrix(),
            np.array(places[name]) + rng.uniform(-0.3, 0.3, 3),
            Rates(
                rng.uniform(-2, 2, 3) * spin_rad_s,
                rng.uniform(-1, 1, 3) * spin_rad_s,
                omega_camera_rad_s,
            ),
            moving,
        )

    target = body("", scene.spacecraft)
    R = target.R_cam_from_body
    r_target_m = np.array([7e6, 0.0, 0.0])
    return FrameState.of(
        index=index,
        t_s=STEP_S * index,
        epoch_jd_tt=2459610.5,
        R_cam_from_body=R,
        t_body_cam_m=target.t_body_cam_m,
        R_cam_from_eci=R,
        R_ecef_from_eci=np.eye(3),
        r_camera_eci_m=r_target_m - R.T @ target.t_body_cam_m,
        r_target_eci_m=r_target_m,
        r_sun_eci_m=r_target_m + 1.5e11 * cuboid.SUN_BODY,
        r_moon_eci_m=np.array([0.0, 4e8, 0.0]),
        solar_flux_w_m2=1361.0,
        sun_fraction_target=1.0,
        sun_fraction_camera=1.0,
        sun_angular_radius_rad=0.00465,
        rates=target.rates,
        articulation=target.articulation,
        others=tuple(body(each.name, each.spacecraft) for each in scene.others),
    )


def write_world(
    folder: Path,
    scene: Scene,
    frames: Sequence[FrameState],
    *,
    annotators: Sequence[str] = ANNOTATORS,
    scanner: Mapping[str, Any] | None = None,
) -> Path:
    """Write the dataset of some states, as a run would, but for the images.

    scanner: options of a lidar beside the camera, at :data:`MOUNT`; None for no lidar.
    """
    for name in ("images", "truth", "labels", "spacecraft"):
        (folder / name).mkdir(parents=True)
    write_camera(scene.camera, folder / "camera.json")
    write_spacecraft(scene.spacecraft, folder / "spacecraft")
    for body in scene.others:
        (folder / "bodies" / body.name).mkdir(parents=True)
        write_spacecraft(body.spacecraft, folder / "bodies" / body.name)
    caster = RayCaster(scene)
    registry = load_plugins().registry
    choices = [ComponentChoice(name=name) for name in annotators]
    annotation = Annotation(choices, registry, Epoch.from_iso("2022-01-31T02:02:27.58"))
    lines = []
    for state in frames:
        stand = Standpoint(state, Mount(), 0, "annotator", duration_s=state.onward.duration_s)
        look = Look(stand, scene, caster.through)
        labels = annotation.labels(look)
        readings = {} if scanner is None else {"scanner": _scans(folder, scene, state, caster, scanner)}
        line = annotation.line(look, labels, 0.002, readings).as_json()
        line |= {
            "image": f"images/{state.index:06d}.png",
            "truth": f"truth/{state.index:06d}.npz",
            "epoch_utc": cuboid.instant(state.t_s),
        }
        lines.append(json.loads(json.dumps(line)))
        np.savez_compressed(folder / line["truth"], **labels.arrays)
        image = np.zeros((scene.camera.height_px, scene.camera.width_px), dtype=np.uint8)
        image[0, :: state.index + 2] = 200
        cv2.imwrite(str(folder / line["image"]), image)
    _save_trajectory(folder, frames)
    write_lines(folder, lines)
    return folder


def _save_trajectory(folder: Path, frames: Sequence[FrameState]) -> None:
    rows = [
        {
            "t_s": state.t_s,
            "sequence": state.sequence,
            "sun_fraction_target": state.sun_fraction_target,
            "q_cam_from_body": np.roll(
                Rotation.from_matrix(state.craft.R_cam_from_body).as_quat(canonical=True), 1
            ),
            "t_body_cam_m": state.craft.t_body_cam_m,
            "v_body_cam_m_s": state.craft.rates.v_body_cam_m_s,
        }
        for state in frames
    ]
    rates = {
        key: np.array([getattr(state.craft.rates, key) for state in frames])
        for key in ("omega_body_rad_s", "omega_camera_rad_s")
    }
    save_trajectory(replace(cuboid.trajectory(rows), **rates), folder / "trajectory.npz")


def write_lines(folder: Path, lines: list[dict[str, Any]]) -> None:
    """Write label lines, and sign the dataset as it is now."""
    cuboid.write_lines(folder, lines)


def _scans(
    folder: Path, scene: Scene, state: FrameState, caster: RayCaster, options: Mapping[str, Any]
) -> tuple[ReadingLabels, ...]:
    registry = load_plugins().registry
    sensor = registry.create("sensor", "lidar", registry.options("sensor", "lidar", options))
    sensor.open(SensorSetting("scanner", 0, scene, SensorConfig(), MOUNT, lambda look: None))
    place = folder / "sensors/scanner.json"
    if not place.exists():
        (folder / "sensors/scanner").mkdir(parents=True)
        write_sensor(SensorInfo("scanner", "lidar", MOUNT, None, None, options), place)
    stand = Standpoint(state, MOUNT, 0, "sensor scanner")
    look = SensorLook(stand, scene, caster.through, lambda request: None)
    reading = sensor.sense(look)
    name = f"sensors/scanner/{state.index:06d}.npz"
    np.savez_compressed(folder / name, **reading.arrays)
    said = reading_labels(look, reading, "scanner")
    return (said.model_copy(update={"files": (name,)}),)
