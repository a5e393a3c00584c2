"""``posse train``: trains a detector on a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._cli import completing
from posse_core._cli.common import model_options, options_from
from posse_core._cli.progress import phase
from posse_core._errors import InputError
from posse_core._files.atomic import folder_of_result
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._interfaces.detector import Model


@click.command()
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option(
    "--detector",
    required=True,
    metavar="NAME",
    shell_complete=completing.components("detector", "train"),
    help="Detector to train; 'posse plugins' lists the names.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder for the model, the checkpoints and the learning curves.",
)
@model_options
def command(dataset: Path, detector: str, out: Path, overrides: tuple[str, ...]) -> None:
    """Train a detector on the train part of DATASET and evaluate it on the valid part.

    Repeat the command to continue a training that was interrupted. 'posse describe detector NAME' lists
    the options.
    """
    from posse_core._formats.opening import open_dataset

    registry = load_plugins().registry
    if "train" not in registry.spec("detector", detector).capabilities:
        able = [s.name for s in registry.specs("detector") if "train" in s.capabilities]
        raise InputError(f"detector {detector!r} cannot be trained; these can: {', '.join(able)}")
    options = registry.options("detector", detector, options_from(overrides), where="option")
    source = open_dataset(dataset)
    _ = source.sha256  # raises if the run has not ended: frames would be missing
    with phase("opening the detector"):
        model: Model = registry.create("detector", detector, options)
    with folder_of_result(out):
        click.echo(model.train(source, out))
