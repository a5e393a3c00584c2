"""Propagator ``nonlinear``: numerical integration of target and relative state with chosen forces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.nonlinear import Body, ForceModel, integrate
from posse_core._dynamics.start import Start
from posse_core._environment.ephemeris import moon_eci_m, sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._frames import R_eci_from_rtn, rtn_spin_rad_s
from posse_core._interfaces.propagator import Flight, FlightPropagator, PropagationProblem
from posse_core._propagators.options import NonlinearOptions


class NonlinearPropagator(FlightPropagator[NonlinearOptions]):
    """The reference propagator, for any orbit, including hyperbolic ones.

    Its forces are two-body or J2 gravity, drag, solar radiation pressure, and the Sun's and Moon's
    attraction.
    """

    elliptic = False

    # A class variable of other models depends on an option of this one.
    @property
    def turns_plane(self) -> bool:  # type: ignore[override]
        return self.options.gravity == "j2"

    def fly(self, problem: PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        epoch = problem.epoch.shifted(start.target.t_s)
        r, v, dr, dv = integrate(
            (start.target.r_eci_m, start.target.v_eci_m_s, start.dr_eci_m, start.dv_eci_m_s),
            after_s,
            self._forces(epoch, after_s),
            problem.constants,
        )
        R = np.swapaxes(R_eci_from_rtn(r, v), -1, -2)
        position = np.einsum("fij,fj->fi", R, dr)
        spin = rtn_spin_rad_s(r, v, start.target.plane_turn_rad_s(r, v))
        velocity = np.einsum("fij,fj->fi", R, dv) - np.cross(spin, position)
        return Flight(r, v, np.concatenate([position, velocity], axis=-1))

    def _forces(self, epoch: Epoch, t_s: FloatArray) -> ForceModel:
        o = self.options
        lit, pulled = o.solar_pressure is not None, o.third_body
        span = (float(np.min(t_s, initial=0.0)) - 1.0, float(np.max(t_s, initial=0.0)) + 1.0)
        return ForceModel(
            gravity=o.gravity,
            drag_m2_kg=o.drag.pair if o.drag else None,
            srp_m2_kg=o.solar_pressure.pair if o.solar_pressure else None,
            third_body=pulled,
            sun=_path(sun_eci_m, epoch, span) if lit or pulled else None,
            moon=_path(moon_eci_m, epoch, span) if pulled else None,
        )


def _path(
    position: Callable[[FloatArray, FloatArray], FloatArray],
    epoch: Epoch,
    span_s: tuple[float, float],
) -> Body:
    """Fit an ephemeris by Chebyshev series within 1 km, with one more term for every two days."""
    start, end = span_s
    degree = 12 + int((end - start) / 86400.0 / 2)
    x = np.polynomial.chebyshev.chebpts1(degree + 1)
    t_s = (start + end) / 2 + (end - start) / 2 * x
    positions_m = position(*epoch.tdb(t_s))
    coefficients = np.polynomial.chebyshev.chebfit(x, positions_m, degree)
    return Body(np.ascontiguousarray(coefficients.T), span_s)
