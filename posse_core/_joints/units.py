"""What users give in degrees for joints that turn and in metres for those that slide."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._model.joints import Joint


def given_for(joint: Joint, **given: object) -> str:
    """The name of the option that fits a joint, of the two that mean the same for joints that turn and
    joints that slide.

    Args:
        joint: that the law moves.
        given: the two options and their values: first that of a joint that turns, in degrees, then that
            of one that slides, in metres.

    Raises:
        InputError: The other one is given.
    """
    turning, sliding = given
    fit, other = (turning, sliding) if joint.kind == "revolute" else (sliding, turning)
    if given[other] is not None:
        does = "turns" if joint.kind == "revolute" else "slides"
        raise InputError(f"{other}: the joint {joint.name} {does}; give {fit} instead")
    return fit


def value_of(joint: Joint, **given: float | None) -> float:
    """The value of the option that fits a joint, see :func:`given_for`, in rad or m; 0 for None."""
    value = given[given_for(joint, **given)]
    return float(in_radians(joint, np.array(0.0 if value is None else value)))


def in_radians(joint: Joint, value: FloatArray) -> FloatArray:
    """Degrees of a joint that turns → rad; metres of one that slides stay."""
    return np.radians(value) if joint.kind == "revolute" else value
