"""What the predictive controller costs and how well it holds, over flights with noise.

Prints a line for each case: impulses over the least possible, distance from the held waypoint and speed
there, CPU time of a command, and clearance. Run: python benchmarks/guidance.py [SEEDS]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from approach import E_HALF, NEAR_CIRCULAR, Drifting, Filter, Flown, Known, fly, problem

from posse_core import (
    Cone,
    Controller,
    ControlProblem,
    Estimate,
    Safety,
    Start,
    ThrusterErrors,
    Waypoint,
    create,
    random_generator,
)
from posse_core._guidance.optimum import least_dv_m_s

THRUSTERS = ThrusterErrors(size=0.01, direction_rad=0.01, least_m_s=0.0005)
HOLD = Waypoint(300.0, 900.0, np.array([0.0, -5.0, 0.0]), np.zeros(3))
BEHIND = np.array([0.0, -30.0, 0.0, 0.0, 0.0, 0.0])
CONE = Cone(np.array([0.0, -1.0, 0.0]), np.radians(15.0), 30.0)


def task(orbit: tuple[float, ...], waypoint: Waypoint, safety: Safety | None = None) -> ControlProblem:
    free = problem(orbit, waypoint.until_s)
    return replace(free, waypoints=(waypoint,), thrusters=THRUSTERS, safety=safety or Safety())


class Timed(Controller):
    """Another controller, with the CPU time of its commands."""

    def __init__(self, inner: Controller) -> None:
        self.inner = inner
        self.times_s: list[float] = []

    def start(self, problem: ControlProblem) -> None:
        self.inner.start(problem)

    def command(self, estimate: Estimate) -> np.ndarray:
        begin = time.process_time()
        dv = self.inner.command(estimate)
        self.times_s.append(time.process_time() - begin)
        return dv


def clearance(flown: Flown, safety: Safety) -> str:
    r = flown.arcs[..., :3].reshape(-1, 3)
    words = []
    if safety.keep_out_m is not None:
        words.append(f"nearest at {np.linalg.norm(r / safety.keep_out_m, axis=1).min():.4f} of it")
    if safety.cone is not None:
        near = r[np.linalg.norm(r, axis=1) < safety.cone.length_m]
        off = np.arccos(near @ safety.cone.axis_rtn / np.linalg.norm(near, axis=1))
        words.append(f"{np.degrees(off.max()):.1f}° off the axis")
    return ", ".join(words)


def run(
    name: str,
    flight: ControlProblem,
    start: np.ndarray,
    navigator: Callable[..., Known],
    seeds: int,
    controller: str = "impulsive-mpc",
) -> None:
    least = least_dv_m_s(flight, Start.from_rtn(flight.target, start[:3], start[3:]))
    (goal,) = flight.waypoints
    ratios, away_m, speeds, times_s, clear = [], [], [], [], []
    for seed in range(seeds):
        rng = random_generator(seed, 0, "benchmark of guidance")
        timed = Timed(create("controller", controller))
        flown = fly(timed, flight, start, navigator=partial(navigator, rng=rng), rng=rng)
        held = flown.states[flight.burns_s > goal.t_s]
        ratios.append(flown.total_m_s / least)
        away_m.append(np.linalg.norm(held[:, :3] - goal.r_rtn_m, axis=1))
        speeds.append(np.linalg.norm(held[:, 3:], axis=1))
        times_s += timed.times_s
        clear.append(clearance(flown, flight.safety))
    print(
        f"{name:34} least {least:.4f} m/s, times {np.median(ratios):.2f} ({max(ratios):.2f} at most),"
        f" {100 * np.quantile(away_m, 0.95):.1f} cm, {1e3 * np.quantile(speeds, 0.95):.1f} mm/s (95 %),"
        f" {1e3 * np.median(times_s):.0f} ms ({1e3 * max(times_s):.0f}) {min(clear)} … {max(clear)}",
        flush=True,
    )


def main(seeds: int) -> None:
    filtered = partial(Filter, errors=THRUSTERS)
    good, poor = partial(filtered, sigma_m=0.015), partial(filtered, sigma_m=0.05)
    for orbit, word in ((NEAR_CIRCULAR, "circular"), (E_HALF, "e = 0.5")):
        run(f"{word}, filter, 1.5 cm", task(orbit, HOLD), BEHIND, good, seeds)
        run(f"{word}, filter, 5 cm", task(orbit, HOLD), BEHIND, poor, seeds)
        run(f"{word}, drifting errors", task(orbit, HOLD), BEHIND, Drifting, seeds)
    below = replace(HOLD, r_rtn_m=np.array([-10.0, 0.0, 0.0]))
    run("below the target, filter, 5 cm", task(NEAR_CIRCULAR, below), BEHIND, poor, seeds)
    run("lqr, filter, 5 cm", task(NEAR_CIRCULAR, HOLD), BEHIND, poor, seeds, "lqr")
    far = np.array([0.0, -60.0, 0.0, 0.0, 0.0, 0.0])
    ahead = Waypoint(900.0, 1000.0, np.array([0.0, 60.0, 0.0]), np.zeros(3))
    sphere = np.full(3, 40.0)
    run("around a sphere of 40 m", task(NEAR_CIRCULAR, ahead, Safety(sphere)), far, poor, seeds)
    near = replace(HOLD, t_s=600.0)
    aside = np.array([10.0, -60.0, 20.0, 0.0, 0.0, 0.0])
    run("cone of 15°", task(NEAR_CIRCULAR, near, Safety(cone=CONE)), aside, poor, seeds)
    wait = Waypoint(600.0, 900.0, np.array([0.0, -45.0, 0.0]), np.zeros(3))
    passive = Safety(np.full(3, 20.0), passive_s=1500.0)
    run("passively safe for 1500 s", task(NEAR_CIRCULAR, wait, passive), far * 1.5, poor, seeds)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
