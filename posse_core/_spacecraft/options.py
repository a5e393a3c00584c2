"""Options of the core's scene sources. This module is fast to import."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, field_validator

from posse_core._arrays import FloatArray
from posse_core._plugins.options import Options
from posse_core._spacecraft.joint_keys import JointKeys


def R_body_from_mesh(axes: str) -> FloatArray:
    """(3, 3) rotation for ``body_axes``: row k selects the mesh axis, with its sign, that is body axis
    k.

    Raises:
        ValueError: the text does not give three different axes, or gives a mirror image.
    """
    words = axes.lower().split()
    names = [word.lstrip("+-") for word in words]
    if sorted(names) != ["x", "y", "z"] or any(
        len(w) - len(n) > 1 for w, n in zip(words, names, strict=True)
    ):
        raise ValueError("body_axes takes three different mesh axes with signs, such as 'x -z y'")
    R = np.zeros((3, 3))
    for row, (word, name) in enumerate(zip(words, names, strict=True)):
        R[row, "xyz".index(name)] = -1.0 if word[0] == "-" else 1.0
    if np.linalg.det(R) < 0.0:
        signs = [
            f"{'' if word[0] == '-' else '-'}{name}" for word, name in zip(words, names, strict=True)
        ]
        ways = " or ".join(
            repr(" ".join(signs[k] if k == row else word for k, word in enumerate(words)))
            for row in range(3)
        )
        raise ValueError(f"body_axes {axes!r} is a mirror image; use {ways}")
    return R


def _checked_axes(text: str) -> str:
    R_body_from_mesh(text)
    return text


BodyAxes = Annotated[str, AfterValidator(_checked_axes)]
"""Mesh axes along the body axes, such as ``"x -z y"``; they must form a rotation."""


class VariantOptions(Options):
    """Options of all spacecraft that are made by code."""

    missing_parts: tuple[str, ...] = Field(
        (), description="names of parts to leave out, with their keypoints"
    )
    variant_seed: int | None = Field(
        None,
        ge=0,
        description="seed for domain randomisation: random colours, roughness, wrinkles, panel angle and"
        " missing parts; without it, the spacecraft as published",
    )
    variant_missing_parts: int = Field(
        2, ge=0, description="maximum number of parts (or groups of parts) that a variant lacks"
    )


class AquaOptions(VariantOptions):
    """Options of the Aqua-like spacecraft, a bus with one long solar wing."""

    panel_angle_deg: float = Field(
        0.0, ge=-180.0, le=180.0, description="rotation of the solar wing about its axis, body Y"
    )
    variant_panel_angle_deg: float = Field(
        45.0, ge=0.0, le=180.0, description="largest additional random rotation of the wing in a variant"
    )


class ClusterOptions(VariantOptions):
    """Options of the Cluster-like spacecraft, a spinning drum with booms."""


class FamilyOptions(Options):
    """Options of the family of random spacecraft."""

    seed: int = Field(0, ge=0, description="each seed is another spacecraft")
    size_m: tuple[float, float] = Field(
        (1.5, 15.0), description="least and greatest length of its longest side, m"
    )
    bus: tuple[Literal["box", "hexagon", "octagon", "cylinder"], ...] = Field(
        ("box", "box", "hexagon", "octagon", "cylinder"),
        min_length=1,
        description="shapes of the bus to choose from; one that is given twice is chosen twice as often",
    )
    wings: tuple[Literal[0, 1, 2, 4], ...] = Field(
        (0, 1, 2, 2, 2, 4),
        min_length=1,
        description="numbers of solar wings to choose from; a hexagon has two at most",
    )

    @field_validator("size_m")
    @classmethod
    def _in_order(cls, size_m: tuple[float, float]) -> tuple[float, float]:
        low, high = size_m
        if not 0.1 <= low <= high <= 100.0:
            raise ValueError("give the least size and then the greatest, within 0.1 … 100 m")
        return size_m


class MeshOptions(Options):
    """Options for a user's mesh file: glTF, OBJ, PLY or STL."""

    mesh: Path = Field(description="the mesh file: .glb, .gltf, .obj, .ply or .stl")
    scale_m_per_unit: float | None = Field(
        None, gt=0, description="metres per unit of the file; required, as no format reliably gives it"
    )
    body_axes: BodyAxes = Field(
        "x y z",
        description="the mesh axis along each of the body axes X, Y, Z; 'x -z y' converts Y up to Z up",
    )
    centre_of_mass_m: tuple[float, float, float] | None = Field(
        None,
        description="the origin of the body axes, in metres along body axes from the file's origin;"
        " default: the centroid of the surface",
    )
    keypoints: Path | None = Field(
        None,
        description="YAML or JSON file with keypoints: {T1: [x, y, z]}, in metres, body axes, from the"
        " centre of mass or from the file's measured_from_m",
    )
    joints: Mapping[str, JointKeys] | None = Field(
        None,
        description="joints by name, each {kind, parts, origin_m, axis, parent, limits_deg, limits_m,"
        " facing}; null: those that the file's animations move",
    )


class PackageOptions(Options):
    """Options for a spacecraft package, as 'posse import' makes it."""

    package: Path = Field(description="the package's folder, with spacecraft.yaml and the mesh")
