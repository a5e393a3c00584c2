"""``posse validate``: proves the labels of a dataset."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._cli.common import echo_json, echo_table
from posse_core._cli.progress import phase_before_bar
from posse_core._errors import CheckFailed, InputError

if TYPE_CHECKING:
    from posse_core._evaluation.result import Report

SHOWN = 10
"""The most frames that the error names; ``--json`` lists all."""


@click.command(name="validate")
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option(
    "--render",
    "rendered",
    type=click.IntRange(min=1),
    metavar="N",
    help="Also render N of the frames anew, and compare them with those that are there.",
)
@click.option("--json", "as_json", is_flag=True, help="Print every fault of every frame as JSON.")
def command(dataset: Path, rendered: int | None, as_json: bool) -> None:
    """Check the files and checksums of DATASET, each label against pose, camera and mesh, and each
    picture against its labels.

    DATASET is a folder made by POSSE, or labels of any other origin: a COCO or SPEED file, or a BOP or
    YOLO-pose folder. When a check fails, the command names the frames and ends with code 1.
    """
    from posse_core._dataset.dataset import Dataset
    from posse_core._evaluation.foreign import validate_foreign
    from posse_core._evaluation.rendered import check_rendered
    from posse_core._evaluation.validate import validate

    with phase_before_bar("comparing checksums") as bar:
        foreign = validate_foreign(dataset)
        report = foreign or validate(Dataset(dataset), bar)
    if rendered is not None:
        if foreign is not None:
            raise InputError(f"{dataset}: only a dataset of 'posse run' can be rendered anew")
        with phase_before_bar("opening the renderer") as bar:
            again = check_rendered(Dataset(dataset), rendered, bar)
        report = replace(report, results=(*report.results, again))
    if as_json:
        echo_json(report.as_json())
    else:
        rows = [
            (r.name, str(r.checked), str(len(r.faults)), r.faults[0].message if r.faults else r.proves)
            for r in report.results
        ]
        echo_table(("check", "checked", "faults", "first fault, or what holds"), rows)
    if not report.passed:
        raise CheckFailed(_summary(report))


def _summary(report: Report) -> str:
    failed = [result for result in report.results if result.faults]
    frames = sorted({frame for result in failed for frame in result.frames})
    message = f"{report.folder}: {', '.join(result.name for result in failed)} failed"
    if not frames:
        return message
    more = f" and {len(frames) - SHOWN} more" if len(frames) > SHOWN else ""
    return f"{message} in frames {', '.join(str(frame) for frame in frames[:SHOWN])}{more}"
