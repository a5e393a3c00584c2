"""Exact relative two-body motion from relative orbital elements.

ROE rows (dimensionless; times the chief's semi-major axis in metres):
    qns          δa, δλ, δex, δey, δix, δiy   D'Amico (2010), thesis TU Delft, eq. 2.2:
                 (a'−a)/a, u'−u+(Ω'−Ω) cos i, ex'−ex, ey'−ey, i'−i, (Ω'−Ω) sin i
    equinoctial  δa, δl, δex, δey, δp, δq     plain differences of equinoctial elements; for any i

The deputy's elements follow from these without approximation, both orbits are solved by Kepler's
equation, and their difference is taken in the chief's RTN axes, without integration or linearisation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.elements import (
    columns,
    equinoctial_axes,
    equinoctial_from_qns,
    equinoctial_from_state,
    in_plane,
)
from posse_core._dynamics.kepler import CORRECTIONS, corrections_for
from posse_core._dynamics.rows import Rows, dense


def relative_rtn(chief: tuple[Any, ...], deputy: tuple[Any, ...], axes: Any) -> Any:
    """Casadi expression (6): RTN position and velocity (rotating frame) of the deputy.

    Args:
        chief, deputy: from :func:`posse_core._dynamics.elements.in_plane`, each in its own plane.
        axes: (3, 2): the deputy's two in-plane axes in components of the chief's three.
    """
    x, y, vx, vy, r, h = chief
    cos, sin = x / r, y / r
    R_rtn_from_plane = ca.vertcat(ca.horzcat(cos, sin, 0), ca.horzcat(-sin, cos, 0), ca.horzcat(0, 0, 1))
    turn = R_rtn_from_plane @ axes
    position = turn @ ca.vertcat(deputy[0], deputy[1]) - ca.vertcat(r, 0, 0)
    velocity = turn @ ca.vertcat(deputy[2], deputy[3])
    rate = h / r**2
    return ca.vertcat(
        position,
        velocity[0] - (vx * cos + vy * sin) + rate * position[1],
        velocity[1] - h / r - rate * position[0],
        velocity[2],
    )


def _phases(a: Any, longitude: Any, da: Any, dl: Any, mu: Any, t: Any) -> tuple[Any, Any]:
    """Mean longitudes of chief and deputy after t.

    Whole turns are dropped from the common part and the drift is computed from δa itself, so that the
    rounding error after many turns is that of one.
    """
    n = ca.sqrt(mu / a**3)
    chief = longitude + ca.fmod(n * t, 2 * np.pi)
    return chief, chief + dl + n * t * ca.expm1(-1.5 * ca.log1p(da))


def _qns_rtn(corrections: int) -> Any:
    chief, roe = ca.SX.sym("chief_qns", 6), ca.SX.sym("roe", 6)
    mu, t = ca.SX.sym("mu_m3_s2"), ca.SX.sym("t_s")
    a, u, ex, ey, i, _ = ca.vertsplit(chief)
    da, dlambda, dex, dey, dix, diy = ca.vertsplit(roe)
    node = diy / ca.sin(i)
    u_chief, u_deputy = _phases(a, u, da, dlambda - node * ca.cos(i), mu, t)
    ci, si, ci2, si2 = ca.cos(i), ca.sin(i), ca.cos(i + dix), ca.sin(i + dix)
    cn, sn = ca.cos(node), ca.sin(node)
    axes = ca.vertcat(
        ca.horzcat(cn, -ci2 * sn),
        ca.horzcat(ci * sn, ci * ci2 * cn + si * si2),
        ca.horzcat(-si * sn, ci * si2 - si * ci2 * cn),
    )
    rtn = relative_rtn(
        in_plane(a, u_chief, ex, ey, mu, corrections),
        in_plane(a * (1 + da), u_deputy, ex + dex, ey + dey, mu, corrections),
        axes,
    )
    arguments = {"chief_qns": chief, "roe": roe, "mu_m3_s2": mu, "t_s": t}
    return dense("rtn_from_roe", arguments, {"rtn": rtn})


def _equinoctial_rtn(corrections: int) -> Any:
    chief, roe = ca.SX.sym("chief_equinoctial", 6), ca.SX.sym("roe_equinoctial", 6)
    sign, mu, t = ca.SX.sym("sign"), ca.SX.sym("mu_m3_s2"), ca.SX.sym("t_s")
    a, l, ex, ey, p, q = ca.vertsplit(chief)
    da, dl, dex, dey, dp, dq = ca.vertsplit(roe)
    l_chief, l_deputy = _phases(a, l, da, dl, mu, t)
    f, g, w = equinoctial_axes(p, q, sign)
    f2, g2, _ = equinoctial_axes(p + dp, q + dq, sign)
    axes = ca.horzcat(f, g, w).T @ ca.horzcat(f2, g2)
    rtn = relative_rtn(
        in_plane(a, l_chief, ex, ey, mu, corrections),
        in_plane(a * (1 + da), l_deputy, ex + dex, ey + dey, mu, corrections),
        axes,
    )
    arguments = {"chief_equinoctial": chief, "sign": sign, "roe_equinoctial": roe}
    return dense("rtn_from_equinoctial_roe", {**arguments, "mu_m3_s2": mu, "t_s": t}, {"rtn": rtn})


RTN_FROM_ROE = Rows(partial(_qns_rtn, CORRECTIONS))
"""casadi Function (chief qns (6) at t = 0, qns ROE (6), μ, t) → RTN state (6). Not at i = 0, 180°."""
RTN_FROM_EQUINOCTIAL_ROE = Rows(partial(_equinoctial_rtn, CORRECTIONS))
"""casadi Function (chief equinoctial (6) at t = 0, I, equinoctial ROE (6), μ, t) → RTN state (6)."""


@cache
def _rows(build: Callable[[int], Any], corrections: int) -> Rows:
    """The Function with a given number of corrections of Kepler's equation, ready for many rows."""
    return Rows(partial(build, corrections))


