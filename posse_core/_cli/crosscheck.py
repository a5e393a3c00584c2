"""``posse crosscheck``: renders the same frames by several renderers and compares them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posse_core._cli import completing
from posse_core._cli.common import DEFAULT_SCENARIO, echo_json, echo_table, read_scenario
from posse_core._cli.progress import bar
from posse_core._errors import CheckFailed, ComponentError, InputError
from posse_core._evaluation.crosscheck.checks import Thresholds, Verdict, judge
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import nearest, validated
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice

if TYPE_CHECKING:
    from posse_core._evaluation.crosscheck.measures import Comparison
    from posse_core._evaluation.crosscheck.settings import Case, Poses
    from posse_core._interfaces.executor import Executor
    from posse_core._scenario.load import Member


def _threshold_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """``--min-iou`` and the others of :class:`Thresholds`."""
    for name, field in reversed(Thresholds.model_fields.items()):
        flag = f"--{name.replace('_', '-')}"
        option = click.option(
            flag, type=float, default=field.default, show_default=True, help=field.description
        )
        command = option(command)
    return command


_COLUMNS = (
    "IoU: overlap of the pixels that are covered by half or more with those that exact rays say are,"
    " over all frames together and of the worst frame; edge: mean distance between the two"
    " silhouettes' edges; shift, growth: displacement and growth of the silhouette; landmark: distance"
    " of a part's centroid from where it is in closed form; depth: difference of planar depth, median"
    " and 99 %; mean radiance: of the spacecraft; to closed form: radiance over its closed form, where"
    " it is farthest from it; RMS to closed form: of the difference, over the form's mean; noise:"
    " standard deviation of a pixel between seeds over the spacecraft's mean; opening, first frame,"
    " frame: seconds of the renderer alone. Of a pair, radiance ratio: all light of the first renderer"
    " over that of the second, in all frames together, and its least and most over frames; SSIM:"
    " structural similarity, 1 for equal images; ratio by material: the radiance ratio on each"
    " material"
)


@click.command(name="crosscheck", epilog=f"Columns: {_COLUMNS}.")
@click.argument(
    "scenarios", metavar="[SCENARIO]...", nargs=-1, shell_complete=completing.crosscheck_cases
)
@click.option(
    "--renderers",
    metavar="A,B,C",
    shell_complete=completing.renderers_by_commas,
    help="Renderers to compare; by default all that are installed.",
)
@click.option(
    "--frames", type=click.IntRange(min=1), default=20, show_default=True, help="Frames per scenario."
)
@click.option(
    "--poses",
    type=click.Choice(("random", "trajectory")),
    default="random",
    show_default=True,
    help="Take random attitudes at the scenario's ranges, or frames of its trajectory.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Write an HTML page with the images.")
@click.option("--json", "as_json", is_flag=True, help="Print every number of every frame as JSON.")
@click.option("--seed", type=int, help="Seed of every random draw.")
@click.option(
    "-o",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    shell_complete=completing.crosscheck_keys,
    help="Set an option of a renderer, as in -o blender.spp=64, or a key of the scenarios, as in"
    " -o camera.width_px=640. May be repeated.",
)
@_threshold_options
def command(
    scenarios: tuple[str, ...],
    renderers: str | None,
    frames: int,
    poses: Poses,
    out: Path | None,
    as_json: bool,
    seed: int | None,
    overrides: tuple[str, ...],
    **limits: float,
) -> None:
    """Render the same frames by several renderers, and compare them with geometry and each other.

    SCENARIO is a YAML file, the name of a built-in scenario, or a closed form: lambert-sphere,
    lambert-plate, mirror, glossy-sphere, paint-sphere, fiducials, moved-fiducials, checker. Before
    scenarios, the two lambert closed forms are always checked. When a number is outside its threshold,
    the command names it and ends with code 1.
    """
    from posse_core._evaluation.crosscheck.closed_forms import ANCHORS, CLOSED_FORMS, ClosedFormCase
    from posse_core._evaluation.crosscheck.compare import compare
    from posse_core._evaluation.crosscheck.page import make_page
    from posse_core._evaluation.crosscheck.settings import ScenarioCase
    from posse_core._files.atomic import write_bytes

    registry = load_plugins().registry
    thresholds = validated(Thresholds, limits, lambda path: f"--{str(path[0]).replace('_', '-')}")
    names = _names(renderers, registry)
    choices, scenario_overrides = _choices(names, overrides, registry)
    sources = scenarios or (DEFAULT_SCENARIO,)
    cases: list[Case] = []
    for source in sources:
        if source in CLOSED_FORMS:
            cases.append(ClosedFormCase(source))
            continue
        for member in _members(source):
            named = {"renderer.name": names[0], "seed": seed}
            scenario = read_scenario(member, scenario_overrides, **named)
            cases.append(ScenarioCase(member.name, scenario, poses, frames))
    if not all(isinstance(case, ClosedFormCase) for case in cases):
        given = [case.name for case in cases]
        cases = [ClosedFormCase(name) for name in ANCHORS if name not in given] + cases
    capabilities = {name: registry.spec("renderer", name).capabilities for name in names}
    if out is not None and not out.absolute().parent.is_dir():
        raise InputError(f"--out {out}: its folder does not exist; make it, or name another")
    executor: Executor = registry.create("executor", "local")
    comparisons = []
    with tempfile.TemporaryDirectory(prefix="posse-crosscheck-") as folder:
        for case in cases:
            able = {
                name: choice
                for name, choice in choices.items()
                if not case.needs_environment or "environment" in capabilities[name]
            }
            comparisons.append(compare(case, able, Path(folder) / case.name, executor, bar))
    verdicts = [v for c in comparisons for v in judge(c, thresholds, capabilities)]
    if out is not None:
        write_bytes(out, make_page(comparisons, verdicts).encode())
    if as_json:
        echo_json(_as_json(comparisons, verdicts))
    else:
        _print(comparisons)
    _end(comparisons, verdicts)


def _members(source: str) -> list[Member]:
    """As :func:`scenario_members`, but for an unknown name a similar closed form's is suggested."""
    from posse_core._evaluation.crosscheck.closed_forms import CLOSED_FORMS
    from posse_core._scenario.load import scenario_members

    try:
        return scenario_members(source)
    except InputError:
        hint = nearest(source, CLOSED_FORMS)
        if not hint:
            raise
        raise InputError(f"no scenario and no closed form named {source!r}{hint}") from None


