"""The core's models of motion: propagators, attitude laws and joint laws."""

from __future__ import annotations

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec


@hookimpl
def posse_propagators() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "file",
            "a trajectory from a file: NPZ, CSV or CCSDS OEM, with its own frames",
            "posse_core._propagators.file:FilePropagator",
            options="posse_core._propagators.options:FileOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "hcw",
            "Hill-Clohessy-Wiltshire: circular target, small separation",
            "posse_core._propagators.linear:HcwPropagator",
        ),
        ComponentSpec(
            "j2-roe",
            "relative orbital elements under J2 in closed form (Koenig-Guffanti-D'Amico)",
            "posse_core._propagators.j2_roe:J2RoePropagator",
            options="posse_core._propagators.options:J2RoeOptions",
        ),
        ComponentSpec(
            "nonlinear",
            "numerical integration: two-body or J2, drag, solar pressure, Sun and Moon; the reference",
            "posse_core._propagators.nonlinear:NonlinearPropagator",
            options="posse_core._propagators.options:NonlinearOptions",
        ),
        ComponentSpec(
            "roe",
            "exact two-body relative motion from relative orbital elements (the default)",
            "posse_core._propagators.roe:RoePropagator",
            capabilities=frozenset({"exact-two-body"}),
        ),
        ComponentSpec(
            "roe-near-circular",
            "relative orbital elements mapped by T(u): near-circular target",
            "posse_core._propagators.linear:NearCircularPropagator",
        ),
        ComponentSpec(
            "sgp4",
            "target and chaser by SGP4 from a TLE",
            "posse_core._propagators.sgp4:Sgp4Propagator",
        ),
        ComponentSpec(
            "thesis",
            "the thesis' propagation, literally: N instants x H relative orbits",
            "posse_core._propagators.thesis:ThesisPropagator",
            options="posse_core._propagators.options:ThesisOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "yamanaka-ankersen",
            "Yamanaka-Ankersen: any eccentricity, small separation",
            "posse_core._propagators.linear:YamanakaAnkersenPropagator",
        ),
    ]


_TARGET, _CAMERA = frozenset({"target"}), frozenset({"camera"})


@hookimpl
def posse_attitude_laws() -> list[ComponentSpec]:
    package = "posse_core._attitude"
    return [
        ComponentSpec(
            "file",
            "recorded attitudes: CCSDS AEM, NPZ or CSV",
            f"{package}.recorded:FileLaw",
            f"{package}.options:FileOptions",
            capabilities=_TARGET | _CAMERA,
        ),
        ComponentSpec(
            "inertial",
            "fixed in inertial axes",
            f"{package}.target:InertialLaw",
            f"{package}.options:InertialOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "nadir",
            "LVLH axes: body +z towards the Earth, +x along V-bar (the target's default)",
            f"{package}.target:NadirLaw",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "ned",
            "the thesis' north, east, down of the Earth or the Sun",
            f"{package}.target:NedLaw",
            f"{package}.options:NedOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "pointing-error",
            "at the target, but for a fixed misalignment and a jitter of each frame",
            f"{package}.camera:PointingErrorLaw",
            f"{package}.options:PointingErrorOptions",
            capabilities=_CAMERA,
        ),
        ComponentSpec(
            "random",
            "another attitude in each frame, all equally likely",
            f"{package}.target:RandomLaw",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "random-pointing",
            "near the target or away from it in a random direction, with any roll, in each frame",
            f"{package}.camera:RandomPointingLaw",
            f"{package}.options:RandomPointingOptions",
            capabilities=_CAMERA,
        ),
        ComponentSpec(
            "spin",
            "a steady spin about an axis at an angle from the Sun",
            f"{package}.target:SpinLaw",
            f"{package}.options:SpinOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "sun-pointing",
            "a body axis at the Sun, the next one towards ecliptic north",
            f"{package}.target:SunPointingLaw",
            f"{package}.options:SunPointingOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "track",
            "at the target, with the orbit's normal upward in the image (the camera's default)",
            f"{package}.camera:TrackLaw",
            f"{package}.options:TrackOptions",
            capabilities=_CAMERA,
        ),
        ComponentSpec(
            "tracking",
            "a body axis at the chaser, the next one near the orbit's normal",
            f"{package}.target:TrackingLaw",
            f"{package}.options:TrackingOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "tumbling",
            "torque-free motion of a rigid body",
            f"{package}.target:TumblingLaw",
            f"{package}.options:TumblingOptions",
            capabilities=_TARGET,
        ),
    ]


@hookimpl
def posse_joint_laws() -> list[ComponentSpec]:
    package = "posse_core._joints"
    return [
        ComponentSpec(
            "animation",
            "the joint's motion in an animation of the spacecraft's file",
            f"{package}.laws:AnimationLaw",
            f"{package}.options:AnimationOptions",
        ),
        ComponentSpec(
            "bending",
            "hinges of a wing that vibrates in its first bending mode",
            f"{package}.bending:BendingLaw",
            f"{package}.options:BendingOptions",
        ),
        ComponentSpec(
            "fixed",
            "the same value always",
            f"{package}.laws:FixedLaw",
            f"{package}.options:FixedOptions",
        ),
        ComponentSpec(
            "random",
            "a value drawn from a range, for each frame or for the run",
            f"{package}.laws:RandomLaw",
            f"{package}.options:RandomOptions",
        ),
        ComponentSpec(
            "rate",
            "a steady rate from a value at the epoch",
            f"{package}.laws:RateLaw",
            f"{package}.options:RateOptions",
        ),
        ComponentSpec(
            "sun-tracking",
            "turns what faces the Sun, such as a wing's cells, as near to it as axis and limits allow",
            f"{package}.laws:SunTrackingLaw",
        ),
        ComponentSpec(
            "table",
            "values over time from a CSV or NPZ file",
            f"{package}.laws:TableLaw",
            f"{package}.options:TableOptions",
        ),
    ]
