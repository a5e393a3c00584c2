"""``posse collect``: one dataset out of several, less the frames that rules drop."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from posse_core.cli.common import echo_json
from posse_core.dataset import Dataset
from posse_core.selection.collect import collect
from posse_core.selection.rules import RULES, named


@click.command(
    name="collect", epilog="Rules: " + "; ".join(f"{r.name}: {r.why}" for r in RULES.values())
)
@click.argument("datasets", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="A new folder.")
@click.option("--drop", multiple=True, metavar="RULE", help="Drop frames by this rule; may be repeated.")
@click.option("--json", "as_json", is_flag=True, help="Print the counts as JSON.")
def command(datasets: tuple[Path, ...], out: Path, drop: tuple[str, ...], as_json: bool) -> None:
    """Join DATASETS, with one camera, to one, without the frames that rules drop.

    Frames are numbered anew. A frame counts for the first rule that drops it.
    """
    rules = named(drop)
    counts = collect([Dataset(folder) for folder in datasets], rules, out, _progress)
    if as_json:
        echo_json(counts)
        return
    for name, count in counts.items():
        click.echo(f"{name} {count}")


def _progress(labels: Iterable[dict[str, Any]], frames: int) -> Iterable[dict[str, Any]]:
    shown: Iterable[dict[str, Any]] = tqdm(labels, total=frames, unit="frame", disable=None)
    return shown
