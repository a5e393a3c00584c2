"""Where a model of the motion holds: how far off it is is computed, and told."""

from __future__ import annotations

import warnings

import numpy as np

from posse_core._arrays import FloatArray

WORTH_TELLING = 0.01
"""Share of the largest separation above which a model's error is told."""


class DomainWarning(UserWarning):
    """A model of the motion is used where its error is large; the message has its size."""


def warn_if_far_off(
    name: str, position_rtn_m: FloatArray, better_rtn_m: FloatArray, reason: str, instead: str
) -> None:
    """Warn when a model's positions are off by more than 1 % of the largest separation.

    Args:
        name: the propagator.
        position_rtn_m, better_rtn_m: (F, 3) by the model, and by one without its approximation.
        reason: what the model leaves out here, as in "e = 0.52".
        instead: the propagator to take.
    """
    error_m = float(np.max(np.linalg.norm(position_rtn_m - better_rtn_m, axis=-1), initial=0.0))
    apart_m = float(np.max(np.linalg.norm(better_rtn_m, axis=-1), initial=0.0))
    if error_m > WORTH_TELLING * apart_m:
        warnings.warn(
            f"propagator {name} is off by up to {error_m:.3g} m at a separation of up to"
            f" {apart_m:.3g} m ({reason}); take propagator {instead}",
            DomainWarning,
            stacklevel=3,
        )
