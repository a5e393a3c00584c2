"""``posse partition``: divides a dataset into parts for training, validation and test."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._errors import InputError

if TYPE_CHECKING:
    from posse_core._selection.partition import By


@click.command(name="partition")
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option(
    "--split", default="80/10/10", show_default=True, help="Shares of the parts train, valid and test."
)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=click.IntRange(min=0),
    help="Seed that the frames are shuffled with.",
)
@click.option(
    "--by",
    type=click.Choice(["frame", "sequence"]),
    default="frame",
    show_default=True,
    help="What is shuffled: single frames, or whole sequences (relative orbits), so that each sequence"
    " lies in one part.",
)
def command(dataset: Path, split: str, seed: int, by: By) -> None:
    """Divide DATASET into parts for training, validation and test; the same seed gives the same parts.

    The frames of each part, and the six lists of the thesis, are written into the dataset's folder
    partition/.
    """
    from posse_core._dataset.dataset import Dataset
    from posse_core._dataset.layout import PARTS
    from posse_core._selection.partition import write_partition

    source = Dataset(dataset)
    _ = source.manifest  # raises if the run has not ended: frames would be missing
    parts = write_partition(source, _shares(split), seed, by)
    for part in PARTS:
        click.echo(f"{part} {len(parts[part])}")


def _shares(split: str) -> list[float]:
    from posse_core._dataset.layout import PARTS

    try:
        shares = [float(share) for share in split.split("/")]
    except ValueError:
        shares = []
    if len(shares) != len(PARTS) or not all(0 <= x < float("inf") for x in shares) or sum(shares) == 0:
        raise InputError(f"--split {split}: give three shares, such as 80/10/10")
    return shares
