"""Resolves a scenario's orbit and relative motion into states, impulses and times."""

from __future__ import annotations

import math
from typing import assert_never

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics import design as designs
from posse_core._dynamics import elements
from posse_core._dynamics.plan import Burn, Transfer, transfer
from posse_core._dynamics.start import Start, Target
from posse_core._dynamics.tle import Tle
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._interfaces.propagator import ForcedMotion, PropagationProblem
from posse_core._scenario.design import (
    Algorithm31,
    Algorithm31Repaired,
    DesignConfig,
    FlyAround,
    HoldPoint,
    PlanConfig,
    RBarApproach,
    SafeEllipse,
    VBarApproach,
    VBarHop,
    ViewSphere,
)
from posse_core._scenario.limits import MOST_FRAMES
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig

_AT_TARGET = np.zeros(3)


def resolve(
    orbit: OrbitConfig,
    relative: RelativeConfig,
    t_s: FloatArray,
    constants: Constants,
    *,
    needs_starts: bool = True,
    turns_plane: bool = False,
) -> PropagationProblem:
    """Return the problem that a scenario gives to a propagator.

    Args:
        orbit: the target's orbit.
        relative: the chaser's relative motion.
        t_s: (F,) seconds after the orbit's epoch.
        constants: of the Earth.
        needs_starts: whether the propagator needs start states; if not, ``relative`` is ignored.
        turns_plane: whether the propagator turns the orbit's plane, and with it the RTN axes.

    Raises:
        InputError: The TLE or date is malformed; a state is not an orbit, has its perigee below the
            Earth's surface, or has no elements where elements are given; a plan is given with a design
            that is not one natural orbit; or the window of a transfer is too short.
    """
    target = target_at_epoch(orbit, constants)
    target.turns_plane = turns_plane
    problem = PropagationProblem(orbit_epoch(orbit), target, (), t_s, tle=orbit.tle)
    if not needs_starts:
        return problem
    starts = starts_of(target, relative)
    if len(t_s) * len(starts) > MOST_FRAMES:
        raise InputError(
            f"times and relative.design: {len(t_s)} times of {len(starts)} relative orbits are over"
            f" {MOST_FRAMES} frames; divide them among several scenarios, and join the datasets by"
            " 'posse collect'"
        )
    burns = () if relative.plan is None else planned(relative.plan, starts[0]).burns
    forced = None if relative.design is None else _forced(relative.design, t_s)
    return PropagationProblem(problem.epoch, target, starts, t_s, burns, forced, orbit.tle)


def orbit_epoch(orbit: OrbitConfig) -> Epoch:
    """Return the epoch of the orbit's elements or state.

    Raises:
        InputError: The TLE or date is malformed.
    """
    if orbit.tle is not None:
        return Tle(orbit.tle).epoch
    given = orbit.elements or orbit.state_eci
    assert given is not None  # the model has exactly one of the three
    return Epoch.from_iso(given.epoch_utc)


def orbit_period_s(orbit: OrbitConfig, constants: Constants) -> float:
    """Return the target's period, from a TLE's mean motion or else from the osculating semi-major axis.

    Raises:
        InputError: The TLE is malformed; or the state is not an orbit, has its perigee below the Earth's
            surface, or is hyperbolic and so has no period.
    """
    if orbit.tle is not None:
        return 2 * math.pi / Tle(orbit.tle).mean.mean_motion_rad_s
    target = target_at_epoch(orbit, constants)
    target.check(elliptic=True)
    r_m, v_m_s = target.r_eci_m, target.v_eci_m_s
    a_m = 1 / (2 / np.linalg.norm(r_m) - v_m_s @ v_m_s / constants.mu_earth_m3_s2)
    return 2 * math.pi * math.sqrt(a_m**3 / constants.mu_earth_m3_s2)


def target_at_epoch(orbit: OrbitConfig, constants: Constants) -> Target:
    """Return the target's osculating state at the epoch, without checking that it is an orbit.

    Raises:
        InputError: The TLE is malformed.
    """
    if orbit.tle is not None:
        r, v = Tle(orbit.tle).state(np.zeros(1))
        return Target(r[0], v[0], constants, where="orbit.tle")
    if orbit.elements is not None:
        k = orbit.elements
        angles_deg = (k.i_deg, k.raan_deg, k.argp_deg, k.mean_anomaly_deg)
        row = np.array([k.a_m, k.e, *np.radians(angles_deg)])
        r_m, v_m_s = elements.state_from_keplerian(row, constants.mu_earth_m3_s2)
        return Target(r_m, v_m_s, constants, where="orbit.elements")
    assert orbit.state_eci is not None  # the model has exactly one of the three
    state = orbit.state_eci
    return Target(np.array(state.r_m), np.array(state.v_m_s), constants, where="orbit.state_eci")


