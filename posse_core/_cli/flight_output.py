"""Output that ``posse fly`` and ``posse track`` share."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

if TYPE_CHECKING:
    from posse_core._flight.watch import Step


def bar(steps: Iterable[Step], frames: int) -> Iterable[Step]:
    """Show progress, range and error of the estimate."""
    with tqdm(total=frames, unit="frame", disable=None, smoothing=0.1) as progress:
        for step in steps:
            range_m = float(np.linalg.norm(step.row.r_chaser_rtn_m))
            error = "no estimate"
            if step.estimate is not None:
                off_m = float(np.linalg.norm(step.row.r_chaser_rtn_m[0] - step.estimate.r_rtn_m))
                error = f"error {off_m:.2f} m"
            progress.set_postfix_str(f"range {range_m:.1f} m, {error}", refresh=False)
            progress.update()
            yield step


def shown(value: Any) -> str:
    """A figure as text: three digits, yes or no, or a dash where there is none."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if math.isfinite(value) else "–"


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
