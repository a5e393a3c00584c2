"""The domain of a motion model: its error is computed, and a large one is reported as a warning."""

from __future__ import annotations

import warnings

import numpy as np

from posse_core._arrays import FloatArray

WARNING_THRESHOLD = 0.01
"""A model's error is reported where it is larger than this share of the largest separation."""


class DomainWarning(UserWarning):
    """A motion model is used where its error is large; the message states the error."""


def warn_if_far_off(
    name: str, position_rtn_m: FloatArray, better_rtn_m: FloatArray, reason: str, instead: str
) -> None:
    """Warn when the position error of a model is larger than 1 % of the largest separation.

    Args:
        name: the propagator.
        position_rtn_m, better_rtn_m: (F, 3) positions by the model and without its approximation.
        reason: why the model is inaccurate here, such as "e = 0.52".
        instead: the propagator to use instead.
    """
    error_m = float(np.max(np.linalg.norm(position_rtn_m - better_rtn_m, axis=-1), initial=0.0))
    apart_m = float(np.max(np.linalg.norm(better_rtn_m, axis=-1), initial=0.0))
    if error_m > WARNING_THRESHOLD * apart_m:
        warnings.warn(
            f"propagator {name} has position errors of up to {error_m:.3g} m at a separation of up to"
            f" {apart_m:.3g} m ({reason}); use propagator {instead}",
            DomainWarning,
            stacklevel=3,
        )
