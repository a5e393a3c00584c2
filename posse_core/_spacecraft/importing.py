"""Makes a spacecraft package from a mesh file, and summarises the file."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._model.spacecraft import Spacecraft
from posse_core._spacecraft.files import mesh_files
from posse_core._spacecraft.joint_keys import rounded, written
from posse_core._spacecraft.keypoint_file import Keypoints, located, read_keypoints
from posse_core._spacecraft.mesh import spacecraft_from_raw, stated_scale
from posse_core._spacecraft.options import MeshOptions, R_body_from_mesh
from posse_core._spacecraft.package import DESCRIPTION
from posse_core._spacecraft.proposals import propose_keypoints
from posse_core._spacecraft.raw import RawMesh

SCENARIO = "scenario.yaml"
KEYPOINT_COUNT = 16
"""Number of keypoints that are proposed by default."""


def summary(raw: RawMesh) -> dict[str, Any]:
    """A summary of a mesh file, for users and programs; sizes are in the file's units."""
    parts = []
    for part in raw.parts:
        material = raw.materials[part.material]
        textures = {
            "base colour": material.base_color_texture,
            "metallic-roughness": material.metallic_roughness_texture,
            "normal": material.normal_texture,
        }
        parts.append(
            {
                "name": part.name,
                "triangles": len(part.faces),
                "watertight": _watertight(part.vertices, part.faces),
                "material": part.material,
                "textures": {
                    kind: f"{texture.shape[1]}×{texture.shape[0]}"
                    for kind, texture in textures.items()
                    if texture is not None
                },
            }
        )
    return {
        "size_units": [float(x) for x in np.diff(raw.bounds, axis=0)[0]],
        "triangles": sum(len(part.faces) for part in raw.parts),
        "vertices": sum(len(part.vertices) for part in raw.parts),
        "parts": parts,
    }


def _watertight(vertices: Any, faces: Any) -> bool:
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    return bool(mesh.is_watertight)


@dataclass(frozen=True)
class Import:
    """A mesh as a spacecraft.

    Attributes:
        craft: with its keypoints.
        centre_of_mass_m: (3,) in body axes from the file's origin.
    """

    craft: Spacecraft
    centre_of_mass_m: Sequence[float]


def imported(
    raw: RawMesh,
    options: MeshOptions,
    title: str,
    *,
    keypoint_count: int = KEYPOINT_COUNT,
    symmetries: Sequence[FloatArray] = (),
) -> Import:
    """A mesh as a spacecraft, with proposed keypoints if its options name no file of them.

    Args:
        raw: the content of the file ``options.mesh``.
        options: scale, axes, origin, keypoints and joints.
        title: name of the spacecraft.
        keypoint_count: number of keypoints to propose.
        symmetries: rotations (3, 3) that leave the appearance unchanged; empty keeps those of the file
            of keypoints.

    Raises:
        InputError: the keypoints or the mesh cannot be used.
    """
    scale_m = stated_scale(raw, options.mesh, options.scale_m_per_unit)
    centre_m = options.centre_of_mass_m or rounded(
        scale_m * R_body_from_mesh(options.body_axes) @ raw.surface_centre
    )
    options = options.model_copy(update={"centre_of_mass_m": tuple(centre_m)})
    points = Keypoints() if options.keypoints is None else read_keypoints(options.keypoints)
    craft = spacecraft_from_raw(raw, options, title, points)
    if options.keypoints is None:
        proposed, carriers = located(
            propose_keypoints(craft, keypoint_count), craft.parts, craft.joints, options.mesh
        )
        craft = replace(craft, keypoints_body_m=proposed, keypoint_joints=carriers)
    if symmetries:
        craft = replace(craft, symmetries=tuple(symmetries))
    return Import(craft, centre_m)


