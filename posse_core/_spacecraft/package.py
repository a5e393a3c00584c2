"""A spacecraft package: a folder with ``spacecraft.yaml`` and the mesh that it names."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath

import numpy as np
from pydantic import Field, field_validator

from posse_core._errors import InputError
from posse_core._interfaces.scene import SceneSource
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.options import validated
from posse_core._scenario.materials import MaterialKeys
from posse_core._spacecraft.files import mesh_files
from posse_core._spacecraft.joint_keys import JointKeys, Triple
from posse_core._spacecraft.keypoint_file import (
    GivenPoint,
    KeypointModel,
    read_mapping,
)
from posse_core._spacecraft.materials import with_materials
from posse_core._spacecraft.mesh import spacecraft_from_raw
from posse_core._spacecraft.options import BodyAxes, MeshOptions, PackageOptions
from posse_core._spacecraft.reader import read_mesh

DESCRIPTION = "spacecraft.yaml"


class PackageModel(KeypointModel):
    """The keys of ``spacecraft.yaml``."""

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]*$", description="the class name in the labels")
    mesh: str = Field(description="path of the mesh file, within the package's folder")
    scale_m_per_unit: float = Field(gt=0, description="metres per unit of the mesh file")
    body_axes: BodyAxes = Field(description="the mesh axis along each body axis, such as 'x -z y'")
    centre_of_mass_m: Triple = Field(description="in metres along body axes from the mesh file's origin")
    keypoints: dict[str, GivenPoint] = Field(default_factory=dict, description="as in a keypoint file")
    joints: dict[str, JointKeys] | None = Field(
        None, description="by name; null: those that the mesh file's animations move"
    )
    materials: dict[str, MaterialKeys] = Field(
        default_factory=dict,
        description="name of a material of the mesh file, or a pattern → what replaces its values",
    )

    @field_validator("mesh")
    @classmethod
    def _stays_inside(cls, text: str) -> str:
        path = PurePosixPath(text)
        if path.is_absolute() or ".." in path.parts or "\\" in text:
            raise ValueError("the mesh is outside the package; move it into the folder")
        return text

    def joints_from_centre(self) -> dict[str, JointKeys] | None:
        """The joints with their origins measured from the centre of mass."""
        if self.joints is None or self.measured_from_m is None:
            return self.joints
        shift_m = np.array(self.measured_from_m) - self.centre_of_mass_m
        return {name: joint.shifted(shift_m) for name, joint in self.joints.items()}


class Package(SceneSource[PackageOptions]):
    """The scene source ``package``."""

    def build(self) -> Spacecraft:
        folder = self.options.package
        description = folder / DESCRIPTION
        model = _described(folder)
        mesh = _inside(folder, model.mesh)
        options = MeshOptions(
            mesh=mesh,
            scale_m_per_unit=model.scale_m_per_unit,
            body_axes=model.body_axes,
            centre_of_mass_m=model.centre_of_mass_m,
            keypoints=description,
            joints=model.joints_from_centre(),
        )
        points = model.records()
        craft = spacecraft_from_raw(read_mesh(mesh), options, model.name, points, joints_in=description)
        return with_materials(craft, model.materials, f"{description}: materials")


def package_files(folder: Path) -> dict[str, Path]:
    """The files that a package needs: path from its folder → file.

    Raises:
        InputError: the package cannot be read, or its mesh refers to a file by a path that a copy of the
            folder lacks.
    """
    name = _described(folder).mesh
    beside = PurePosixPath(name).parent
    files = mesh_files(_inside(folder, name))
    return {DESCRIPTION: folder / DESCRIPTION, **{str(beside / own): files[own] for own in files}}


def _described(folder: Path) -> PackageModel:
    description = folder / DESCRIPTION
    if not folder.is_dir():
        raise InputError(f"{folder}: no such package folder; make one with 'posse import MODEL'")
    return validated(
        PackageModel,
        read_mapping(description),
        lambda key: f"{description}: {'.'.join(map(str, key))}",
    )


def _inside(folder: Path, name: str) -> Path:
    """The path of the mesh, after a check that it is in the folder even when links are followed."""
    mesh = folder / name
    if not Path(os.path.realpath(mesh)).is_relative_to(folder.resolve()):
        raise InputError(f"{folder / DESCRIPTION}: mesh {name!r} leads out of the package by a link")
    return mesh
