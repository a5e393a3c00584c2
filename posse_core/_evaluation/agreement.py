"""Whether the files that describe a dataset agree: scenario, manifest, camera, spacecraft and labels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_json
from posse_core._dataset.layout import BODIES, CAMERA, SCENARIO, SPACECRAFT
from posse_core._dataset.mesh import Mesh
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._errors import InputError
from posse_core._evaluation.result import Fault, Result
from posse_core._evaluation.scenarios import Scenarios
from posse_core._files.trajectory import load_trajectory
from posse_core._model.camera import Camera
from posse_core._model.label_line import BodyLabels, LabelLine, annotator_of
from posse_core._model.spacecraft import Spacecraft
from posse_core._scenario.model import Scenario
from posse_core._trajectory.problem import orbit_epoch

CAMERA_ERROR = 1e-4
"""Relative difference of focal lengths; other programs round them."""
SAME = 1e-9
"""Relative difference of numbers that two files have, and of lengths over the spacecraft's size."""
ROTATION_ERROR = 1e-6
FAR_KEYPOINT_SHARE = 0.25
"""How far a keypoint may be outside the box of the mesh, over its longest side."""
_NOT_IN_EVERY_LINE = {"joints", "is_carried", "flow_duration_s", "box_whole_px"}


def check_camera(dataset: Dataset) -> Result:
    """Whether the focal lengths of ``camera.json`` in metres are those in pixels."""
    result = Result("camera", "focal lengths in metres and in pixels agree", 1)
    value = read_json(dataset.folder / CAMERA)
    matrix = value["cameraMatrix"]
    for i, (focal, pitch) in enumerate((("fx", "ppx"), ("fy", "ppy"))):
        metres, size = value.get(focal), value.get(pitch)
        if metres is not None and size and abs(metres / size / matrix[i][i] - 1) > CAMERA_ERROR:
            result.faults.append(
                Fault(
                    None,
                    f"{focal} / {pitch} is {metres / size:.6g} px, cameraMatrix has {matrix[i][i]:.6g}",
                )
            )
    return result


def check_spacecraft(dataset: Dataset, scenarios: Scenarios) -> Result:
    """Whether the spacecraft's files make sense, and are what the scenario builds."""
    result = Result("spacecraft", "symmetries, skeleton and mesh make sense")
    scene = scenarios.own_scene
    built: dict[str, Spacecraft] = {}
    if scene is not None:
        result.proves = "files are what the scenario builds"
        target = scene.spacecraft
        built = {f"{SPACECRAFT}/{target.name}": target}
        built |= {f"{BODIES}/{b.name}/{b.spacecraft.name}": b.spacecraft for b in scene.others}
    for where, info, mesh in _crafts(dataset):
        result.checked += 1
        faults = list(_craft_faults(info, mesh))
        craft = built.get(where)
        if scene is not None and craft is None:
            faults.append("the scenario has no such spacecraft")
        if craft is not None:
            faults += _unlike_the_scenario(info, mesh, craft)
        result.faults += [Fault(None, f"{where}: {text}") for text in faults]
    return result


def _crafts(dataset: Dataset) -> Iterator[tuple[str, SpacecraftInfo, Mesh]]:
    for name, info in dataset.spacecraft_by_name.items():
        yield f"{SPACECRAFT}/{name}", info, dataset.mesh(name)
    for name, info in dataset.bodies.items():
        yield f"{BODIES}/{name}/{info.name}", info, dataset.body_mesh(name)


def _craft_faults(info: SpacecraftInfo, mesh: Mesh) -> Iterator[str]:
    for number, R in enumerate(info.symmetries):
        if np.abs(R @ R.T - np.eye(3)).max() > ROTATION_ERROR or np.linalg.det(R) < 0:
            yield f"symmetry {number} is no rotation"
        elif np.abs(R - np.eye(3)).max() < ROTATION_ERROR:
            yield f"symmetry {number} is the identity"
    for pair in info.skeleton:
        for name in pair:
            if name not in info.keypoints_body_m:
                yield f"skeleton names {name!r}, which is no keypoint"
        if pair[0] == pair[1]:
            yield f"skeleton joins {pair[0]!r} to itself"
    if len(set(info.parts)) < len(info.parts):
        yield "two parts have the same name"
    low_m, high_m = mesh.vertices_body_m.min(axis=0), mesh.vertices_body_m.max(axis=0)
    margin_m = FAR_KEYPOINT_SHARE * float(np.max(high_m - low_m))
    for name, point_m in info.keypoints_body_m.items():
        if np.any(point_m < low_m - margin_m) or np.any(point_m > high_m + margin_m):
            yield f"keypoint {name!r} is far off the mesh"


