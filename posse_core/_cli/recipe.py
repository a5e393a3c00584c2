"""``posse recipe``: makes nets for the pose of one spacecraft."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posse_core._cli import completing
from posse_core._cli.common import naming
from posse_core._cli.recipe_clock import clock
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import nearest

if TYPE_CHECKING:
    from posse_core._plugins.registry import Registry
    from posse_core._recipe.model import Recipe

_MOST_WORKERS = 8
_HOURS = 2.0


@click.command(name="recipe")
@click.argument("craft", shell_complete=completing.crafts)
@click.option(
    "--hours",
    type=click.FloatRange(min=0, min_open=True),
    help=f"Time that all may take; by default {_HOURS:g}.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder of everything that is made; by default out/recipe-NAME.",
)
@click.option(
    "--workers",
    type=click.IntRange(min=1, max=1024),
    help=f"Processes that make frames, and threads of a training; by default the processor's cores, at"
    f" most {_MOST_WORKERS}.",
)
@click.option("--scale", type=float, help="Of a mesh: length of one unit of the file, metres.")
@click.option(
    "--length",
    "length_m",
    type=float,
    help="Of a mesh, instead of --scale: length of the longest side, metres.",
)
def command(
    craft: str,
    hours: float | None,
    out: Path | None,
    workers: int | None,
    scale: float | None,
    length_m: float | None,
) -> None:
    """Make nets for the pose of CRAFT: frames, training, evaluation, ONNX files and a model card.

    CRAFT is the name of a built-in spacecraft, the folder of a package, a mesh, or the recipe.yaml of an
    earlier call, which may have been changed. Repeat the command to go on after whatever stopped it.
    """
    from posse_core._recipe.file import RECIPE, read_recipe, write_recipe
    from posse_core._recipe.follow import follow

    plugins = load_plugins()
    path = Path(craft)
    if path.suffix in (".yaml", ".yml"):
        options = {"--hours": hours, "--workers": workers, "--scale": scale, "--length": length_m}
        for option, value in {**options, "--out": out}.items():
            if value is not None:
                raise InputError(f"{option}: {path} is a recipe already; change it there")
        recipe, folder, file = read_recipe(path), path.absolute().parent, path
    else:
        folder = (out or Path("out") / f"recipe-{path.stem}").absolute()
        file = folder / RECIPE
        wanted = _made(craft, hours, workers, scale, length_m, plugins.registry)
        if file.exists():
            recipe = read_recipe(file)
            _check_same(recipe, wanted, hours, workers, file)
        else:
            _check_free(folder)
            recipe = wanted
            folder.mkdir(parents=True, exist_ok=True)
            write_recipe(recipe, file)
    with naming(str(file)), clock("recipe") as show:
        group = follow(recipe, folder, plugins, show)
    figures = ", ".join(
        f"{name} {group.metrics[name]:.4g}"
        for name in ("mAP", "poses estimated", "e_t median", "e_q median, deg")
        if name in group.metrics
    )
    click.echo(f"{folder}: {group.frames} test frames: {figures}; read {folder / 'card.md'}")


def _made(
    craft: str,
    hours: float | None,
    workers: int | None,
    scale: float | None,
    length_m: float | None,
    registry: Registry,
) -> Recipe:
    """The recipe of a spacecraft by its name, package or mesh."""
    from posse_core._recipe.defaults import default_recipe

    path = Path(craft)
    names = [name for name in registry.names("scene") if name not in ("mesh", "package")]
    keys: dict[str, Any] = {"name": craft}
    if craft not in names:
        if path.is_dir():
            keys = {"package": str(path.absolute())}
        elif path.is_file():
            keys = {"mesh": str(path.absolute()), "scale_m_per_unit": _scale(path, scale, length_m)}
        else:
            raise InputError(
                f"{craft}: no built-in spacecraft, package folder or mesh file of this name"
                f"{nearest(craft, names) or '.'} Built-in ones are {', '.join(names)}"
            )
    if "mesh" not in keys and (scale is not None or length_m is not None):
        raise InputError(f"--scale and --length are for meshes, and {craft} is none; leave them out")
    cores = min(len(os.sched_getaffinity(0)), _MOST_WORKERS)
    return default_recipe(keys, hours or _HOURS, workers or cores, registry)


def _scale(path: Path, scale: float | None, length_m: float | None) -> float:
    from posse_core._cli.import_mesh import scale_of
    from posse_core._spacecraft.reader import read_mesh

    return scale_of(read_mesh(path), path, scale, length_m)


def _check_same(
    there: Recipe, wanted: Recipe, hours: float | None, workers: int | None, path: Path
) -> None:
    """Refuse to go on with a recipe that says something else than the command."""
    for key, given in (("craft", True), ("hours", hours), ("workers", workers)):
        if given is not None and getattr(there, key) != getattr(wanted, key):
            raise InputError(
                f"{path}: says another {key} than the command; go on with 'posse recipe {path}', or"
                " choose another folder with --out"
            )


def _check_free(folder: Path) -> None:
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise InputError(f"--out {folder}: is not an empty folder, and holds no recipe; choose another")
