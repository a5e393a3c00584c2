"""``posse eval``: how right a detector is on one part of a dataset."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from posse_core.cli.common import echo_json, echo_table, net_options, options_from
from posse_core.dataset import Dataset
from posse_core.detection.card import dataset_hash
from posse_core.detection.evaluate import Group, evaluate, frames_of
from posse_core.detection.models import open_detector, open_keypoint_finder
from posse_core.plugins import load_plugins


@click.command(name="eval")
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option("--model", type=click.Path(path_type=Path), required=True, help="Finds spacecraft.")
@click.option("--keypoints", type=click.Path(path_type=Path), help="Model that finds keypoints.")
@click.option("--part", default="test", show_default=True, help="Part of the dataset, or 'all'.")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@net_options
def command(
    dataset: Path,
    model: Path,
    keypoints: Path | None,
    part: str,
    as_json: bool,
    overrides: tuple[str, ...],
) -> None:
    """Measure a model on a part of DATASET: COCO's averages, box overlap; with --keypoints, poses."""
    registry = load_plugins().registry
    given = options_from(overrides)
    source = Dataset(dataset)
    indices = frames_of(source, part)
    detector = open_detector(model, registry, given)
    finder = None if keypoints is None else open_keypoint_finder(keypoints, registry, given)
    groups = evaluate(source, indices, detector, finder)
    if as_json:
        data = {"dataset": str(dataset), "dataset_sha256": dataset_hash(source), "part": part}
        echo_json({**data, "model": str(model), "groups": [asdict(group) for group in groups]})
        return
    click.echo(f"{dataset}, part {part}, sha256 {dataset_hash(source)}")
    _echo_groups(groups)


def _echo_groups(groups: list[Group]) -> None:
    names = list(dict.fromkeys(name for group in groups for name in group.metrics))
    header = ("", "frames", *names)
    rows = [
        (g.name, str(g.frames), *(f"{g.metrics[n]:.4f}" if n in g.metrics else "-" for n in names))
        for g in groups
    ]
    echo_table(header, rows)
