"""``posse eval``: measures the accuracy of models on one part of a dataset."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posse_core._cli import completing
from posse_core._cli.common import (
    FORMATS,
    echo_json,
    echo_table,
    model_options,
    options_from,
    refine_options,
    refiner_choice,
    worker_option,
)
from posse_core._cli.progress import bar, phase
from posse_core._dataset.layout import PARTS
from posse_core._detection.glossary import METRICS
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._dataset.images import LabelledImages
    from posse_core._detection.evaluate import Judge
    from posse_core._detection.groups import Group
    from posse_core._formats.opening import ImageFormat
    from posse_core._scenario.component import ComponentChoice


@click.command(
    name="eval", epilog="Columns: " + "; ".join(f"{name}: {words}" for name, words in METRICS.items())
)
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option("--model", type=click.Path(path_type=Path), help="Model that finds spacecraft.")
@click.option("--keypoints", type=click.Path(path_type=Path), help="Model that finds keypoints.")
@click.option(
    "--part",
    default="test",
    shell_complete=completing.words({**dict.fromkeys(PARTS, ""), "all": "all frames"}),
    show_default=True,
    help="Part of the dataset (train, valid, test), or 'all'.",
)
@click.option(
    "--format",
    "layout",
    type=click.Choice(FORMATS),
    help="How the images are laid out; by default what their files say. Where SPEED's or SHIRT's have no"
    " camera.json, it says which published camera took them.",
)
@click.option(
    "--target",
    default="tango",
    shell_complete=completing.crafts,
    show_default=True,
    help="Spacecraft of images of SPEED, SPEED+ or SHIRT: its name, or the folder of its package.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Write an HTML page with plots.")
@worker_option
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@refine_options
@model_options
def command(
    dataset: Path,
    model: Path | None,
    keypoints: Path | None,
    part: str,
    layout: ImageFormat | None,
    target: str,
    out: Path | None,
    workers: int,
    as_json: bool,
    refine: bool,
    refiner: str,
    refine_ms: float | None,
    overrides: tuple[str, ...],
) -> None:
    """Measure models on a part of DATASET: COCO's average precisions and the overlap of boxes, and with
    --keypoints the errors of keypoints and poses. With --keypoints, boxes are those of the meshes at the
    poses where these are plausible.

    DATASET is one of 'posse run', or COCO, or a folder or a file of labels of SPEED, SPEED+ or SHIRT.

    Without --model and --keypoints, the shipped models of posse-detect-onnx are used.
    """
    from posse_core._detection.evaluate import frames_of
    from posse_core._detection.groups import columns, groups
    from posse_core._detection.page import make_page
    from posse_core._detection.processes import made_by
    from posse_core._files.atomic import write_bytes
    from posse_core._formats.opening import open_dataset

    if out is not None and not out.absolute().parent.is_dir():
        raise InputError(f"--out {out}: its folder does not exist; make it, or name another")
    source = open_dataset(dataset, format=layout, target=target)
    indices = frames_of(source, part)
    if part == "all":
        _warn_of_training(source)
    choice = refiner_choice(refine=refine, refiner=refiner, refine_ms=refine_ms)
    opened = partial(_judge, (model, keypoints), options_from(overrides), choice)
    with phase("opening the models"):
        judge = opened(source)
    with contextlib.closing(judge):
        again = partial(_judge_of, dataset, layout, target, opened)
        results = made_by(judge, indices, again, workers, load_plugins().registry)
        judged = list(bar(results, len(indices)))
    with phase("computing the metrics"):
        result = groups(source, judged)
    digest = source.sha256
    if out is not None:
        models = " and ".join(path.name for path in (model, keypoints) if path is not None)
        title = f"{models or 'The shipped models'} on {source.folder.resolve().name}, part {part}"
        write_bytes(
            out, make_page(title, f"Dataset's SHA-256: {digest}", source, judged, result).encode()
        )
    if as_json:
        data = {"dataset": str(dataset), "dataset_sha256": digest, "part": part}
        echo_json(
            {**data, "model": str(model or "shipped"), "groups": [asdict(group) for group in result]}
        )
        return
    click.echo(f"{dataset}, part {part}, sha256 {digest}")
    for names in columns(result):
        if names:
            _echo_groups(result, names)
    click.echo("what the columns mean: posse eval --help")


def _judge(
    models: tuple[Path | None, Path | None],
    options: Mapping[str, Any],
    refiner: ComponentChoice | None,
    source: LabelledImages,
) -> Judge:
    """A judge of labelled images, of whose spacecraft the models are asked.

    Raises:
        InputError: a model cannot be used, or poses without keypoints are to be refined.
    """
    from posse_core._detection.evaluate import Judge
    from posse_core._detection.known import dataset_shapes
    from posse_core._detection.models import open_models

    registry = load_plugins().registry
    detector, finder = open_models(*models, registry, options, source.classes)
    if refiner is not None and finder is None:
        raise InputError("--refine: poses need keypoints; name their model by --keypoints")
    shapes = None if finder is None else dataset_shapes(source, registry, refiner)
    return Judge(source, detector, finder, shapes)


def _judge_of(
    dataset: Path,
    layout: ImageFormat | None,
    target: str,
    opened: Callable[[LabelledImages], Judge],
) -> Judge:
    """The judge of a worker, which opens the images itself."""
    from posse_core._formats.opening import open_dataset

    return opened(open_dataset(dataset, format=layout, target=target))


def _warn_of_training(source: LabelledImages) -> None:
    """Say that some of all frames are for training, if the dataset is divided into parts."""
    try:
        trained = len(source.part("train"))
    except InputError:
        return
    if trained:
        click.echo(
            f"posse: warning: --part all includes the {trained} frames of the train part; a model that"
            " was trained on them looks better than it is (--part test does not include them)",
            err=True,
        )


def _echo_groups(result: Sequence[Group], names: Sequence[str]) -> None:
    rows = [
        (g.name, str(g.frames), *(f"{g.metrics[n]:.4f}" if n in g.metrics else "-" for n in names))
        for g in result
    ]
    echo_table(("", "frames", *names), rows)
