"""``posse export``: writes the labels of a dataset in other formats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from posse_core._cli import completing
from posse_core._cli.common import options_from
from posse_core._cli.progress import phase
from posse_core._errors import InputError
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
@click.option(
    "-o",
    "overrides",
    multiple=True,
    metavar="FORMAT.KEY=VALUE",
    shell_complete=completing.export_keys,
    help="Set an option of a format, as in -o hf.licence=cc-by-4.0. May be repeated.",
)
def command(
    dataset: Path, formats: tuple[str, ...], out: Path | None, overrides: tuple[str, ...]
) -> None:
    """Write the labels of DATASET in other formats, and print the paths of the files.

    'posse plugins' lists the formats as writers. Image paths in the files are relative to the dataset's
    folder.
    """
    from posse_core._dataset.dataset import Dataset
    from posse_core._run.exports import record_exports
    from posse_core._simulator.returned import written

    registry = load_plugins().registry
    writers = {
        name: registry.create("writer", name, registry.options("writer", name, given, where=name))
        for name, given in _options(formats, overrides).items()
    }
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


def _options(formats: Sequence[str], overrides: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The options of each format by ``-o``."""
    options: dict[str, dict[str, Any]] = {name: {} for name in formats}
    for key, value in options_from(overrides).items():
        name, _, option = key.partition(".")
        if name not in options or not option:
            raise InputError(
                f"option -o {key}={value}: begin it with a format, as in -o {formats[0]}.KEY=VALUE"
            )
        options[name][option] = value
    return options
