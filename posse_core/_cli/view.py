"""``posse view``: writes an HTML page that shows a dataset."""

from __future__ import annotations

from pathlib import Path

import click

from posse_core._cli.progress import bar
from posse_core._errors import InputError


@click.command(name="view")
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="File to write; by default DATASET/view.html."
)
@click.option("--frames", type=click.IntRange(min=1), help="Show only this many frames, evenly spread.")
@click.option(
    "--max-mib",
    type=click.FloatRange(min=0, min_open=True),
    default=64,
    show_default=True,
    help="Largest size of the page. Frames whose preview does not fit are loaded from the dataset.",
)
def command(dataset: Path, out: Path | None, frames: int | None, max_mib: float) -> None:
    """Write one HTML page that shows DATASET in a browser: frames with their labels drawn,
    readings of sensors, filters, the relative orbit, distributions, the manifest.

    The page needs no server and no network.
    """
    from posse_core._dataset.dataset import Dataset
    from posse_core._view.page import write_page

    source = Dataset(dataset)
    out = source.folder / "view.html" if out is None else out
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: there is no folder {out.parent}; make it first")
    try:
        page = write_page(source, out, frames=frames, max_bytes=int(max_mib * 2**20), progress=bar)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror}") from None
    click.echo(
        f"{out}: {page.frames} frames, {page.previews} with a preview, {page.size_bytes / 2**20:.1f} MiB"
    )
