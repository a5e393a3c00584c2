"""Makes dynamics.json: relative motion in quadruple precision, and conversions by another library.

python -m venv v && v/bin/pip install heyoka brahe numpy
v/bin/python tests/authorities/regenerate_dynamics.py

The motion is integrated by heyoka's Taylor method with 113-bit numbers (truncation 1e-34) from states
that are exact in double precision; only the final RTN components are rounded.
"""

from __future__ import annotations

import json
import math
from importlib.metadata import version
from pathlib import Path
from typing import Any

import brahe
import heyoka as hy
import numpy as np

MU, RADIUS, J2 = 3.986004418e14, 6378137.0, 1.08262668e-3
AQUA_A_M = 7.0809e6
CLUSTER_A_M = 7.287e7
# name: (a, e, i°, Ω°, ω°, M°), then position and velocity of the chaser along R, T, N of the target
CASES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "circular": ((7.0e6, 0.0, 51.6, 30, 0, 40), (20, -150, 10, 0.01, -0.043, 0.02)),
    "circular, far": ((7.0e6, 0.0, 51.6, 30, 0, 40), (900, -15000, 4000, 0.4, -1.9, 0.7)),
    "polar": ((7.2e6, 1e-3, 90.0, 120, 75, 200), (-40, 60, 80, 0.05, 0.08, -0.03)),
    "safe ellipse": ((7.1e6, 1e-4, 98.2, 334, 52, 318), (-100, 0, 0, 0, 0.2111, 0.1056)),
    "hop": ((6.8e6, 5e-4, 51.6, 10, 20, 0), (0, -200, 0, 0.0, 0.02, 0)),
    "geostationary": ((42164e3, 0.0, 0.0, 0, 0, 100), (-30, 800, 20, 0.001, 0.004, 0.002)),
    "geosynchronous": ((42164e3, 2e-4, 0.05, 80, 10, 100), (-300, 800, 200, 0.01, 0.04, 0.02)),
    "equatorial": ((7.4e6, 0.02, 0.0, 0, 35, 10), (10, 20, 30, 0.01, 0.02, 0.03)),
    "retrograde equatorial": ((7.4e6, 0.02, 180.0, 0, 35, 10), (10, 20, 30, 0.01, -0.02, 0.03)),
    "e 0.52 from perigee": ((1.6e7, 0.52, 133.35, 345.9, 195.5, 0), (50, 30, -60, 0.02, -0.05, 0.03)),
    "e 0.52 from apogee": ((CLUSTER_A_M, 0.52, 133.4, 346, 195, 180), (80, -90, 120, 1e-3, -3e-3, 4e-3)),
    "e 0.9 from perigee": ((7.0e7, 0.9, 63.4, 20, 270, 0), (10, 20, 30, 0.002, -0.005, 0.01)),
    "e 0.9 from apogee": ((7.0e7, 0.9, 28.5, 20, 270, 180), (100, -200, 300, 1e-3, 2e-3, 1e-3)),
}  # fmt: skip


def main() -> None:
    figures = {
        "libraries": {name: version(name) for name in ("heyoka", "brahe")},
        "motion": [motion(name, *case) for name, case in CASES.items()],
        "aqua": aqua(),
        "conversions": [conversion(case[0]) for case in CASES.values() if 0 < case[0][2] < 180],
        "relative_elements": [relative_elements(k) for k in range(4)],
        "mean_elements": [mean_elements(k) for k in range(8)],
    }
    path = Path(__file__).with_name("dynamics.json")
    path.write_text(json.dumps(figures, indent=None).replace("}, {", "},\n{") + "\n")


def motion(name: str, elements: tuple[float, ...], apart: tuple[float, ...]) -> dict[str, Any]:
    chief = state(elements)
    deputy = chief + apart_in_eci(chief, np.array(apart))
    t_s = np.linspace(0, 10 * 2 * math.pi * math.sqrt(elements[0] ** 3 / MU), 12)
    return {
        "name": name,
        "chief": chief.tolist(),
        "deputy": deputy.tolist(),
        "t_s": t_s.tolist(),
        "two-body": rtn(chief, deputy, t_s, 0.0),
        "j2": rtn(chief, deputy, t_s, J2),
    }


def aqua() -> dict[str, Any]:
    """Aqua with a δe = a δi = 100 m along y, 20 times an orbit over ten: the known model errors."""
    n = 14.571168 * 2 * math.pi / 86400
    a = (MU / n**2) ** (1 / 3)
    e, i, raan, argp, M = 8.98e-5, *np.radians([98.23, 334.40, 52.44, 318.10])
    ex, ey = e * math.cos(argp), e * math.sin(argp) + 100 / a
    node = 100 / a / math.sin(i)
    deputy_argp = math.atan2(ey, ex)
    deputy_M = argp + M - node * math.cos(i) - deputy_argp
    chief = state((a, e, *np.degrees([i, raan, argp, M])))
    deputy = state((a, math.hypot(ex, ey), *np.degrees([i, raan + node, deputy_argp, deputy_M])))
    t_s = np.linspace(0, 10 * 2 * math.pi / n, 201)
    return {
        "a_m": a,
        "roe_m": [0, 0, 0, 100, 0, 100],
        "chief": chief.tolist(),
        "deputy": deputy.tolist(),
        "t_s": t_s.tolist(),
        "two-body": rtn(chief, deputy, t_s, 0.0),
        "j2": rtn(chief, deputy, t_s, J2),
    }


