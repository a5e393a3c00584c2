"""Numerical integration of the chief's state together with the relative state.

The relative state itself is integrated, in inertial axes, with the difference of two attractions written
without cancellation, so its error is relative to the separation and not to the orbit's radius. All
quantities are dimensionless: lengths are divided by the chief's initial radius, separations by a scale
of their own, and times by √(radius³/μ). The closed-form models are tested against this integration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import EARTH_ROTATION_RATE_RAD_S, SPEED_OF_LIGHT_M_S, Constants
from posse_core._dynamics import forces
from posse_core._errors import ComponentError

MU_SUN_M3_S2 = 1.327_124_400_18e20
MU_MOON_M3_S2 = 4.902_800_066e12
"""IAU 2009 / DE421."""


RELATIVE_TOLERANCE = 1e-15
ABSOLUTE_TOLERANCE = 1e-17
"""Tolerances of the dimensionless state, checked against quadruple precision in tests/authorities."""


@dataclass(frozen=True)
class Body:
    """The geocentric path of a distant body as Chebyshev series in time.

    Attributes:
        coefficients_m: (3, K), of x, y, z in inertial axes.
        span_s: (start, end), the times at which the series' argument is −1 and 1.
    """

    coefficients_m: FloatArray
    span_s: tuple[float, float]

    def position(self, t_s: Any) -> Any:
        """Casadi column (3): position in m at t_s, by Clenshaw's recurrence."""
        start, end = self.span_s
        x = (2 * t_s - start - end) / (end - start)
        columns = self.coefficients_m.T
        b1 = b2 = ca.DM.zeros(3)
        for column in columns[:0:-1]:
            b1, b2 = column + 2 * x * b1 - b2, b1
        return columns[0] + x * b1 - b2


@dataclass(frozen=True)
class ForceModel:
    """The forces beside the attraction of the Earth's point mass.

    Attributes:
        gravity: ``two-body`` or ``j2``.
        drag_m2_kg, srp_m2_kg: (target, chaser) C_D A/m and C_R A/m, or None without drag or solar
            radiation pressure.
        third_body: whether the attraction of the Sun and the Moon is included.
        sun, moon: their paths, needed for solar radiation pressure and third bodies.
    """

    gravity: Literal["two-body", "j2"] = "two-body"
    drag_m2_kg: tuple[float, float] | None = None
    srp_m2_kg: tuple[float, float] | None = None
    third_body: bool = False
    sun: Body | None = None
    moon: Body | None = None

    def perturbation(self, r: Any, v: Any, t_s: Any, craft: int, constants: Constants) -> Any:
        """Casadi column (3): all accelerations but the point mass's, m/s²; craft 0 is the target."""
        c = constants
        total = ca.SX.zeros(3)
        if self.gravity == "j2":
            total += forces.oblateness(r, c.mu_earth_m3_s2, c.earth_radius_m, c.j2)
        if self.drag_m2_kg is not None:
            total += forces.drag(
                r, v, c.earth_radius_m, EARTH_ROTATION_RATE_RAD_S, self.drag_m2_kg[craft]
            )
        if self.srp_m2_kg is not None and self.sun is not None:
            total += forces.solar_pressure(
                r,
                self.sun.position(t_s),
                c.solar_constant_w_m2 / SPEED_OF_LIGHT_M_S,
                c.au_m,
                c.earth_radius_m,
                c.sun_radius_m,
                self.srp_m2_kg[craft],
            )
        if self.third_body and self.sun is not None and self.moon is not None:
            total += forces.third_body(r, self.sun.position(t_s), MU_SUN_M3_S2)
            total += forces.third_body(r, self.moon.position(t_s), MU_MOON_M3_S2)
        return total


