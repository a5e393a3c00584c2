"""The core's navigators and controllers."""

from __future__ import annotations

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec


@hookimpl
def posse_navigators() -> list[ComponentSpec]:
    package = "posse_core._navigation"
    return [
        ComponentSpec(
            "dead-reckoning",
            "the planned motion and the commanded impulses, without any reading",
            f"{package}.coasting:DeadReckoningNavigator",
            f"{package}.options:DynamicsOptions",
        ),
        ComponentSpec(
            "ekf",
            "extended Kalman filter on keypoints or poses: relative motion, attitude, rate",
            f"{package}.kalman:EkfNavigator",
            f"{package}.options:KalmanOptions",
        ),
        ComponentSpec(
            "truth",
            "the true state, to compare with",
            f"{package}.coasting:TruthNavigator",
            f"{package}.options:DynamicsOptions",
            capabilities=frozenset({"truth"}),
        ),
        ComponentSpec(
            "ukf",
            "unscented Kalman filter on keypoints or poses: relative motion, attitude, rate",
            f"{package}.kalman:UkfNavigator",
            f"{package}.options:KalmanOptions",
        ),
    ]


@hookimpl
def posse_controllers() -> list[ComponentSpec]:
    package = "posse_core._guidance"
    return [
        ComponentSpec(
            "hold",
            "keeps the chaser where it is, or at a waypoint, by a deadband",
            f"{package}.hold:HoldController",
            f"{package}.options:HoldOptions",
            capabilities=frozenset({"no-waypoints"}),
        ),
        ComponentSpec(
            "impulsive-mpc",
            "least impulses to reach and hold waypoints, replanned at each instant (the default)",
            f"{package}.impulsive_mpc:ImpulsiveMpc",
            f"{package}.options:MpcOptions",
        ),
        ComponentSpec(
            "lqr",
            "linear-quadratic regulator on the exact linear motion, without safety rules",
            f"{package}.lqr:LqrController",
            f"{package}.options:LqrOptions",
        ),
        ComponentSpec(
            "plan",
            "carries out impulses that were planned beforehand",
            f"{package}.plan:PlanController",
            capabilities=frozenset({"no-waypoints"}),
        ),
    ]
