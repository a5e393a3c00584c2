"""Checks of what a propagator returns, so that messages name the propagator at fault."""

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
    """Run a propagator and check its motion; see :func:`checked_motion`."""
    with failures_named("propagator", name):
        made = propagator.propagate(problem)
    return checked_motion(made, problem.t_s, name, own_frames=own_frames)


def checked_motion(made: object, t_s: FloatArray, name: str, *, own_frames: bool) -> Motion:
    """Check that a propagator returned a motion of finite numbers with one row per frame.

    Args:
        made: what it returned.
        t_s: (T,) the requested times. The motion has them once, or once for each relative orbit.
        name: of the propagator.
        own_frames: whether the motion may have other times than ``t_s``.

    Raises:
        ComponentError: The check failed; the message names the propagator.
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
            f"{who}: t_s differs from the requested times, which only the capability 'own-frames' allows"
        )
    return made
