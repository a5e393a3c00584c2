"""``posse collect``: joins datasets into one, without the frames that rules drop."""

from __future__ import annotations

from pathlib import Path

import click

from posse_core._cli import completing
from posse_core._cli.common import echo_json
from posse_core._cli.progress import bar
from posse_core._errors import InputError
from posse_core._selection.balance import AXES, Balance, axes_named
from posse_core._selection.rules import RULES, named


@click.command(
    name="collect",
    epilog="Rules: "
    + "; ".join(f"{rule.name}: {rule.why}" for rule in RULES.values())
    + ". Balance by "
    + "; ".join(f"{axis.name}: {axis.why}" for axis in AXES.values()),
)
@click.argument("datasets", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    help="Folder of the new dataset; it must not exist.",
)
@click.option(
    "--drop",
    multiple=True,
    metavar="RULE",
    shell_complete=completing.words({rule.name: rule.why for rule in RULES.values()}),
    help="Drop the frames that this rule names. May be repeated.",
)
@click.option(
    "--balance",
    "by",
    multiple=True,
    metavar="AXIS",
    shell_complete=completing.words({axis.name: axis.why for axis in AXES.values()}),
    help="Keep equally many of the remaining frames in each bin of this axis. With several axes, a bin"
    " is a combination of theirs.",
)
@click.option(
    "--frames",
    type=click.IntRange(min=1),
    help="Number of frames to keep when balancing, divided as evenly as possible.",
)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=click.IntRange(min=0),
    help="Seed of the draw of frames by --balance.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the counts as JSON.")
def command(
    datasets: tuple[Path, ...],
    out: Path,
    drop: tuple[str, ...],
    by: tuple[str, ...],
    frames: int | None,
    seed: int,
    as_json: bool,
) -> None:
    """Join DATASETS into one, drop frames by rules, and balance the rest.

    All datasets must have the same camera. Frames are numbered anew. A frame that several rules drop is
    counted for the first of them.
    """
    from posse_core._dataset.dataset import Dataset
    from posse_core._selection.collect import collect

    rules = named(drop)
    if frames is not None and not by:
        raise InputError("--frames is for --balance only; name an axis by --balance")
    balance = Balance(axes_named(by), frames, seed) if by else None
    counts = collect([Dataset(folder) for folder in datasets], rules, balance, out, bar)
    if as_json:
        echo_json(counts)
        return
    for name, count in counts.items():
        click.echo(f"{name} {count}")
