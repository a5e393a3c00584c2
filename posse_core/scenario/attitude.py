"""Scenario keys of the attitude: how the target is oriented, and where the camera looks."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from posse_core.options import Options

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
    q_eci_from_body: tuple[float, float, float, float] = Field(
        (1.0, 0.0, 0.0, 0.0),
        description="GCRF axes from body axes, scalar first (w, x, y, z); any length but 0",
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


TargetLaw = Annotated[
    NadirLaw | SunPointingLaw | InertialLaw | SpinLaw | NedLaw, Field(discriminator="law")
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


class AttitudeConfig(Options):
    """Attitude laws by name."""

    target: TargetLaw = Field(NadirLaw(), description="attitude of the target")
    camera: TrackLaw = Field(TrackLaw(), description="attitude of the camera")