def state(elements: tuple[float, ...]) -> Any:
    """Closed form with Kepler's equation by bisection: no library's, no POSSE's."""
    a, e, *degrees = elements
    i, raan, argp, M = np.radians(degrees)
    low, high = M - 1.0, M + 1.0
    for _ in range(200):
        E = (low + high) / 2
        low, high = (E, high) if E - e * math.sin(E) < M else (low, E)
    eta = math.sqrt(1 - e * e)
    r = a * (1 - e * math.cos(E))
    x, y = a * (math.cos(E) - e), a * eta * math.sin(E)
    speed = math.sqrt(MU * a) / r
    vx, vy = -speed * math.sin(E), speed * eta * math.cos(E)
    cO, sO, ci, si, cw, sw = (f(k) for k in (raan, i, argp) for f in (math.cos, math.sin))
    P = np.array([cO * cw - sO * ci * sw, sO * cw + cO * ci * sw, si * sw])
    Q = np.array([-cO * sw - sO * ci * cw, -sO * sw + cO * ci * cw, si * cw])
    return np.concatenate([x * P + y * Q, vx * P + vy * Q])


def apart_in_eci(chief: Any, apart: Any) -> Any:
    r, v = chief[:3], chief[3:]
    R = r / np.linalg.norm(r)
    h = np.cross(r, v)
    N = h / np.linalg.norm(h)
    axes = np.stack([R, np.cross(N, R), N], axis=1)
    spin = np.array([0, 0, np.linalg.norm(h) / (r @ r)])
    return np.concatenate([axes @ apart[:3], axes @ (apart[3:] + np.cross(spin, apart[:3]))])


def _integrator() -> Any:
    x, y, z, vx, vy, vz = hy.make_vars("x", "y", "z", "vx", "vy", "vz")
    mu, oblate = hy.par[0], hy.par[1]
    r2 = x * x + y * y + z * z
    k = 1.5 * oblate / r2
    z2 = 5 * z * z / r2
    rates = [(q, w) for q, w in ((x, vx), (y, vy), (z, vz))] + [
        (w, -mu * q * r2**-1.5 * (1 + k * (s - z2)))
        for w, q, s in ((vx, x, 1.0), (vy, y, 1.0), (vz, z, 3.0))
    ]
    return hy.taylor_adaptive(rates, [QUAD(0)] * 6, fp_type=QUAD, pars=[QUAD(MU), QUAD(0)])


QUAD = hy.real128
INTEGRATOR = _integrator()


def path(start: Any, t_s: Any, j2: float) -> Any:
    INTEGRATOR.time = QUAD(0)
    INTEGRATOR.state[:] = [QUAD(float(q)) for q in start]
    INTEGRATOR.pars[1] = QUAD(j2) * QUAD(RADIUS) ** 2
    return INTEGRATOR.propagate_grid([QUAD(float(t)) for t in t_s])[-1]


def rtn(chief: Any, deputy: Any, t_s: Any, j2: float) -> list[list[float]]:
    out = []
    for a, b in zip(path(chief, t_s, j2), path(deputy, t_s, j2), strict=True):
        r, v, apart = a[:3], a[3:], b[:3] - a[:3]
        R = r / np.sqrt((r * r).sum())
        h = cross(r, v)
        N = h / np.sqrt((h * h).sum())
        out.append([float((apart * axis).sum()) for axis in (R, cross(N, R), N)])
    return out


def cross(a: Any, b: Any) -> Any:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def conversion(elements: tuple[float, ...]) -> dict[str, Any]:
    """a, e, i, Ω, ω, M ↔ state by brahe, whose GM is its own."""
    own = np.array([elements[0], elements[1], *np.radians(elements[2:])])
    return {
        "mu": brahe.GM_EARTH,
        "elements": own.tolist(),
        "state": brahe.state_koe_to_eci(own, brahe.AngleFormat.RADIANS).tolist(),
    }


def relative_elements(k: int) -> dict[str, Any]:
    rng = np.random.default_rng(k)
    chief = np.array([7.2e6, 0.02, *rng.uniform(0.3, 2.5, 4)])
    roe = rng.uniform(-1e-4, 1e-4, 6)
    deputy = brahe.state_roe_to_oe(chief, roe, brahe.AngleFormat.RADIANS)
    states = [brahe.state_koe_to_eci(q, brahe.AngleFormat.RADIANS) for q in (chief, deputy)]
    return {
        "mu": brahe.GM_EARTH,
        "chief": chief.tolist(),
        "roe": roe.tolist(),
        "deputy": deputy.tolist(),
        "rtn": brahe.state_eci_to_rtn(*states).tolist(),
    }


def mean_elements(k: int) -> dict[str, Any]:
    """Brahe has its source's misprint: long-period terms without sin 2ω. So ω = 45°, where it is 1;
    and M in (0, π), since it takes f − M of angles in different turns."""
    e = (1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.3, 0.52, 0.7)[k]
    rng = np.random.default_rng(k)
    i, raan, M = rng.uniform([0.2, 0, 0.1], [1.0, 6, 3])
    mean = np.array([7.1e6 / (1 - e), e, i if k % 2 else math.pi - i, raan, math.pi / 4, M])
    osculating = brahe.state_koe_mean_to_osc(
        mean, brahe.MeanElementMethod.BROUWER_LYDDANE, brahe.AngleFormat.RADIANS
    )
    return {
        "mu": brahe.GM_EARTH,
        "radius": brahe.R_EARTH,
        "j2": brahe.J2_EARTH,
        "mean": mean.tolist(),
        "osculating": osculating.tolist(),
    }


if __name__ == "__main__":
    main()