def _unlike_the_scenario(info: SpacecraftInfo, mesh: Mesh, craft: Spacecraft) -> Iterator[str]:
    if list(info.parts) != [part.name for part in craft.parts]:
        yield "its parts are not those that the scenario builds"
        return
    keypoints = craft.keypoints_body_m
    if list(info.keypoints_body_m) != list(keypoints) or any(
        not _same(x, keypoints[name]) for name, x in info.keypoints_body_m.items()
    ):
        yield "its keypoints are not those that the scenario builds"
    if [tuple(pair) for pair in info.skeleton] != [tuple(pair) for pair in craft.skeleton]:
        yield "its skeleton is not the one that the scenario builds"
    if len(info.symmetries) != len(craft.symmetries) or not all(
        _same(a, b) for a, b in zip(info.symmetries, craft.symmetries, strict=True)
    ):
        yield "its symmetries are not those that the scenario builds"
    for number, part in enumerate(craft.parts):
        corners_m = mesh.vertices_body_m[mesh.faces[mesh.part_id == number]]
        if not _same(corners_m, part.vertices_body_m[part.faces]):
            yield f"the triangles of part {part.name!r} are not those that the scenario builds"
            return
    if mesh.part_id.max(initial=-1) >= len(craft.parts):
        yield "its mesh has triangles of no part"
    if [_values(joint) for joint in info.joints] != [_values(joint) for joint in craft.joints]:
        yield "its joints are not those that the scenario moves"


def _values(record: Any) -> list[object]:
    values = [getattr(record, field.name) for field in fields(record)]
    return [np.asarray(x).tolist() if isinstance(x, np.ndarray | tuple) else x for x in values]


def _same(a: object, b: object) -> bool:
    a_, b_ = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    scale = max(1e-12, float(np.abs(b_).max(initial=0)))
    return a_.shape == b_.shape and bool(np.abs(a_ - b_).max(initial=0) <= SAME * scale)


def check_scenario(dataset: Dataset, scenarios: Scenarios) -> Result:
    """Whether manifest, camera, times and labels are those of the scenario."""
    result = Result("scenario", "manifest, camera, exposures and labels are those of the scenario")
    if scenarios.own is not None:
        result.checked += 1
        result.faults += [Fault(None, f"{SCENARIO}: {text}") for text in _whole(dataset, scenarios.own)]
    for line in dataset.label_lines:
        labels = LabelLine.from_json(line)
        scenario = scenarios.of(labels)
        if scenario is None:
            continue
        result.checked += 1
        result.faults += [Fault(labels.index, text) for text in _frame(labels, scenario)]
    if scenarios.faults:  # a component that is not installed here
        result.proves = f"not compared with all scenarios: {scenarios.faults[0]}"
    return result


def _whole(dataset: Dataset, scenario: Scenario) -> Iterator[str]:
    manifest = dataset.manifest
    if manifest.seed is not None and manifest.seed != scenario.seed:
        yield f"seed is {scenario.seed}, and the manifest's is {manifest.seed}"
    renderer = (manifest.renderer or {}).get("name", scenario.renderer.name)
    if renderer != scenario.renderer.name:
        yield f"renderer is {scenario.renderer.name}, and the manifest's is {renderer}"
    for key in _unlike_cameras(scenario.camera.camera(), dataset.camera):
        yield f"camera.json has another {key}"
    if set(dataset.sensors) != set(scenario.sensors):
        yield f"sensors are {', '.join(scenario.sensors) or 'none'}, and those of sensors/ others"
    members = {member for name, body in scenario.bodies.items() for member, _ in body.members(name)}
    if set(dataset.bodies) != members:
        yield f"bodies are {', '.join(sorted(members)) or 'none'}, and those of bodies/ others"
    try:
        epoch = load_trajectory(dataset.folder / "trajectory.npz").epoch_utc
        wanted = orbit_epoch(scenario.orbit).iso()
    except InputError:
        return  # said by ``trajectory``
    if epoch != wanted:
        yield f"the orbit's epoch is {wanted}, and the trajectory's is {epoch}"


def _unlike_cameras(one: Camera, other: Camera) -> Iterator[str]:
    for key in (
        "width_px",
        "height_px",
        "fx_px",
        "fy_px",
        "cx_px",
        "cy_px",
        "sensor_width_m",
        "line_time_s",
    ):
        if not _same(getattr(one, key), getattr(other, key)):
            yield key
    if not _same(one.distortion_coefficients, other.distortion_coefficients):
        yield "distortion"


def _frame(labels: LabelLine, scenario: Scenario) -> Iterator[str]:
    sensor, exposure_s = scenario.sensor, labels.exposure_s if labels.has("exposure_s") else None
    rule, (least, greatest) = sensor.auto_exposure, (2.0**stops for stops in sensor.exposure_stops)
    if exposure_s is not None:
        shortest_s, longest_s = sensor.exposure_s, sensor.exposure_s
        if rule is not None:
            shortest_s, longest_s = rule.shortest_s, rule.longest_s
        if not shortest_s * least <= exposure_s <= longest_s * greatest:
            if rule is not None:
                yield f"exposure_s is {exposure_s}, not within those of auto_exposure"
            else:
                yield f"exposure_s is {exposure_s}, and the scenario's is {sensor.exposure_s}"
    chosen = {choice.name for choice in scenario.annotators}
    for key in BodyLabels.model_fields:
        annotator = annotator_of(key)
        if annotator is None or key in _NOT_IN_EVERY_LINE:
            continue
        if labels.has(key) and annotator not in chosen:
            yield f"{key} is labelled, and the scenario has no annotator {annotator}"
        if annotator in chosen and not labels.has(key):
            yield f"{key} is not labelled, and the scenario has the annotator {annotator}"
