"""Scenario keys of the attitude: how the target is oriented, and where the camera looks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from posse_core._arrays import FloatArray
from posse_core._plugins.options import Options
from posse_core._scenario.orbit import Vector3


def _with_a_direction(q: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not any(q):
        raise ValueError("a zero quaternion is no rotation; none at all is [1, 0, 0, 0]")
    return q


Quaternion = Annotated[
    tuple[float, float, float, float],
    Field(description="w, x, y, z; any length but 0"),
    AfterValidator(_with_a_direction),
]
BodyAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


class NadirLaw(Options):
    """LVLH: body +z towards the Earth's centre, +y against the orbit's normal, +x along V-bar."""

    law: Literal["nadir"] = "nadir"


class SunPointingLaw(Options):
    """A body axis at the Sun; the next one (x, y, z, x) as near as can be to ecliptic north."""

    law: Literal["sun-pointing"] = "sun-pointing"
    body_axis: BodyAxis = Field("+z", description="the axis that points at the Sun")


class InertialLaw(Options):
    """Fixed among the stars."""

    law: Literal["inertial"] = "inertial"
    q_eci_from_body: Quaternion = Field(
        (1.0, 0.0, 0.0, 0.0), description="GCRF axes from body axes, scalar first"
    )


class SpinLaw(Options):
    """A steady spin about an axis that is fixed among the stars.

    At the epoch the axis stands at ``sun_angle_deg`` from the Sun, on the side of ecliptic north, so
    that at 90° it is the ecliptic's north pole and keeps its angle the year round.
    """

    law: Literal["spin"] = "spin"
    body_axis: BodyAxis = Field("+z", description="the spin axis")
    rate_rpm: float = Field(15.0, description="turns a minute, right-handed about the axis")
    phase_deg: float = Field(
        0.0,
        description="turn at the epoch; at 0 the next body axis (x, y, z, x) is nearest to the Sun",
    )
    sun_angle_deg: float = Field(
        90.0, gt=0, lt=180, description="angle between the spin axis and the Sun at the epoch"
    )


class NedLaw(Options):
    """The thesis' axes (equations 2.1 to 2.4): body +x north, +y east, +z down.

    Down is towards the Earth or the Sun; north and east are of the GCRF equator. The thesis takes
    east from the spacecraft's longitude even where down is the Sun's direction, which is no rotation
    matrix; here east is square to down.
    """

    law: Literal["ned"] = "ned"
    down: Literal["earth", "sun"] = Field("earth", description="where body +z points")


class TrackingLaw(Options):
    """A body axis at the chaser; the next one (x, y, z, x) as near as can be to the orbit's normal."""

    law: Literal["tracking"] = "tracking"
    body_axis: BodyAxis = Field("+z", description="the axis that points at the chaser")


class TumblingLaw(Options):
    """Free of torque: a rigid body's motion from an attitude and a rate at the epoch."""

    law: Literal["tumbling"] = "tumbling"
    moments_kg_m2: Vector3 = Field(description="Ixx, Iyy, Izz in body axes; any common unit will do")
    products_kg_m2: Vector3 = Field(
        (0.0, 0.0, 0.0), description="Ixy, Ixz, Iyz as they stand in the matrix of inertia"
    )
    rate_body_deg_s: Vector3 = Field(description="angular rate at the epoch, body axes, degrees/s")
    q_eci_from_body: Quaternion = Field(
        (1.0, 0.0, 0.0, 0.0), description="attitude at the epoch, scalar first"
    )

    @model_validator(mode="after")
    def _a_body_can_have_it(self) -> TumblingLaw:
        low, middle, high = np.linalg.eigvalsh(self.inertia_kg_m2)
        # The rounding of a flat plate, whose largest moment is the sum of the others.
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
    """Recorded attitudes, turned evenly from one to the next."""

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
    """The camera's axis at the target's origin, pulled off it at random.

    Untouched, the image's top is as near as can be to the orbit's normal. Of the turn that led there
    from the axes of rest (right R, up T, looking along −N), a share drawn for each frame between 0
    and ``offset`` is taken back, as Blender's track-to constraint does at an influence between
    1 − ``offset`` and 1.
    """

    law: Literal["track"] = "track"
    offset: float = Field(0.02, ge=0, le=1, description="largest share of the turn to take back")


class PointingErrorLaw(Options):
    """The camera's axis at the target's origin but for a fixed misalignment and jitter.

    Both turn the camera about its own axes: x right, y down, z forward.
    """

    law: Literal["pointing-error"] = "pointing-error"
    bias_deg: Vector3 = Field((0.0, 0.0, 0.0), description="misalignment: turns about x, y, z")
    jitter_deg: Vector3 = Field(
        (0.0, 0.0, 0.0),
        description="standard deviation of turns about x, y, z, drawn anew for each frame",
    )


CameraLaw = Annotated[TrackLaw | PointingErrorLaw | FileLaw, Field(discriminator="law")]


class AttitudeConfig(Options):
    """Attitude laws by name."""

    target: TargetLaw = Field(NadirLaw(), description="attitude of the target")
    camera: CameraLaw = Field(TrackLaw(), description="attitude of the camera")
