"""The check of what a propagator returns, so that a fault is named where it was made."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from posse_core._arrays import FloatArray, array_fault
from posse_core._errors import ComponentError
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion
from posse_core._plugins.component import failures_named


def propagated(
    propagator: Propagator, problem: PropagationProblem, name: str, *, own_frames: bool
) -> Motion:
    """The motion by a propagator, checked; see :func:`checked_motion`."""
    with failures_named("propagator", name):
        made = propagator.propagate(problem)
    return checked_motion(made, problem.t_s, name, own_frames=own_frames)


def checked_motion(made: object, t_s: FloatArray, name: str, *, own_frames: bool) -> Motion:
    """What a propagator returned: finite numbers, one row for each frame.

    Args:
        t_s: (T,) the times that it was asked for: once, or again for each of several relative orbits.
        name: of the propagator.
        own_frames: it may have other frames than ``t_s``.

    Raises:
        ComponentError: one line that names the propagator and what is wrong.
    """
    who = f"propagator {name!r}"
    if not isinstance(made, Motion):
        found = "None" if made is None else f"a value of type {type(made).__name__}"
        raise ComponentError(f"{who} returned {found}, and must return Motion")
    frames = len(t_s)
    if isinstance(made.t_s, np.ndarray) and (own_frames or made.t_s.size % frames == 0):
        frames = made.t_s.size
    wanted: tuple[tuple[str, tuple[int, ...], str], ...] = (
        ("t_s", (frames,), "floating"),
        ("r_target_eci_m", (frames, 3), "floating"),
        ("v_target_eci_m_s", (frames, 3), "floating"),
        ("r_chaser_rtn_m", (frames, 3), "floating"),
        ("v_chaser_rtn_m_s", (frames, 3), "floating"),
        ("sequence", (frames,), "integer"),
    )
    for key, shape, kind in wanted:
        fault = array_fault(getattr(made, key), shape, kind)
        if fault is not None:
            raise ComponentError(f"{who}: {key} {fault}")
    if not isinstance(made.extras, Mapping):
        raise ComponentError(f"{who}: extras must be a mapping of arrays by name")
    if frames == 0:
        raise ComponentError(f"{who} returned no frames")
    if not own_frames and not np.array_equal(made.t_s, np.tile(t_s, frames // len(t_s))):
        raise ComponentError(
            f"{who}: t_s is not what was asked for; only with the capability 'own-frames' may it differ"
        )
    return made
