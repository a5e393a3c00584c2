"""``posse export-onnx``: a trained net as ONNX, held against the net on real frames."""

from __future__ import annotations

from pathlib import Path

import click

from posse_core.cli.common import net_options, options_from
from posse_core.dataset import Dataset
from posse_core.detection.card import read_card
from posse_core.detection.evaluate import frames_of
from posse_core.detection.models import open_model
from posse_core.errors import InputError
from posse_core.plugins import load_plugins

_FRAMES = 8


@click.command(name="export-onnx")
@click.argument("model", type=click.Path(path_type=Path))
@click.option(
    "--dataset",
    type=click.Path(path_type=Path),
    required=True,
    help=f"{_FRAMES} frames of it, evenly spread, go through the net and through its export.",
)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="A file that ends in .onnx.")
@net_options
def command(model: Path, dataset: Path, out: Path, overrides: tuple[str, ...]) -> None:
    """Write MODEL (.safetensors) as ONNX; it is kept only if it gives what MODEL gives."""
    if out.suffix != ".onnx":
        raise InputError(f"--out {out}: the file's name must end in .onnx")
    if not model.is_file():
        raise InputError(f"{model}: there is no such file; name a model by 'posse train'")
    registry = load_plugins().registry
    card = read_card(model)
    if "onnx" not in registry.spec("detector", card.net).capabilities:
        raise InputError(f"{model}: {card.net!r} cannot be exported")
    source = Dataset(dataset)
    indices = frames_of(source, "all")
    images = [source.image(index) for index in indices[:: max(len(indices) // _FRAMES, 1)][:_FRAMES]]
    differences = open_model(model, card.task, registry, options_from(overrides)).export_onnx(
        out, images
    )
    found = ", ".join(f"{name} {value:.1e}" for name, value in differences.items())
    click.echo(f"{out}: greatest differences on {len(images)} frames: {found}")
