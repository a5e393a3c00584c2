"""Compares casadi Functions with hand-written numpy for relative states by the exact map.

``python benchmarks/dynamics.py`` prints times, their ratio, and the memory that streaming needs. Both
use one thread and run in turn; the least time of several rounds counts.
"""

from __future__ import annotations

import os
import platform
import resource
import time
from collections.abc import Callable, Iterator
from functools import partial

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics.elements import equinoctial_from_qns, qns_from_keplerian, qns_sign
from posse_core._dynamics.roe import (
    equinoctial_roe_from_roe,
    rtn_from_equinoctial_roe,
    stream_rtn,
)
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._trajectory.problem import resolve

MU = Constants().mu_earth_m3_s2
MILLION = 1_000_000
BLOCK = 4096
ROUNDS = 5


def numpy_blocks(
    chief: FloatArray, sign: float, roe: FloatArray, t_s: FloatArray
) -> Iterator[FloatArray]:
    """The formula of stream_rtn in blocks that fit the cache, for one pair of orbits.

    Constants are computed outside the loop, and the solution of Kepler's equation stops on convergence.
    """
    a, l, ex, ey, p, q = chief
    da, dl, dex, dey, dp, dq = roe
    n = np.sqrt(MU / a**3)
    drift = n * np.expm1(-1.5 * np.log1p(da))
    a_2, ex_2, ey_2 = a * (1 + da), ex + dex, ey + dey
    axes = np.stack(numpy_axes(p, q, sign)) @ np.stack(numpy_axes(p + dp, q + dq, sign)[:2], axis=1)
    for start in range(0, len(t_s), BLOCK):
        t = t_s[start : start + BLOCK]
        l_1 = l + np.fmod(n * t, 2 * np.pi)
        x, y, vx, vy, r, h = numpy_in_plane(a, l_1, ex, ey)
        x_2, y_2, vx_2, vy_2, _, _ = numpy_in_plane(a_2, l_1 + dl + drift * t, ex_2, ey_2)
        c, s, rate = x / r, y / r, h / r**2
        position = axes @ np.stack([x_2, y_2])
        velocity = axes @ np.stack([vx_2, vy_2])
        out = np.empty((len(t), 6))
        along = c * position[1] - s * position[0]
        radial = c * position[0] + s * position[1] - r
        out[:, 0], out[:, 1], out[:, 2] = radial, along, position[2]
        out[:, 3] = c * (velocity[0] - vx) + s * (velocity[1] - vy) + rate * along
        out[:, 4] = c * velocity[1] - s * velocity[0] - rate * r - rate * radial
        out[:, 5] = velocity[2]
        yield out


