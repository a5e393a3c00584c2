"""Checks of what propagators and attitude laws return, so that messages name the one at fault."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from posse_core._arrays import FloatArray, IntArray, array_fault
from posse_core._errors import ComponentError, InputError
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion
from posse_core._plugins.component import failures_named

_LARGEST_ROTATION_ERROR = 1e-9
"""How far the product of a rotation and its transpose may be from the identity, in any element."""


def propagated(
    propagator: Propagator, problem: PropagationProblem, name: str, *, own_frames: bool
) -> Motion:
    """Run a propagator and check its motion; see :func:`checked_motion`."""
    with failures_named("propagator", name):
        made = propagator.propagate(problem)
    motion = checked_motion(made, problem.t_s, name, own_frames=own_frames)
    if problem.requested and not _is_at_the_times(motion, problem):
        raise InputError(
            f"times: propagator {name!r} has frames of its own and takes no others; leave times out, or"
            " give 'times: null'"
        )
    return motion


def _is_at_the_times(motion: Motion, problem: PropagationProblem) -> bool:
    """Whether every frame of a motion is at a time that the scenario asks for."""
    if problem.recorded_rate_hz is None:
        return bool(np.isin(motion.t_s, problem.t_s).all())
    steps_s = np.diff(motion.t_s)[np.diff(motion.sequence) == 0]
    return bool(np.allclose(steps_s, 1 / problem.recorded_rate_hz, rtol=1e-6, atol=1e-6))


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


class CheckedLaw(AttitudeLaw):
    """An attitude law whose attitudes are checked; see :func:`checked_attitude`."""

    def __init__(self, law: AttitudeLaw, name: str) -> None:
        super().__init__(law.options)
        self._law = law
        self._name = name

    def attitude(self, around: Surroundings) -> FloatArray:
        with failures_named("attitude-law", self._name):
            made = self._law.attitude(around)
        return checked_attitude(made, around.indices, self._name)


def checked_attitude(made: object, indices: IntArray, name: str) -> FloatArray:
    """Check that an attitude law returned a rotation for each frame, and return it.

    Args:
        made: what it returned.
        indices: (F,) of the frames.
        name: of the law.

    Raises:
        ComponentError: The check failed; the message names the law.
    """
    who = f"attitude-law {name!r}"
    fault = array_fault(made, (len(indices), 3, 3), "float64")
    if fault is not None:
        raise ComponentError(f"{who}: the attitude {fault}")
    R: FloatArray = np.asarray(made)
    error = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max(axis=(-2, -1))
    wrong = (error > _LARGEST_ROTATION_ERROR) | (np.linalg.det(R) < 0)
    if np.any(wrong):
        raise ComponentError(
            f"{who}: the attitude at frame {indices[np.argmax(wrong)]} is no rotation; its columns must"
            " be the unit vectors of right-handed axes"
        )
    return R
