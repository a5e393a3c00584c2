"""``posse track``: runs a navigator over the frames that a dataset already has."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._cli import completing
from posse_core._cli.common import echo_json, echo_table, options_from
from posse_core._cli.flight_output import MEANINGS, flight_bar, plain, shown
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._evaluation.track import Spread, TrackSummary


@click.command(epilog=MEANINGS)
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option(
    "--navigator",
    metavar="NAME",
    shell_complete=completing.components("navigator"),
    help="Navigator; 'posse plugins' lists the names.",
)
@click.option("--sequence", type=int, metavar="N", help="Number of the sequence, if there are several.")
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder of record and page; by default DATASET."
)
@click.option("--json", "as_json", is_flag=True, help="Print the key figures as JSON.")
@click.option(
    "-o",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    shell_complete=completing.track_keys,
    help="Set a key, as in -o measurement.source=truth; 'posse describe track' lists them.",
)
def command(
    dataset: Path,
    navigator: str | None,
    sequence: int | None,
    out: Path | None,
    as_json: bool,
    overrides: tuple[str, ...],
) -> None:
    """Track the target over the frames of DATASET, made by 'posse run' or 'posse fly'.

    Writes the record track.npz and the page track.html, and prints the errors of the estimate beside
    those of single-frame poses. Seed and, of a flight, measurements, navigator and errors are those of
    the dataset's scenario, unless -o gives others.
    """
    from posse_core._dataset.dataset import Dataset
    from posse_core._dataset.layout import SCENARIO, TRACK_PAGE
    from posse_core._evaluation.track import summarise_track
    from posse_core._flight.track import track
    from posse_core._scenario.track import read_track_config

    given = options_from(overrides)
    if navigator is not None:
        given["navigator.name"] = navigator
    source = Dataset(dataset)
    config = read_track_config(dataset / SCENARIO, given)
    folder = out or dataset
    registry = load_plugins().registry
    record = track(source, config, registry, sequence=sequence, out=folder, progress=flight_bar)
    summary = summarise_track(record, source.spacecraft.symmetries)
    if as_json:
        echo_json({"dataset": str(dataset), "out": str(folder), **plain(dataclasses.asdict(summary))})
        return
    counted = f"{summary.frames} frames, {summary.posed} with a pose of their own"
    click.echo(f"{dataset}: {counted}, {folder / TRACK_PAGE}")
    echo_table(("", "median", "95 %"), _errors(summary))
    click.echo(f"frames with the NEES in its 95 % band: {shown(100 * summary.nees_share)} %")
    click.echo(f"longest time lost: {shown(summary.lost_s)} s")


def _errors(summary: TrackSummary) -> list[tuple[str, str, str]]:
    """The errors in words and in the units that the words name."""

    def row(words: str, spread: Spread, factor: float) -> tuple[str, str, str]:
        return words, shown(factor * spread.median), shown(factor * spread.percentile_95)

    degree = math.degrees(1.0)
    return [
        row("position by the estimate, m", summary.position_m, 1.0),
        row("position by single frames, m", summary.single_position_m, 1.0),
        row("attitude by the estimate, degrees", summary.attitude_rad, degree),
        row("attitude by single frames, degrees", summary.single_attitude_rad, degree),
        row("velocity, mm/s", summary.velocity_m_s, 1e3),
        row("rate, degrees/s", summary.rate_rad_s, degree),
    ]
