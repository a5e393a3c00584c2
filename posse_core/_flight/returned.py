"""Checks of what navigators and controllers return, so that messages name the component at fault."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, array_fault
from posse_core._errors import ComponentError
from posse_core._interfaces.controller import Controller
from posse_core._interfaces.navigator import Estimate, Innovation, Navigator, Readings
from posse_core._plugins.component import failures_named

_ASYMMETRY = 1e-9
_NORM_ERROR = 1e-6


def estimated(navigator: Navigator, name: str, t_s: float) -> Estimate | None:
    """Ask a navigator for its estimate and check it.

    Raises:
        ComponentError: it failed, or did not return an :class:`Estimate` of finite numbers at ``t_s``.
    """
    with failures_named("navigator", name):
        made = navigator.estimate(t_s)
    if made is None:
        return None
    fault = _fault(made, t_s)
    if fault is not None:
        raise ComponentError(f"navigator {name!r}: {fault}")
    return made


def updated(navigator: Navigator, name: str, readings: Readings) -> Innovation | None:
    """Give a navigator readings and check the innovation that it returns; see :func:`estimated`."""
    with failures_named("navigator", name):
        made = navigator.update(readings)
    if made is None:
        return None
    if not isinstance(made, Innovation):
        raise ComponentError(
            f"navigator {name!r}: update returned {type(made).__name__}, and must return Innovation or"
            " None"
        )
    if not np.isfinite(made.nis) or made.nis < 0 or not 0 <= made.rejected <= made.dof:
        raise ComponentError(f"navigator {name!r}: update returned {made}, which is not possible")
    return made


def commanded(controller: Controller, name: str, estimate: Estimate) -> FloatArray:
    """Ask a controller for an impulse (3,) m/s and check it; see :func:`estimated`."""
    with failures_named("controller", name):
        made = controller.command(estimate)
    fault = array_fault(made, (3,), "floating")
    if fault is not None:
        raise ComponentError(f"controller {name!r}: the impulse {fault}")
    return made


def _fault(made: object, t_s: float) -> str | None:
    if not isinstance(made, Estimate):
        return f"estimate returned {type(made).__name__}, and must return Estimate or None"
    if made.t_s != t_s:
        return f"estimate was asked for {t_s:g} s and returned the one of {made.t_s:g} s"
    size = 6 if made.q_eci_from_body is None else 12
    wanted: list[tuple[str, tuple[int, ...]]] = [
        ("r_rtn_m", (3,)),
        ("v_rtn_m_s", (3,)),
        ("covariance", (size, size)),
    ]
    if made.q_eci_from_body is not None:
        wanted += [("q_eci_from_body", (4,)), ("omega_body_rad_s", (3,))]
    for key, shape in wanted:
        fault = array_fault(getattr(made, key), shape, "floating")
        if fault is not None:
            return f"{key} {fault}"
    scale = np.sqrt(np.abs(np.diag(made.covariance)))
    if np.any(np.abs(made.covariance - made.covariance.T) > _ASYMMETRY * np.outer(scale, scale)):
        return "covariance is not symmetric"
    if np.any(np.diag(made.covariance) < 0):
        return "covariance has a negative variance"
    q = made.q_eci_from_body
    if q is not None and abs(np.linalg.norm(q) - 1) > _NORM_ERROR:
        return "q_eci_from_body is not of length one"
    return None