def equations(model: ForceModel, constants: Constants) -> Any:
    """casadi Function (chief r, v; relative dr, dv; t) → their time derivatives; inertial axes, SI."""
    r, v = ca.SX.sym("r_m", 3), ca.SX.sym("v_m_s", 3)
    dr, dv, t = ca.SX.sym("dr_m", 3), ca.SX.sym("dv_m_s", 3), ca.SX.sym("t_s")
    mu = constants.mu_earth_m3_s2
    chief = model.perturbation(r, v, t, 0, constants)
    deputy = model.perturbation(r + dr, v + dv, t, 1, constants)
    return ca.Function(
        "relative_motion",
        [r, v, dr, dv, t],
        [
            v,
            forces.two_body(r, mu) + chief,
            dv,
            forces.two_body_difference(r, dr, mu) + deputy - chief,
        ],
        ["r_m", "v_m_s", "dr_m", "dv_m_s", "t_s"],
        ["r_rate", "v_rate", "dr_rate", "dv_rate"],
    )


def integrate(
    start: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    t_s: FloatArray,
    model: ForceModel,
    constants: Constants,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Integrate from t = 0 to each of the times, which may be negative and in any order.

    Args:
        start: (3,) each: the target's position (m) and velocity (m/s), and the chaser's position and
            velocity minus the target's; inertial axes.
        t_s: (F,) seconds.
        model: the forces.
        constants: of the Earth and the Sun.

    Returns:
        The same four quantities at the times, (F, 3) each.

    Raises:
        ComponentError: The integrator failed, as on an orbit through the Earth's centre.
    """
    t_s = np.asarray(t_s, dtype=np.float64)
    scale = _Scale(start, constants)
    state = scale.down(np.concatenate(start))
    out = np.empty((len(t_s), 12))
    for direction in (1.0, -1.0):
        chosen = t_s * direction > 0
        if np.any(chosen):
            # The integrator does not accept the same instant twice.
            grid, index = np.unique(np.abs(t_s[chosen]) / scale.time_s, return_inverse=True)
            rates = _dimensionless(model, constants, scale, direction)
            out[chosen] = _solve(rates, state, grid)[index]
    out[t_s == 0] = state
    r, v, dr, dv = np.split(scale.up(out), 4, axis=-1)
    return r, v, dr, dv


class _Scale:
    """Units in which all components of the state are of order one."""

    def __init__(
        self, start: tuple[FloatArray, FloatArray, FloatArray, FloatArray], constants: Constants
    ) -> None:
        r, _, dr, dv = start
        length_m = float(np.linalg.norm(r))
        self.time_s = float(np.sqrt(length_m**3 / constants.mu_earth_m3_s2))
        apart_m = max(float(np.linalg.norm(dr)), float(np.linalg.norm(dv)) * self.time_s) or 1.0
        lengths = np.repeat([length_m, length_m, apart_m, apart_m], 3)
        times = np.repeat([1.0, self.time_s, 1.0, self.time_s], 3)
        self.units = lengths / times

    def down(self, state: FloatArray) -> FloatArray:
        return np.asarray(state / self.units)

    def up(self, state: FloatArray) -> FloatArray:
        return np.asarray(state * self.units)


def _dimensionless(
    model: ForceModel, constants: Constants, scale: _Scale, direction: float
) -> dict[str, Any]:
    x, t = ca.SX.sym("x", 12), ca.SX.sym("t")
    parts = ca.vertsplit(x * scale.units, 3)
    rates = equations(model, constants)(*parts, direction * t * scale.time_s)
    return {"x": x, "t": t, "ode": direction * scale.time_s * ca.vertcat(*rates) / scale.units}


def _solve(rates: dict[str, Any], state: FloatArray, grid: FloatArray) -> FloatArray:
    options: dict[str, Any] = {
        "linear_multistep_method": "adams",
        "nonlinear_solver_iteration": "functional",
        "reltol": RELATIVE_TOLERANCE,
        "abstol": ABSOLUTE_TOLERANCE,
        "max_num_steps": 10_000_000,
    }
    try:
        solver = ca.integrator("chief_and_relative", "cvodes", rates, 0.0, list(grid), options)
        result = np.array(solver(x0=state)["xf"]).T
    except RuntimeError as error:
        raise ComponentError(f"the integration of the motion failed: {str(error)[-200:]!r}") from error
    return result
