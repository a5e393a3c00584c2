"""Options and output that several commands share."""

from __future__ import annotations

import contextlib
import json
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posse_core._cli import completing
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._model.camera import Camera
    from posse_core._scenario.component import ComponentChoice
    from posse_core._scenario.load import Member
    from posse_core._scenario.model import Scenario

DEFAULT_SCENARIO = "aqua"
FORMATS = ("posse", "coco", "speed", "speed+", "shirt")
"""Layouts of labelled images."""
COMPLETING = "_POSSE_COMPLETE"
"""Environment variable by which a shell asks what may follow."""
_IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
"""Endings of the images that a folder is searched for."""
STOPPED = 130
"""Exit code after Ctrl-C, as shells have it: 128 and the number of the signal."""


def scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """``-o``, ``--seed``, ``--frames``: options that change a scenario from the command line."""
    for option in (
        click.option("--seed", type=int, help="Seed of every random draw."),
        click.option(
            "--frames", type=int, help="Make only this many frames, evenly spread over the scenario."
        ),
        click.option(
            "-o",
            "overrides",
            multiple=True,
            shell_complete=completing.scenario_keys,
            metavar="KEY=VALUE",
            help="Set any key of the scenario, as in -o renderer.spp=64. May be repeated.",
        ),
    ):
        command = option(command)
    return command


def model_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """``-o``: options of the models that a command runs."""
    return click.option(
        "-o",
        "overrides",
        multiple=True,
        metavar="KEY=VALUE",
        shell_complete=completing.model_keys,
        help="Set an option of the model, as in -o threads=1. May be repeated.",
    )(command)


def refine_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """``--refine``, ``--refiner``, ``--refine-ms``: how a command refines poses."""
    for option in (
        click.option(
            "--refine-ms",
            type=click.FloatRange(min=0, min_open=True),
            metavar="MS",
            help="With --refine: take no longer than about so many milliseconds for a pose.",
        ),
        click.option(
            "--refiner",
            default="render-compare",
            show_default=True,
            shell_complete=completing.components("refiner"),
            help="With --refine: the refiner to use.",
        ),
        click.option(
            "--refine", is_flag=True, help="Refine the poses of spacecraft whose meshes are known."
        ),
    ):
        command = option(command)
    return command


worker_option = click.option(
    "--workers",
    default=1,
    show_default=True,
    type=click.IntRange(min=1),
    help="Number of processes that search in images, each with models of its own.",
)
"""``--workers``: in how many processes a command searches in images."""


def refiner_choice(*, refine: bool, refiner: str, refine_ms: float | None) -> ComponentChoice | None:
    """The refiner that the options choose; None for none."""
    from posse_core._scenario.component import ComponentChoice

    if not refine:
        if refine_ms is not None:
            raise InputError("--refine-ms: nothing is refined; add --refine")
        return None
    options = {} if refine_ms is None else {"ms": refine_ms}
    return ComponentChoice(name=refiner, options=options)


def options_from(overrides: Sequence[str]) -> dict[str, Any]:
    """The keys and values that ``-o`` gives."""
    from posse_core._scenario.load import parse_override

    return dict(parse_override(text) for text in overrides)


def read_scenario(source: str | Member, overrides: Sequence[str], **named: str | int | None) -> Scenario:
    """The scenario, changed by ``-o`` and by the named options (None: not given)."""
    from posse_core._scenario.load import Member, load_scenario

    member = source if isinstance(source, Member) else Member(source, {})
    given = {**member.overrides, **options_from(overrides)}
    given.update({key: value for key, value in named.items() if value is not None})
    return load_scenario(member.source, load_plugins().registry, given)


def camera_of(path: Path) -> Camera:
    """The camera that ``--camera`` names: a camera.json, or another calibration."""
    from posse_core._plugins.options import validated
    from posse_core._scenario.camera import CameraConfig

    keys = {"calibration": str(path)}
    return validated(CameraConfig, keys, lambda key: f"--camera {path}").camera()


def camera_named(given: str) -> Camera:
    """A published camera by its name, or that of a file."""
    from posse_core._dataset.camera import read_camera
    from posse_core._plugins.options import nearest
    from posse_core._scenario.camera import preset_camera
    from posse_core._scenario.presets import PRESETS

    if given in PRESETS:
        return preset_camera(given)
    if not Path(given).exists():
        hint = nearest(given, PRESETS)
        raise InputError(f"--camera {given}: is neither a file nor a published camera{hint}")
    return read_camera(Path(given))


def image_files(images: Sequence[Path]) -> list[Path]:
    """The files that a command is given, and those in the folders that it is given."""
    files: list[Path] = []
    for path in images:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in _IMAGES)
            if not inside:
                hint = f"; give {path / 'images'}" if (path / "images").is_dir() else ""
                raise InputError(f"{path}: has no images ({', '.join(_IMAGES)}){hint}")
            files += inside
        elif path.exists():
            files.append(path)
        else:
            raise InputError(f"{path}: there is no such file or folder")
    return files


@contextlib.contextmanager
def naming(source: str) -> Iterator[None]:
    """Prefix an input error with the name of the scenario or recipe that caused it."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{source}: {error}") from None


def free_folder(stem: str) -> str:
    """The folder of a command without ``--out``: ``out/STEM-20260131-120000``."""
    return f"out/{stem}-{time.strftime('%Y%m%d-%H%M%S')}"


def echo_json(value: Any) -> None:
    """Print a value as JSON."""
    click.echo(_as_json(value))


@contextlib.contextmanager
def json_list() -> Iterator[Callable[[Any], None]]:
    """A function that prints a value as the next of a JSON list. The list is closed where an error or an
    interrupt ends it too, so that what was printed can be read."""
    count = 0

    def echo(value: Any) -> None:
        nonlocal count
        click.echo((",\n" if count else "[\n") + textwrap.indent(_as_json(value), "  "), nl=False)
        count += 1

    try:
        yield echo
    finally:
        if count:
            click.echo("\n]")
    if not count:
        click.echo("[]")


def _as_json(value: Any) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)


def echo_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows in aligned columns."""
    table = [header, *rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    for row in table:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        click.echo("  ".join(cells).rstrip())
