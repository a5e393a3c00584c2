"""Options of the built-in attitude laws, separate from their code so that importing them is quick."""

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


class SunPointingOptions(Options):
    """Options of the law ``sun-pointing``."""

    body_axis: BodyAxis = Field("+z", description="the axis that points at the Sun")


class InertialOptions(Options):
    """Options of the law ``inertial``."""

    q_eci_from_body: Quaternion = Field(
        (1.0, 0.0, 0.0, 0.0), description="rotation from body to GCRF axes, scalar first"
    )


class SpinOptions(Options):
    """Options of the law ``spin``."""

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


class NedOptions(Options):
    """Options of the law ``ned``."""

    down: Literal["earth", "sun"] = Field("earth", description="where body +z points")


class TrackingOptions(Options):
    """Options of the law ``tracking``."""

    body_axis: BodyAxis = Field("+z", description="the axis that points at the chaser")


class TumblingOptions(Options):
    """Options of the law ``tumbling``."""

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
    def _moments_are_possible(self) -> TumblingOptions:
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


class FileOptions(Options):
    """Options of the law ``file``."""

    path: Path = Field(
        description="a CCSDS AEM in keyword notation, or .npz or .csv with t_s and q_eci_from_body"
        " (target) or q_eci_from_camera (camera), as 'posse propagate' writes"
    )


class TrackOptions(Options):
    """Options of the law ``track``."""

    offset: float = Field(
        0.0,
        ge=0,
        le=1,
        description="largest share of the rotation towards the target that is taken back, drawn for each"
        " frame from 0 on; the thesis has 0.02, which is up to 3.6 degrees",
    )


class RandomPointingOptions(Options):
    """Options of the law ``random-pointing``."""

    off_axis_deg: tuple[float, float] = Field(
        (0.0, 0.0),
        description="least and largest angle between the boresight and the target; [0, 180] is any"
        " direction, and [90, 180] away from the target",
    )

    @model_validator(mode="after")
    def _in_order(self) -> RandomPointingOptions:
        least, largest = self.off_axis_deg
        if not 0 <= least <= largest <= 180:
            raise ValueError("off_axis_deg is the least and the largest angle, from 0 to 180")
        return self


class PointingErrorOptions(Options):
    """Options of the law ``pointing-error``."""

    bias_deg: Vector3 = Field((0.0, 0.0, 0.0), description="misalignment: rotations about x, y, z")
    jitter_deg: Vector3 = Field(
        (0.0, 0.0, 0.0),
        description="standard deviation of the rotations about x, y, z that are drawn for each frame",
    )
