"""``posse train``: a detector learns from a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._cli.common import net_options, options_from
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._interfaces.detector import Model


@click.command()
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option("--detector", required=True, metavar="NAME", help="Who learns; see 'posse plugins'.")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the training.")
@net_options
def command(dataset: Path, detector: str, out: Path, overrides: tuple[str, ...]) -> None:
    """Train a net on the train part of DATASET, and watch it on the valid part.

    A training that was cut short goes on when the command is given again. 'posse describe detector NAME'
    tells the options.
    """
    from posse_core._dataset.coco import open_dataset

    registry = load_plugins().registry
    if "train" not in registry.spec("detector", detector).capabilities:
        able = [s.name for s in registry.specs("detector") if "train" in s.capabilities]
        raise InputError(f"detector {detector!r} cannot be trained; these can: {', '.join(able)}")
    options = registry.options("detector", detector, options_from(overrides), where="option")
    source = open_dataset(dataset)
    _ = source.sha256  # a run that has not ended has frames to come
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be a folder: {error.strerror}") from None
    model: Model = registry.create("detector", detector, options)
    click.echo(model.train(source, out))