def _needed(chief: FloatArray, roe: FloatArray) -> int:
    pairs = (chief[..., 2:4], chief[..., 2:4] + roe[..., 2:4])
    return corrections_for(max(float(np.max(np.hypot(p[..., 0], p[..., 1]))) for p in pairs))


def rtn_from_roe(
    chief_qns: FloatArray, roe: FloatArray, mu_m3_s2: float, t_s: FloatArray | float
) -> FloatArray:
    """RTN position (m) and velocity (m/s, rotating frame) t_s seconds after the elements' time.

    Args:
        chief_qns: (..., 6) quasi-nonsingular elements, e < 1, 0 < i < π.
        roe: (..., 6) dimensionless.
        t_s: (...,).

    Returns:
        (..., 6), leading axes broadcast.
    """
    rows = _rows(_qns_rtn, _needed(chief_qns, roe))
    return np.asarray(rows(chief_qns, roe, mu_m3_s2, t_s))


def rtn_from_equinoctial_roe(
    chief: FloatArray,
    sign: FloatArray | float,
    roe: FloatArray,
    mu_m3_s2: float,
    t_s: FloatArray | float,
) -> FloatArray:
    """As :func:`rtn_from_roe` with equinoctial elements and ROE, for any inclination."""
    rows = _rows(_equinoctial_rtn, _needed(chief, roe))
    return np.asarray(rows(chief, sign, roe, mu_m3_s2, t_s))


def stream_rtn(
    chief: FloatArray,
    sign: FloatArray | float,
    roe: FloatArray,
    mu_m3_s2: float,
    t_s: FloatArray | float,
) -> Iterator[FloatArray]:
    """Yield :func:`rtn_from_equinoctial_roe` in blocks (rows, 6), with memory for one block only.

    The next block overwrites the array of a block.
    """
    rows = _rows(_equinoctial_rtn, _needed(chief, roe))
    for (block,) in rows.stream(chief, sign, roe, mu_m3_s2, t_s):
        yield block


def qns_from_roe(chief_qns: FloatArray, roe: FloatArray) -> FloatArray:
    """The deputy's elements: (..., 6) chief's, (..., 6) dimensionless ROE → (..., 6)."""
    a, u, ex, ey, i, raan = columns(chief_qns)
    da, dlambda, dex, dey, dix, diy = columns(roe)
    node = diy / np.sin(i)
    return np.stack(
        [
            a * (1 + da),
            u + dlambda - node * np.cos(i),
            ex + dex,
            ey + dey,
            i + dix,
            raan + node,
        ],
        axis=-1,
    )


def roe_from_qns(chief_qns: FloatArray, deputy_qns: FloatArray) -> FloatArray:
    """Dimensionless quasi-nonsingular ROE of two orbits: (..., 6), (..., 6) → (..., 6)."""
    a, _, _, _, i, _ = columns(chief_qns)
    da, du, dex, dey, di, dnode = columns(deputy_qns - chief_qns)
    dnode, du = _half_turn(dnode), _half_turn(du)
    dlambda = _half_turn(du + dnode * np.cos(i))
    return np.stack([da / a, dlambda, dex, dey, di, dnode * np.sin(i)], axis=-1)


def equinoctial_roe_from_roe(
    chief_qns: FloatArray, roe: FloatArray, sign: FloatArray | float
) -> FloatArray:
    """Quasi-nonsingular ROE → equinoctial ROE of the same two orbits; (..., 6), dimensionless."""
    chief = equinoctial_from_qns(chief_qns, sign)
    deputy = equinoctial_from_qns(qns_from_roe(chief_qns, roe), sign)
    difference = deputy - chief
    difference[..., 0] = roe[..., 0]
    return difference


def equinoctial_roe_from_states(
    r_m: FloatArray,
    v_m_s: FloatArray,
    dr_m: FloatArray,
    dv_m_s: FloatArray,
    sign: FloatArray | float,
    mu_m3_s2: float,
) -> FloatArray:
    """Equinoctial ROE (..., 6) of a chief and a deputy, which is given by its difference from the chief.

    All arguments are (..., 3) in inertial axes. δa is computed from the difference itself and not from
    two semi-major axes, since the drift of ten orbits multiplies an error of δa by 94.
    """
    chief = equinoctial_from_state(r_m, v_m_s, sign, mu_m3_s2)
    deputy = equinoctial_from_state(r_m + dr_m, v_m_s + dv_m_s, sign, mu_m3_s2)
    difference = np.asarray(deputy - chief)
    r, r_deputy = np.linalg.norm(r_m, axis=-1), np.linalg.norm(r_m + dr_m, axis=-1)
    grown = np.sum((2 * r_m + dr_m) * dr_m, axis=-1)
    kinetic = np.sum((2 * v_m_s + dv_m_s) * dv_m_s, axis=-1) / 2
    energy = kinetic + mu_m3_s2 * grown / (r * r_deputy * (r + r_deputy))
    x = 2 * chief[..., 0] * energy / mu_m3_s2
    difference[..., 0] = x / (1 - x)
    difference[..., 1] = _half_turn(difference[..., 1])
    return difference


def _half_turn(angle_rad: FloatArray) -> FloatArray:
    """The same angle in [−π, π]."""
    return np.asarray(angle_rad - 2 * np.pi * np.round(angle_rad / (2 * np.pi)))
