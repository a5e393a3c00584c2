"""Checks of the joints of a spacecraft that a scene source built."""

from __future__ import annotations

import re
from typing import get_args

import numpy as np

from posse_core._arrays import array_fault
from posse_core._errors import ComponentError
from posse_core._model.joint_curve import JointCurve
from posse_core._model.joints import Joint, JointKind
from posse_core._model.spacecraft import Spacecraft

_LARGEST_NORM_ERROR = 1e-9
"""How far a unit vector's length may be from one."""
_NAME = re.compile(r"\w[\w.-]*")


def check_joints(craft: Spacecraft, who: str) -> None:
    """Check that what a spacecraft hangs on joints is sound.

    Names are there and unique, axes are unit vectors, limits are in order, and each joint comes after
    the one that carries it.

    Args:
        craft: otherwise checked.
        who: the scene source, for messages.

    Raises:
        ComponentError: The check failed.
    """
    known: set[str | None] = {None}
    for joint in craft.joints:
        if not isinstance(joint, Joint):
            raise ComponentError(f"{who}: a joint is {type(joint).__name__}, and must be Joint")
        where = f"{who}: the joint {joint.name!r}"
        if not isinstance(joint.name, str) or not _NAME.fullmatch(joint.name):
            raise ComponentError(f"{where} needs a name of letters, digits, _, -")
        if joint.name in known:
            raise ComponentError(f"{where}: two joints have this name")
        if joint.parent not in known:
            raise ComponentError(f"{where}: no joint {joint.parent!r}, its parent, comes before it")
        if joint.kind not in get_args(JointKind):
            raise ComponentError(f"{where}: its kind {joint.kind!r} is none of {get_args(JointKind)}")
        for key in ("origin_body_m", "axis_body", "facing_body"):
            vector = getattr(joint, key)
            fault = array_fault(vector, (3,), "floating")
            if key == "facing_body" and vector is None:
                continue
            if fault is not None:
                raise ComponentError(f"{where}: {key} {fault}")
            if key != "origin_body_m" and abs(np.linalg.norm(vector) - 1) > _LARGEST_NORM_ERROR:
                raise ComponentError(f"{where}: {key} is {vector}, not of length one")
        low, high = joint.limits
        if not low <= high:  # also where one is NaN
            raise ComponentError(f"{where}: its limits {joint.limits} are not in order")
        for animation, curve in joint.animations.items():
            if not isinstance(curve, JointCurve):
                what = type(curve).__name__
                raise ComponentError(
                    f"{where}: the animation {animation!r} is {what}, and must be JointCurve"
                )
        known.add(joint.name)
    for kind, carriers in (
        ("part", {part.name: part.joint for part in craft.parts}),
        ("keypoint", {key: craft.keypoint_joints.get(key) for key in craft.keypoints_body_m}),
    ):
        for key, carrier in carriers.items():
            if carrier not in known:
                raise ComponentError(f"{who}: the {kind} {key!r} is on the joint {carrier!r}, not there")
    strays = ", ".join(craft.keypoint_joints.keys() - craft.keypoints_body_m.keys())
    if strays:
        raise ComponentError(f"{who}: keypoint_joints has {strays}, which are no keypoints")
