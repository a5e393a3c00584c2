"""Options of the core's scene sources. Cheap to import."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from posse_core._arrays import FloatArray
from posse_core._plugins.options import Options


def R_body_from_mesh(axes: str) -> FloatArray:
    """(3, 3) rotation of ``body_axes``: row k picks the mesh axis, with its sign, for body axis k.

    Raises:
        ValueError: not three different axes, or a mirror image.
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
        raise ValueError(f"body_axes {axes!r} is a mirror image; take {ways}")
    return R


def _checked_axes(text: str) -> str:
    R_body_from_mesh(text)
    return text


BodyAxes = Annotated[str, AfterValidator(_checked_axes)]
"""Mesh axes along the body axes, as in ``"x -z y"``: a rotation."""


class VariantOptions(Options):
    """What all spacecraft made by code take."""

    missing_parts: tuple[str, ...] = Field(
        (), description="names of parts to leave out, with their keypoints"
    )
    variant_seed: int | None = Field(
        None,
        ge=0,
        description="for domain randomisation: draws colours, roughness, wrinkles, the panels' angle"
        " and missing parts; none: the spacecraft as published",
    )
    variant_missing_parts: int = Field(
        2, ge=0, description="how many parts (or groups of parts) a variant may lack at most"
    )


class AquaOptions(VariantOptions):
    """Aqua-like: a bus with one long solar wing."""

    panel_angle_deg: float = Field(
        0.0, ge=-180.0, le=180.0, description="turn of the solar wing about its axis, body Y"
    )
    variant_panel_angle_deg: float = Field(
        45.0, ge=0.0, le=180.0, description="a variant turns the wing by up to so much more, either way"
    )


class ClusterOptions(VariantOptions):
    """Cluster-like: a spinning drum with booms."""


class MeshOptions(Options):
    """A mesh file of the user's own: glTF, OBJ, PLY, STL."""

    mesh: Path = Field(description="the file: .glb, .gltf, .obj, .ply, .stl")
    scale_m_per_unit: float | None = Field(
        None, gt=0, description="metres that one unit of the file is; no format can be trusted to say it"
    )
    body_axes: BodyAxes = Field(
        "x y z",
        description="the mesh axis along each of the body axes X, Y, Z; 'x -z y' turns Y up into Z up",
    )
    centre_of_mass_m: tuple[float, float, float] | None = Field(
        None,
        description="the body frame's origin, in metres along body axes from the file's origin;"
        " without it, the centroid of the surface",
    )
    keypoints: Path | None = Field(
        None, description="YAML or JSON: keypoints: {T1: [x, y, z]}, in metres in the body frame"
    )


class PackageOptions(Options):
    """A spacecraft package, as 'posse import' makes it."""

    package: Path = Field(description="its folder, with spacecraft.yaml and the mesh")
