"""``posse export-onnx``: exports a trained model to ONNX and compares both on frames of a dataset."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._arrays import evenly_spread
from posse_core._cli.common import model_options, options_from
from posse_core._cli.progress import bar, phase
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._dataset.images import LabelledImages
    from posse_core._interfaces.detector import Model
    from posse_core._plugins.registry import Registry

_FRAMES = 8
_INT8_FRAMES = 128


@click.command(name="export-onnx")
@click.argument("model", type=click.Path(path_type=Path))
@click.option(
    "--dataset",
    type=click.Path(path_type=Path),
    required=True,
    help=f"Dataset of which {_FRAMES} frames, evenly spread, go through MODEL and through its export.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="File to write; its name ends in .onnx.",
)
@click.option(
    "--int8",
    is_flag=True,
    help=f"Quantise to eight bits. Half of {_INT8_FRAMES} frames calibrate, the others measure the loss"
    " of accuracy.",
)
@model_options
def command(model: Path, dataset: Path, out: Path, int8: bool, overrides: tuple[str, ...]) -> None:
    """Write MODEL (.safetensors) as ONNX. The file is kept only if its results agree with MODEL's."""
    from posse_core._detection.card import ModelCard
    from posse_core._detection.models import check_model_file, open_model
    from posse_core._formats.opening import open_dataset

    if out.suffix != ".onnx":
        raise InputError(f"--out {out}: the file's name must end in .onnx")
    check_model_file(model)
    registry = load_plugins().registry
    card = ModelCard.read(model)
    able = registry.spec("detector", card.net).capabilities
    if "onnx" not in able:
        raise InputError(f"{model}: {card.net!r} cannot be exported")
    if int8 and "int8" not in able:
        raise InputError(f"--int8: {card.net!r} can be exported in float32 only")
    source = open_dataset(dataset)
    images = [source.image(index) for index in _spread(source, _FRAMES)]
    with phase("opening the model"):
        net = open_model(model, card.task, registry, options_from(overrides))
    with tempfile.TemporaryDirectory() as folder:
        exact = Path(folder) / out.name if int8 else out
        with phase(f"exporting, and comparing on {len(images)} frames"):
            differences = net.export_onnx(exact, images)
        shown = ", ".join(f"{name} {value:.1e}" for name, value in differences.items())
        click.echo(f"{out}: greatest differences on {len(images)} frames: {shown}")
        if int8:
            _write_int8(net, card.task, exact, out, source, registry)


def _spread(source: LabelledImages, count: int) -> Sequence[int]:
    """``count`` positions of frames in the dataset, evenly spread."""
    from posse_core._detection.evaluate import frames_of

    positions = frames_of(source, "all")
    return [positions[k] for k in evenly_spread(len(positions), count)]


def _write_int8(
    net: Model, task: str, exact: Path, out: Path, source: LabelledImages, registry: Registry
) -> None:
    from posse_core._detection.accuracy import accuracy
    from posse_core._evaluation.metrics import true_boxes
    from posse_core._randomness import random_generator

    chosen = [index for index in _spread(source, _INT8_FRAMES) if true_boxes(source[index])]
    if not chosen:
        raise InputError(
            f"{source.folder}: no frame shows a spacecraft, so eight bits cannot be calibrated"
        )
    order = random_generator(0, 0, "eight bits").permutation(
        chosen
    )  # shuffled, since classes may alternate
    half = (len(chosen) + 1) // 2
    seen = [(source.image(i), true_boxes(source[i])[0].box_px) for i in order[:half].tolist()]
    with phase(f"calibrating eight bits on {len(seen)} frames"):
        net.write_int8(exact, out, seen)
    others = order[half:].tolist() or chosen
    before, after = (
        accuracy(source, bar(others, len(others), title), path, task, registry)
        for path, title in ((exact, "accuracy, float32"), (out, "accuracy, eight bits"))
    )
    losses = ", ".join(f"{name} {before[name]:.4g} to {after[name]:.4g}" for name in before)
    click.echo(f"{out}: eight bits, calibrated on {len(seen)} frames; on {len(others)} others: {losses}")
