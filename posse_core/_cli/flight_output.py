"""Output that ``posse fly`` and ``posse track`` share."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from posse_core._cli.progress import bar
from posse_core._evaluation.numbers import number

if TYPE_CHECKING:
    from posse_core._flight.watch import Step


def _told(step: Step) -> str:
    """The range and the error of the estimate."""
    range_m = float(np.linalg.norm(step.row.r_chaser_rtn_m))
    error = "no estimate"
    if step.estimate is not None:
        off_m = float(np.linalg.norm(step.row.r_chaser_rtn_m[0] - step.estimate.r_rtn_m))
        error = f"error {off_m:.2f} m"
    return f"range {range_m:.1f} m, {error}"


MEANINGS = (
    "Error of the estimate: distance of the true position from what the navigator says; of single-frame"
    " poses: from what each image alone says. NEES: squared error of position and velocity in units of"
    " the estimate's covariance; in its 95 % band, error and covariance agree. Time lost: for which the"
    " true position was outside the estimate's ellipsoid of 3 standard deviations."
)
"""What figures of flights and of tracking mean, for the help of both commands."""

flight_bar = partial(bar, first="opening the renderer and the models", tell=_told)
"""Shows the progress of a flight or of tracking."""


def shown(value: Any) -> str:
    """A figure as text: three digits, yes or no, or a dash where there is none."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(value, 3)


def plain(values: dict[str, Any]) -> dict[str, Any]:
    """Values of JSON, nested or not; NaN and infinity are null."""
    return {
        name: plain(value)
        if isinstance(value, dict)
        else None
        if isinstance(value, float) and not math.isfinite(value)
        else value
        for name, value in values.items()
    }
