"""Draws the figures of dynamics.md: ``python docs/plot_dynamics.py``, with matplotlib installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from posse_core._constants import Constants
from posse_core._dynamics.design import coverage
from posse_core._evaluation.model_errors import cases, errors
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._trajectory.problem import resolve

IMAGES = Path(__file__).with_name("images")
CONSTANTS = Constants()
DESIGNS: list[tuple[str, dict[str, Any]]] = [
    ("algorithm-3-1", {"delta_e_m": [10, 0], "delta_i_m": [0, 10]}),
    ("algorithm-3-1-repaired", {"size_m": 10}),
    ("safe-ellipse", {"radial_m": 10, "normal_m": 10}),
    ("view-sphere", {"range_m": [10, 40]}),
]


def model_errors() -> None:
    figure, axes = plt.subplots(2, 2, figsize=(11, 7), constrained_layout=True, sharey=True)
    wanted = [c for c in cases(CONSTANTS) if c.name != "Cluster from apogee"]
    for case, axis in zip(wanted, axes.flat, strict=True):
        result = errors(case, CONSTANTS)
        for name, history in result.by_model.items():
            axis.semilogy(result.orbits, np.maximum(history, 1e-10), label=name, linewidth=1.2)
        axis.set(title=f"{case.name}, truth: {case.gravity}", xlabel="orbits", ylim=(1e-10, 1e5))
        axis.grid(alpha=0.3)
    for axis in axes[:, 0]:
        axis.set_ylabel("position error, m")
    axes[0, 1].legend(fontsize=8, loc="lower right")
    figure.savefig(IMAGES / "model_errors.png", dpi=80)


def view_directions() -> None:
    figure, axes = plt.subplots(2, 2, figsize=(11, 6), constrained_layout=True, sharex=True, sharey=True)
    for (name, keys), axis in zip(DESIGNS, axes.flat, strict=True):
        r = positions({"name": name, **keys}, 2525 if name == "view-sphere" else 101)
        direction = r / np.linalg.norm(r, axis=-1, keepdims=True)
        azimuth = np.degrees(np.arctan2(direction[:, 1], direction[:, 0]))
        axis.plot(azimuth, direction[:, 2], ".", markersize=2)
        axis.set(title=f"{name}: {coverage(r):.0%} of 288 bins", xlim=(-180, 180), ylim=(-1, 1))
        axis.set_xticks(np.arange(-180, 181, 60))
    for axis in axes[1]:
        axis.set_xlabel("direction in the R–T plane, degrees from R")
    for axis in axes[:, 0]:
        axis.set_ylabel("component along N")
    figure.savefig(IMAGES / "view_directions.png", dpi=80)


def positions(design: dict[str, Any], times: int) -> Any:
    elements = {
        "epoch_utc": "2022-01-31T02:02:27.58",
        "a_m": 7.08e6,
        "e": 8.98e-5,
        "i_deg": 98.23,
        "raan_deg": 334.4,
        "argp_deg": 52.44,
        "mean_anomaly_deg": 318.1,
    }
    problem = resolve(
        OrbitConfig.model_validate({"elements": elements}),
        RelativeConfig.model_validate({"design": design}),
        np.linspace(0, 2 * np.pi * np.sqrt(7.08e6**3 / CONSTANTS.mu_earth_m3_s2), times),
        CONSTANTS,
    )
    return load_plugins().registry.create("propagator", "roe").propagate(problem).r_chaser_rtn_m


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    model_errors()
    view_directions()
