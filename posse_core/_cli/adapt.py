"""``posse adapt``: carries the nets of a recipe on with images of another domain."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._cli import completing
from posse_core._cli.common import FORMATS, camera_named, echo_table, image_files
from posse_core._cli.recipe_clock import clock
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._adaptation.figures import Figures
    from posse_core._formats.opening import ImageFormat

_SHOWN = (
    "mAP",
    "poses estimated",
    "e_t median",
    "e_q median, deg",
    "right",
    "trusted",
    "right if trusted",
)


@click.command(name="adapt")
@click.argument("recipe", type=click.Path(path_type=Path))
@click.argument("images", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="Folder of everything that is made."
)
@click.option(
    "--camera",
    shell_complete=completing.cameras,
    help="IMAGES are photographs without labels, and this is their camera: a camera.json, or the name of"
    " a published one such as speed-plus.",
)
@click.option(
    "--format",
    "layout",
    type=click.Choice(FORMATS),
    help="How labelled IMAGES are laid out; by default what their files say.",
)
@click.option(
    "--trust",
    default=0.5,
    show_default=True,
    type=click.FloatRange(0, 1),
    help="Without labels: least trust of a pose that the nets learn from.",
)
@click.option(
    "--share",
    default=0.25,
    show_default=True,
    type=click.FloatRange(0, 0.9, min_open=True),
    help="Share of IMAGES in what is learned from; the rest are the recipe's own frames.",
)
@click.option(
    "--epochs",
    default=4,
    show_default=True,
    type=click.IntRange(min=1),
    help="Epochs of each training.",
)
def command(
    recipe: Path,
    images: Path,
    out: Path,
    camera: str | None,
    layout: ImageFormat | None,
    trust: float,
    share: float,
    epochs: int,
) -> None:
    """Carry the nets in the folder RECIPE of 'posse recipe' on with IMAGES of another domain.

    IMAGES are labelled, as for 'posse eval': a quarter of them, or their part test, is held out to
    measure by. Or, with --camera, they are a folder of photographs without labels: the nets learn from
    those in which they find a pose that they trust, which is refined before. Repeat the command to go on
    after whatever stopped it.
    """
    from posse_core._adaptation.adapt import Adaptation, Choice
    from posse_core._adaptation.nets import Nets
    from posse_core._adaptation.photographs import Photographs
    from posse_core._formats.opening import open_dataset

    if camera is not None and layout is not None:
        raise InputError("--format: is for labelled images, and --camera for such without labels")
    folder = _folder(out)
    registry = load_plugins().registry
    nets = Nets.of(recipe.absolute(), registry)
    with clock("adapt") as show:
        adaptation = Adaptation(nets, Choice(trust, share, epochs), folder, registry, show)
        if camera is None:
            target = open_dataset(images, format=layout, target=nets.spacecraft)
            folder.mkdir(parents=True, exist_ok=True)
            figures = adaptation.by_labelled(target)
        else:
            photographs = Photographs(image_files([images]), camera_named(camera))
            folder.mkdir(parents=True, exist_ok=True)
            figures = adaptation.by_photographs(photographs)
    _print(figures)
    click.echo(f"{folder}: boxes.onnx and keypoints.onnx have learned from {figures.learned} images")


def _folder(out: Path) -> Path:
    """The folder of everything that is made, which is new, empty or of an earlier call.

    Raises:
        InputError: it is none of these.
    """
    from posse_core._recipe.file import RECIPE
    from posse_core._recipe.steps import NOTES

    folder = out.absolute()
    if folder.is_file() or (folder / RECIPE).exists():
        raise InputError(f"--out {out}: is a file, or the folder of a recipe; name a new folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / NOTES).exists():
        raise InputError(f"--out {out}: is there and not of 'posse adapt'; name a new folder")
    return folder


def _print(figures: Figures) -> None:
    from posse_core._evaluation.numbers import number

    rows = []
    for each in figures.compared:
        for when, metrics in (("before", each.before), ("after", each.after)):
            values = [number(metrics.get(name), 3) for name in _SHOWN]
            rows.append((f"{each.name}, {when}", str(each.frames), *values))
    echo_table(("", "frames", *_SHOWN), rows)
    counts = figures.trusting
    if counts is not None:
        click.echo(
            f"poses are trusted in {counts.before} of {counts.photographs} photographs before, and in"
            f" {counts.after} after, {counts.after - counts.kept} of them new; this is no proof, since"
            " the nets have learned from the first: label some by 'posse annotate' to measure errors"
        )
