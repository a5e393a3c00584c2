"""Scenario keys of the attitude: how the target is oriented, and where the camera looks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from posse_core._arrays import FloatArray
from posse_core._plugins.options import Options
from posse_core._scenario.orbit import Vector3


def _not_zero(q: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not any(q):
        raise ValueError("a zero quaternion is no rotation; the identity is [1, 0, 0, 0]")
    return q


Quaternion = Annotated[
    tuple[float, float, float, float],
    Field(description="w, x, y, z; of any length above 0"),
    AfterValidator(_not_zero),
]
BodyAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


class NadirLaw(Options):
    """LVLH axes: body +z towards the Earth's centre, +y against the orbit's normal, +x along V-bar."""

    law: Literal["nadir"] = "nadir"


class SunPointingLaw(Options):
    """A body axis points at the Sun; the next one (x, y, z, x) as near as possible to ecliptic north."""

    law: Literal["sun-pointing"] = "sun-pointing"
    body_axis: BodyAxis = Field("+z", description="the axis that points at the Sun")


class InertialLaw(Options):
    """An attitude fixed in inertial axes."""

    law: Literal["inertial"] = "inertial"
    q_eci_from_body: Quaternion = Field(
        (1.0, 0.0, 0.0, 0.0), description="rotation from body to GCRF axes, scalar first"
    )


class SpinLaw(Options):
    """A steady spin about an axis that is fixed in inertial axes.

    At the epoch the axis is ``sun_angle_deg`` from the direction of the Sun, on the side of ecliptic
    north. At 90° it is the ecliptic's north pole, and the angle stays the same all year.
    """

    law: Literal["spin"] = "spin"
    body_axis: BodyAxis = Field("+z", description="the spin axis")
    rate_rpm: float = Field(15.0, description="turns per minute, right-handed about the axis")
    phase_deg: float = Field(
        0.0,
        description="angle about the axis at the epoch; at 0 the next body axis (x, y, z, x) is nearest"
        " to the Sun",
    )
    sun_angle_deg: float = Field(
        90.0, gt=0, lt=180, description="angle between the spin axis and the Sun at the epoch"
    )


class NedLaw(Options):
    """The thesis' axes (equations 2.1 to 2.4): body +x north, +y east, +z down.

    Down is towards the Earth or the Sun; north and east refer to the GCRF equator. The thesis takes
    east from the spacecraft's longitude even where down is the Sun's direction, which gives no rotation
    matrix; here east is perpendicular to down.
    """

    law: Literal["ned"] = "ned"
    down: Literal["earth", "sun"] = Field("earth", description="where body +z points")


class TrackingLaw(Options):
    """A body axis points at the chaser; the next one (x, y, z, x) nearly along the orbit's normal."""

    law: Literal["tracking"] = "tracking"
    body_axis: BodyAxis = Field("+z", description="the axis that points at the chaser")


class TumblingLaw(Options):
    """Torque-free motion of a rigid body from an attitude and an angular rate at the epoch."""

    law: Literal["tumbling"] = "tumbling"
    moments_kg_m2: Vector3 = Field(description="Ixx, Iyy, Izz in body axes; only their ratios matter")
    products_kg_m2: Vector3 = Field(
        (0.0, 0.0, 0.0), description="Ixy, Ixz, Iyz as they stand in the matrix of inertia"
    )
    rate_body_deg_s: Vector3 = Field(
        description="angular rate at the epoch in body axes, degrees per second"
    )
    q_eci_from_body: Quaternion = Field(
        (1.0, 0.0, 0.0, 0.0),
        description="attitude at the epoch: rotation from body to GCRF axes, scalar first",
    )

    @model_validator(mode="after")
    def _moments_are_possible(self) -> TumblingLaw:
        low, middle, high = np.linalg.eigvalsh(self.inertia_kg_m2)
        # The tolerance allows for rounding: a flat plate's largest moment is the sum of the others.
        if low <= 0 or high > (low + middle) * (1 + 1e-12):
            raise ValueError(
                f"no body has the principal moments {low:.6g}, {middle:.6g}, {high:.6g}: each is"
                " positive, and none larger than the sum of the others"
            )
        return self

    @property
    def inertia_kg_m2(self) -> FloatArray:
        """(3, 3) matrix of inertia, body axes."""
        (xx, yy, zz), (xy, xz, yz) = self.moments_kg_m2, self.products_kg_m2
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class FileLaw(Options):
    """Recorded attitudes, interpolated at a constant rate from one to the next."""

    law: Literal["file"] = "file"
    path: Path = Field(
        description="a CCSDS AEM in keyword notation, or .npz or .csv with t_s and q_eci_from_body"
        " (target) or q_eci_from_camera (camera), as 'posse propagate' writes"
    )


TargetLaw = Annotated[
    NadirLaw | SunPointingLaw | InertialLaw | SpinLaw | NedLaw | TrackingLaw | TumblingLaw | FileLaw,
    Field(discriminator="law"),
]


class TrackLaw(Options):
    """The camera points at the target's origin, with a random offset.

    Without the offset, the image's top is as near as possible to the orbit's normal. Of the rotation
    that leads there from the attitude at rest (right R, up T, looking along −N), a share is taken back.
    The share is drawn for each frame between 0 and ``offset``, as Blender's track-to constraint does at
    an influence between 1 − ``offset`` and 1.
    """

    law: Literal["track"] = "track"
    offset: float = Field(
        0.02,
        ge=0,
        le=1,
        description="largest share of the rotation towards the target that is taken back",
    )


class PointingErrorLaw(Options):
    """The camera points at the target's origin but for a fixed misalignment and jitter.

    Both rotate the camera about its own axes: x right, y down, z forward.
    """

    law: Literal["pointing-error"] = "pointing-error"
    bias_deg: Vector3 = Field((0.0, 0.0, 0.0), description="misalignment: rotations about x, y, z")
    jitter_deg: Vector3 = Field(
        (0.0, 0.0, 0.0),
        description="standard deviation of the rotations about x, y, z that are drawn for each frame",
    )


CameraLaw = Annotated[TrackLaw | PointingErrorLaw | FileLaw, Field(discriminator="law")]


class AttitudeConfig(Options):
    """The attitude laws of target and camera."""

    target: TargetLaw = Field(NadirLaw(), description="attitude law of the target")
    camera: CameraLaw = Field(TrackLaw(), description="attitude law of the camera")
