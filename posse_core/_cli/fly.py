"""``posse fly``: flies a scenario with the camera in the loop, once or with many seeds."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from posse_core._cli import completing
from posse_core._cli.common import (
    echo_json,
    echo_table,
    free_folder,
    naming,
    read_scenario,
    scenario_options,
)
from posse_core._cli.flight_output import MEANINGS, flight_bar, plain, shown
from posse_core._cli.progress import bar
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._evaluation.flight import FlightSummary
    from posse_core._flight.fly import FlightMade


@click.command(
    epilog="Off the goal: distance of the true state from the last waypoint. While it is held, 95 %: of"
    " the time within it. Δv over the least: the sum of the impulses over that of the best plan that"
    f" knows everything and has exact thrusters. {MEANINGS}"
)
@click.argument("scenario", required=False, shell_complete=completing.scenarios)
@click.option(
    "--renderer",
    metavar="NAME",
    shell_complete=completing.components("renderer"),
    help="Renderer to use; 'posse plugins' lists the names.",
)
@click.option(
    "--out",
    shell_complete=completing.folders,
    help="Folder of the flight's dataset; by default a new one in out/.",
)
@click.option(
    "--seeds",
    type=click.IntRange(min=1),
    help="Fly with so many seeds, from the scenario's on, each in a folder of its own.",
)
@click.option("--workers", type=click.IntRange(min=1), help="Number of worker processes, with --seeds.")
@click.option("--resume", is_flag=True, help="Continue the flight or flights in --out.")
@click.option("--json", "as_json", is_flag=True, help="Print the key figures as JSON.")
@scenario_options
def command(
    scenario: str | None,
    renderer: str | None,
    out: str | None,
    seeds: int | None,
    workers: int | None,
    resume: bool,
    as_json: bool,
    seed: int | None,
    frames: int | None,
    overrides: tuple[str, ...],
) -> int:
    """Fly SCENARIO, a YAML file or the name of a built-in one with the key 'flight'.

    The folder is a dataset like that of a run, with the record flight.npz and the page flight.html.
    """
    from posse_core._dataset.layout import SCENARIO

    if frames is not None:
        raise InputError("--frames: a flight has a frame every flight.period_s; set flight.duration_s")
    if workers is not None and seeds is None:
        raise InputError("--workers: one flight cannot be divided; give --seeds too")
    if scenario is None:
        if not resume or out is None:
            raise InputError("name a scenario to fly, such as fly-approach, or --resume with --out")
        scenario = str(Path(out) / SCENARIO)
    named = {"renderer.name": renderer, "seed": seed}
    checked = read_scenario(scenario, overrides, **named)
    folder = out or free_folder(Path(scenario).stem)
    with naming(scenario):
        if seeds is None:
            return _one(checked, folder, resume=resume, as_json=as_json)
        return _many(checked, folder, seeds, workers or 1, resume=resume, as_json=as_json)


def _one(scenario: Any, folder: str, *, resume: bool, as_json: bool) -> int:
    from posse_core._dataset.dataset import Dataset
    from posse_core._evaluation.flight import summarise
    from posse_core._flight.fly import fly

    record = fly(scenario, folder, load_plugins(), resume=resume, progress=flight_bar)
    summary = summarise(record, Dataset(Path(folder)).spacecraft.symmetries)
    if as_json:
        echo_json({"dataset": folder, **plain(dataclasses.asdict(summary))})
    else:
        click.echo(f"{folder}: {len(record)} frames, {folder}/flight.html")
        echo_table(("figure", "value"), [(name, shown(value)) for name, value in _figures(summary)])
    return 0


def _many(scenario: Any, folder: str, seeds: int, workers: int, *, resume: bool, as_json: bool) -> int:
    from posse_core._flight.fly import fly_many

    registry = load_plugins().registry
    options = registry.options("executor", "local", {"workers": workers})
    executor = registry.create("executor", "local", options)
    results = fly_many(scenario, folder, seeds, executor, resume=resume)
    flown: list[FlightMade] = []
    failed: dict[int, str] = {}
    for result in bar(results, seeds, unit="flight"):
        if result.made is None:
            failed[scenario.seed + result.index] = result.error
        else:
            flown.append(result.made)
    flown.sort(key=lambda made: made.seed)
    if as_json:
        rows = [
            {"seed": made.seed, "dataset": made.folder, **plain(dataclasses.asdict(made.summary))}
            for made in flown
        ]
        echo_json({"flights": rows, "failed": {str(seed): error for seed, error in failed.items()}})
    elif flown:
        _table(flown)
    for seed, error in sorted(failed.items()):
        click.echo(f"posse: the flight of seed {seed} failed: {' '.join(error.split())}", err=True)
    return 3 if failed else 0


def _figures(summary: FlightSummary) -> list[tuple[str, Any]]:
    """The key figures in words."""
    over = summary.dv_m_s / summary.least_dv_m_s if summary.least_dv_m_s else math.nan
    return [
        ("range at the end, m", summary.final_range_m),
        ("off the goal at the end, m", summary.final_position_error_m),
        ("off the goal at the end, mm/s", 1e3 * summary.final_velocity_error_m_s),
        ("while it is held, 95 %, m", summary.position_error_95_m),
        ("while it is held, 95 %, mm/s", 1e3 * summary.velocity_error_95_m_s),
        ("Δv, m/s", summary.dv_m_s),
        ("Δv over the least", over),
        ("closest approach, m", summary.closest_m),
        ("inside the keep-out ellipsoid", summary.entered_keep_out),
        ("error of the estimate, median, m", summary.median_paired_position_error_m),
        ("error of single-frame poses, median, m", summary.median_single_position_error_m),
        ("error of the estimate at the end, m", summary.final_estimate_position_error_m),
        ("error of the estimate at the end, mm/s", 1e3 * summary.final_estimate_velocity_error_m_s),
        ("attitude error at the end, degrees", math.degrees(summary.attitude_error_rad)),
        ("rate error at the end, %", 100 * summary.rate_error),
        ("longest time lost, s", summary.lost_s),
        ("NEES at the end, in its 95 % band", summary.nees_in_band),
        ("frames with the NEES in its band, %", 100 * summary.nees_share),
    ]


def _table(flown: list[FlightMade]) -> None:
    """A row for each seed, then medians, and in how many flights each yes holds."""
    columns = [[value for _, value in _figures(made.summary)] for made in flown]
    names = [name for name, _ in _figures(flown[0].summary)]
    summary = [_typical([column[i] for column in columns]) for i in range(len(names))]
    head = ["figure", *(f"seed {made.seed}" for made in flown), "median"]
    rows = [
        [name, *(shown(column[i]) for column in columns), summary[i]] for i, name in enumerate(names)
    ]
    echo_table(head, rows)


def _typical(values: list[Any]) -> str:
    if isinstance(values[0], bool):
        return f"{sum(values)} of {len(values)}"
    known = [value for value in values if math.isfinite(value)]
    return shown(float(np.median(known))) if known else "–"