def starts_of(target: Target, relative: RelativeConfig) -> tuple[Start, ...]:
    """Return the chaser's state at the epoch for each relative orbit.

    The chaser of a forced design starts at the target.

    Raises:
        InputError: A state is not an orbit, has its perigee below the Earth's surface, or has no
        elements
            where elements are given; or a plan is given with a design that is not one natural orbit.
    """
    where = "relative." + next(key for key, value in relative if value is not None and key != "plan")
    by_state = relative.state_rtn is not None or relative.state_eci is not None
    target.check(elliptic=not by_state)
    if relative.state_rtn is not None:
        rtn = relative.state_rtn
        return (Start.from_rtn(target, np.array(rtn.r_m), np.array(rtn.v_m_s), where=where),)
    if relative.state_eci is not None:
        eci = relative.state_eci
        return (Start.from_eci(target, np.array(eci.r_m), np.array(eci.v_m_s), where=where),)
    if relative.roe_m is not None:
        return (Start.from_roe(target, np.array(relative.roe_m), where=where),)
    if relative.roe_equinoctial_m is not None:
        roe_m = np.array(relative.roe_equinoctial_m)
        return (Start.from_equinoctial_roe(target, roe_m, where=where),)
    assert relative.design is not None  # the model has exactly one of the keys
    design = relative.design
    if isinstance(design, VBarHop):
        rtn_0 = designs.v_bar_hop(design.start_m, design.end_m, _period_s(target))
        return (Start.from_rtn(target, rtn_0[:3], rtn_0[3:], where=where),)
    rows = _natural_roe_m(design)
    if relative.plan is not None and len(rows) != 1:
        raise InputError(
            f"relative.plan: design {design.name} is not a single natural orbit, so manoeuvres cannot"
            " start from it"
        )
    if not len(rows):
        return (Start.from_rtn(target, _AT_TARGET, _AT_TARGET, where=where),)
    return tuple(Start.from_roe(target, row, where=where) for row in rows)


def planned(plan: PlanConfig, start: Start) -> Transfer:
    """Return the impulses of a plan that begins at a start.

    Raises:
        InputError: The window of a transfer is too short, or the inclination is 0° or 180°.
    """
    if plan.burns is not None:
        burns = [Burn(burn.t_s, np.array(burn.dv_rtn_m_s)) for burn in plan.burns]
        return Transfer(tuple(sorted(burns, key=lambda burn: burn.t_s)), 0.0)
    wanted = plan.transfer
    assert wanted is not None  # the model has exactly one of the two
    if wanted.end_s <= wanted.start_s:
        raise InputError("relative.plan.transfer: end_s is not after start_s")
    to_roe = np.array(wanted.to_roe_m) / start.target.qns[0]
    window_s = (wanted.start_s, wanted.end_s)
    return transfer(start.target.qns, start.roe, to_roe, window_s, start.target.mu_m3_s2)


def _natural_roe_m(design: DesignConfig) -> FloatArray:
    """(H, 6) initial ROE of the relative orbits; H is 0 where the design is not made of ROE."""
    match design:
        case FlyAround():
            return designs.fly_around(design.range_m, math.radians(design.phase_deg))[None]
        case SafeEllipse():
            phase_rad = math.radians(design.phase_deg)
            return designs.safe_ellipse(design.radial_m, design.normal_m, design.along_m, phase_rad)[
                None
            ]
        case Algorithm31():
            start = np.array([0.0, 0.0, *design.delta_e_m, *design.delta_i_m])
            return designs.algorithm_3_1(start, design.relative_orbits)
        case Algorithm31Repaired():
            return designs.algorithm_3_1_repaired(design.size_m, design.relative_orbits)
        case VBarHop() | VBarApproach() | RBarApproach() | HoldPoint() | ViewSphere():
            return np.empty((0, 6))
        case _:
            assert_never(design)


def _forced(design: DesignConfig, t_s: FloatArray) -> ForcedMotion | None:
    """Return the relative motion at (F,) times, or None for a natural design."""
    one_piece = np.zeros(len(t_s), dtype=np.int64)
    match design:
        case HoldPoint():
            return ForcedMotion(designs.hold(np.array(design.r_rtn_m), t_s), one_piece)
        case VBarApproach():
            line = designs.straight_line(1, design.start_m, design.end_m, design.duration_s, t_s)
            return ForcedMotion(line, one_piece)
        case RBarApproach():
            # Positive is below the target, and R is up.
            line = designs.straight_line(0, -design.start_m, -design.end_m, design.duration_s, t_s)
            return ForcedMotion(line, one_piece)
        case ViewSphere():
            logarithmic = design.range_law == "logarithmic"
            sphere = designs.view_sphere(*design.range_m, len(t_s), logarithmic=logarithmic)
            return ForcedMotion(sphere, np.arange(len(t_s)))
        case FlyAround() | SafeEllipse() | VBarHop() | Algorithm31() | Algorithm31Repaired():
            return None
        case _:
            assert_never(design)


def _period_s(target: Target) -> float:
    mu = target.mu_m3_s2
    a_m = float(elements.keplerian_from_state(target.r_eci_m, target.v_eci_m_s, mu)[0])
    return float(2 * np.pi * np.sqrt(a_m**3 / mu))