def numpy_axes(p: float, q: float, sign: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    k = 1 / (1 + p * p + q * q)
    return (
        k * np.array([1 - p * p + q * q, 2 * p * q, -2 * p * sign]),
        k * np.array([2 * p * q * sign, (1 + p * p - q * q) * sign, 2 * q]),
        k * np.array([2 * p, -2 * q, (1 - p * p - q * q) * sign]),
    )


def numpy_in_plane(a: float, l: FloatArray, ex: float, ey: float) -> tuple[FloatArray, ...]:
    s, c = np.sin(l), np.cos(l)
    F = l + (ex * s - ey * c) / np.sqrt(1 - 2 * (ex * c + ey * s) + ex**2 + ey**2)
    while True:
        s, c = np.sin(F), np.cos(F)
        f2, f3 = ex * s - ey * c, ex * c + ey * s
        f, f1 = F - f2 - l, 1 - f3
        d = -f / (f1 - f * f2 / (2 * f1))
        d = -f / (f1 + d * f2 / 2 + d**2 * f3 / 6)
        d = -f / (f1 + d * f2 / 2 + d**2 * f3 / 6 - d**3 * f2 / 24)
        F = F + d
        if np.max(np.abs(d)) < 1e-4:  # of fifth order: the remaining error is below 1e-20
            break
    s, c = np.sin(F), np.cos(F)
    eta = np.sqrt(1 - ex * ex - ey * ey)
    b = 1 / (1 + eta)
    r = a * (1 - ex * c - ey * s)
    speed = np.sqrt(MU * a) / r
    x = a * ((1 - ey * ey * b) * c + ex * ey * b * s - ex)
    y = a * ((1 - ex * ex * b) * s + ex * ey * b * c - ey)
    vx = speed * (ex * ey * b * c - (1 - ey * ey * b) * s)
    vy = speed * ((1 - ex * ex * b) * c - ex * ey * b * s)
    return x, y, vx, vy, r, np.sqrt(MU * a) * eta


def best_s(*ways: Callable[[], object]) -> list[float]:
    """Least processor time of each function, seconds; they run in turn."""
    times: list[list[float]] = [[] for _ in ways]
    for _ in range(ROUNDS):
        for way, spent in zip(ways, times, strict=True):
            start = time.process_time()
            way()
            spent.append(time.process_time() - start)
    return [min(spent) for spent in times]


def consume(blocks: Iterator[object]) -> None:
    for _ in blocks:
        pass


def streamed(chief: FloatArray, sign: float, roe: FloatArray, t_s: FloatArray) -> None:
    consume(stream_rtn(chief, sign, roe, MU, t_s))


def by_numpy(chief: FloatArray, sign: float, roe: FloatArray, t_s: FloatArray) -> None:
    consume(numpy_blocks(chief, sign, roe, t_s))


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    print(f"{platform.processor() or platform.machine()}, numpy {np.__version__}, one thread")
    for e in (1e-4, 0.52):
        qns = qns_from_keplerian(np.array([7.1e6 / (1 - e), e, 1.7, 1.0, 2.0, 3.0]))
        sign = float(qns_sign(qns))
        chief = equinoctial_from_qns(qns, sign)
        roe = equinoctial_roe_from_roe(qns, np.array([1, 2, 3, 4, 5, 6]) * 1e-6, sign)
        t_s = np.linspace(0, 60_000, MILLION)
        before = peak_mb()
        streamed(chief, sign, roe, t_s)
        after = peak_mb()
        with_casadi, with_numpy = best_s(
            partial(streamed, chief, sign, roe, t_s), partial(by_numpy, chief, sign, roe, t_s)
        )
        ours = rtn_from_equinoctial_roe(chief, sign, roe, MU, t_s[:BLOCK])
        apart = np.max(np.abs(ours - next(numpy_blocks(chief, sign, roe, t_s))))
        print(
            f"a million states, e = {e:g}: casadi {with_casadi:.3f} s, numpy {with_numpy:.3f} s,"
            f" ratio {with_casadi / with_numpy:.2f}; they differ by {apart:.1e} m;"
            f" streaming added {after - before:.1f} MB"
        )
    elements = {
        "epoch_utc": "2022-01-31T02:02:27.58", "a_m": 7.1e6, "e": 1e-4, "i_deg": 98.2,
        "raan_deg": 10.0, "argp_deg": 20.0, "mean_anomaly_deg": 30.0,
    }  # fmt: skip
    design = {"name": "algorithm-3-1-repaired", "size_m": 10, "relative_orbits": 25}
    problem = resolve(
        OrbitConfig.model_validate({"elements": elements}),
        RelativeConfig.model_validate({"design": design}),
        np.linspace(0, 5954, 101),
        Constants(),
    )
    propagator = load_plugins().registry.create("propagator", "roe")
    (whole,) = best_s(lambda: propagator.propagate(problem))
    grid = np.stack([np.linspace(0, 5954, 101)] * 25)
    many = np.stack([roe * (1 + k / 25) for k in range(25)])[:, None]
    (alone,) = best_s(lambda: rtn_from_equinoctial_roe(chief, sign, many, MU, grid))
    print(f"2525 states (101 x 25): map {alone * 1e3:.1f} ms, whole propagator {whole * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