def _names(renderers: str | None, registry: Registry) -> list[str]:
    installed = registry.names("renderer")
    names = installed if renderers is None else [name.strip() for name in renderers.split(",")]
    if not names:
        raise InputError("no renderer is installed; see 'posse doctor'")
    for name in names:
        registry.spec("renderer", name)
        if names.count(name) > 1:
            raise InputError(f"--renderers: {name!r} is given twice")
    return names


def _choices(
    names: Sequence[str], overrides: Sequence[str], registry: Registry
) -> tuple[dict[str, ComponentChoice], list[str]]:
    """The renderers with their options, and the remaining overrides, which are for the scenario."""
    from posse_core._scenario.load import parse_override

    options: dict[str, dict[str, Any]] = {name: {} for name in names}
    rest = []
    for text in overrides:
        key, value = parse_override(text)
        first, _, option = key.partition(".")
        if first in options and option:
            options[first][option] = value
        elif first == "renderer":
            raise InputError(
                f"option -o {text}: name the renderer that it is for, as in -o {names[0]}.{option}"
            )
        elif first in registry.names("renderer"):
            raise InputError(f"option -o {text}: {first!r} is not among --renderers {','.join(names)}")
        else:
            rest.append(text)
    choices = {}
    for name, raw in options.items():
        checked = registry.options("renderer", name, raw, where=name)
        choices[name] = ComponentChoice(name=name, options=checked.model_dump(mode="json"))
    return choices, rest


def _as_json(comparisons: Sequence[Comparison], verdicts: Sequence[Verdict]) -> dict[str, Any]:
    return {
        "passed": all(verdict.passed for verdict in verdicts)
        and not any(comparison.failures for comparison in comparisons),
        "cases": [comparison.as_json() for comparison in comparisons],
        "checks": [vars(verdict) for verdict in verdicts],
    }


def _print(comparisons: Sequence[Comparison]) -> None:
    from posse_core._evaluation.crosscheck.tables import pair_table, ratio_table, renderer_table

    for comparison in comparisons:
        click.echo(comparison.name)
        tables = [renderer_table("renderer", comparison.renderers)]
        if comparison.pairs:
            tables.append(pair_table("pair", comparison.pairs))
            tables.append(ratio_table("ratio by material", comparison.materials))
        for table in tables:
            echo_table(table.header, table.rows)
        click.echo("")


def _end(comparisons: Sequence[Comparison], verdicts: Sequence[Verdict]) -> None:
    failures = [
        f"{comparison.name}: {name} failed: {cause}"
        for comparison in comparisons
        for name, cause in comparison.failures.items()
    ]
    broken = [str(verdict) for verdict in verdicts if not verdict.passed]
    if failures:
        raise ComponentError("; ".join([*failures, *broken]))
    if broken:
        raise CheckFailed("; ".join(broken))