def write_package(
    folder: Path,
    mesh: Path,
    craft: Spacecraft,
    *,
    scale_m_per_unit: float,
    body_axes: str,
    centre_of_mass_m: Sequence[float],
    pages: Mapping[str, bytes],
) -> None:
    """Make the package's folder: the mesh with its further files, the description, a sample scenario,
    and pages by their names.

    The folder is made completely or not at all.

    Raises:
        InputError: the folder already exists, or the mesh refers to a file by a path that a copy lacks.
    """
    if folder.exists():
        raise InputError(f"{folder}: already exists; remove it, or give another folder with --out")
    folder.parent.mkdir(parents=True, exist_ok=True)
    record = {
        "name": craft.name,
        "mesh": mesh.name,
        "scale_m_per_unit": scale_m_per_unit,
        "body_axes": body_axes,
        "centre_of_mass_m": [float(x) for x in centre_of_mass_m],
        "measured_from_m": [float(x) for x in centre_of_mass_m],
        "keypoints": _keypoints(craft),
        **({"joints": joint_keys(craft)} if craft.joints else {}),
        "skeleton": [list(pair) for pair in craft.skeleton],
        "symmetries": [R.tolist() for R in craft.symmetries],
    }
    temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        for name, source in mesh_files(mesh).items():
            target = temporary / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
        write_bytes(temporary / DESCRIPTION, _description(record).encode())
        write_bytes(temporary / SCENARIO, _scenario(craft).encode())
        for name, page in pages.items():
            write_bytes(temporary / name, page)
        os.chmod(temporary, 0o755)
        os.rename(temporary, folder)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def joint_keys(craft: Spacecraft) -> dict[str, Any]:
    """The joints by name, as the description has them."""
    return {joint.name: written(joint, craft.parts) for joint in craft.joints}


def _keypoints(craft: Spacecraft) -> dict[str, Any]:
    points = {
        name: [round(float(x), 6) for x in point] for name, point in craft.keypoints_body_m.items()
    }
    if not craft.joints:
        return points
    # At a hinge, a position alone would not tell which of two parts a keypoint is on.
    return {
        name: {"at": point, "joint": craft.keypoint_joints.get(name)} for name, point in points.items()
    }


def _description(record: Mapping[str, Any]) -> str:
    """The description as YAML, with one line per keypoint and joint."""
    lines = [
        "# A spacecraft package, in metres and body axes. Keypoints and joints are measured from",
        "# measured_from_m, so they stay on the mesh where centre_of_mass_m alone is changed.",
    ]
    for key, value in record.items():
        if isinstance(value, dict) and value:
            lines.append(f"{key}:")
            lines.extend(f"  {_key(name)}: {json.dumps(point)}" for name, point in value.items())
        else:
            lines.append(f"{key}: {json.dumps(value, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    """A name as a key of YAML, which takes words such as ``no`` for something else."""
    is_plain = re.fullmatch(r"[^\W\d][\w.-]*", name) is not None and yaml.safe_load(name) == name
    return name if is_plain else json.dumps(name, ensure_ascii=False)


def _scenario(craft: Spacecraft) -> str:
    """A scenario for the spacecraft: an inspection ellipse of about three radii in low Earth orbit.

    Where its file has animations, they are played once.
    """
    reach = float(f"{3.0 * craft.radius_m:.2g}")
    across = float(f"{0.75 * reach:.3g}")
    scenario: dict[str, Any] = {
        "target": {"package": "."},
        "orbit": {
            "elements": {
                "epoch_utc": "2022-01-31T02:02:27.58",
                "a_m": 7123931.35,
                "e": 0.0000898,
                "i_deg": 98.23,
                "raan_deg": 334.4,
                "argp_deg": 52.44,
                "mean_anomaly_deg": 318.1,
            }
        },
        "relative": {"roe_m": [0, 0, -reach, -across, -reach, -across]},
        "times": {"duration_orbits": 1, "count": 24},
    }
    animated = [joint for joint in craft.joints if joint.animations]
    if animated:
        scenario["joints"] = {joint.name: "animation" for joint in animated}
        ends_s = [next(iter(joint.animations.values())).end_s for joint in animated]
        scenario["times"] = {"duration_s": max(ends_s), "count": 24}
    head = "# Run it with: posse run scenario.yaml\n"
    return head + yaml.safe_dump(scenario, sort_keys=False, default_flow_style=None)
