"""``posse export``: writes the labels of a dataset in other formats."""

from __future__ import annotations

from pathlib import Path

import click

from posse_core._cli import completing
from posse_core._cli.progress import phase
from posse_core._plugins.loading import load_plugins


@click.command(name="export")
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "formats",
    multiple=True,
    required=True,
    shell_complete=completing.components("writer"),
    help="Format to write, such as coco. May be repeated.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder to write to; by default the dataset's own.",
)
def command(dataset: Path, formats: tuple[str, ...], out: Path | None) -> None:
    """Write the labels of DATASET in other formats, and print the paths of the files.

    'posse plugins' lists the formats as writers. Image paths in the files are relative to the dataset's
    folder.
    """
    from posse_core._dataset.dataset import Dataset
    from posse_core._run.exports import record_exports
    from posse_core._simulator.returned import written

    registry = load_plugins().registry
    writers = {name: registry.create("writer", name) for name in formats}
    source = Dataset(dataset)
    _ = source.manifest  # raises if the run has not ended: no partial export
    folder = source.folder if out is None else out
    for name, writer in writers.items():
        with phase(f"writing {name}"):
            paths = written(writer, name, source, folder)
        if folder.resolve() == source.folder.resolve():
            record_exports(source.folder, paths)
        for path in paths:
            click.echo(path)
