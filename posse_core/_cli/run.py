"""``posse run``: makes a dataset from a scenario."""

from __future__ import annotations

import contextlib
import json
import shlex
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posse_core._cli import completing
from posse_core._cli.common import (
    DEFAULT_SCENARIO,
    STOPPED,
    free_folder,
    naming,
    read_scenario,
    scenario_options,
)
from posse_core._cli.progress import phase, phase_before_bar
from posse_core._errors import InputError
from posse_core._plugins.loading import Plugins, load_plugins

if TYPE_CHECKING:
    from posse_core._interfaces.executor import Executor, FrameMade, FrameResult
    from posse_core._run.run import Progress, RunResult


@click.command()
@click.argument("scenario", required=False, shell_complete=completing.scenarios)
@click.option(
    "--renderer",
    metavar="NAME",
    shell_complete=completing.components("renderer"),
    help="Renderer to use; 'posse plugins' lists the names.",
)
@click.option(
    "--out",
    shell_complete=completing.folders,
    help="Folder of the dataset, or s3://BUCKET/FOLDER; by default a new one in out/.",
)
@click.option("--workers", type=click.IntRange(min=1), help="Number of workers; by default 1.")
@click.option(
    "--executor",
    default="local",
    shell_complete=completing.components("executor"),
    show_default=True,
    help="Executor that makes the frames; 'posse plugins' lists the names.",
)
@click.option(
    "--frame-time-limit",
    type=click.FloatRange(min=0, min_open=True),
    metavar="SECONDS",
    help="Stop and retry a frame that takes longer.",
)
@click.option("--resume", is_flag=True, help="Continue the run in --out.")
@click.option("--json", "as_json", is_flag=True, help="Print each event as one line of JSON.")
@scenario_options
def command(
    scenario: str | None,
    renderer: str | None,
    out: str | None,
    workers: int | None,
    executor: str,
    frame_time_limit: float | None,
    resume: bool,
    as_json: bool,
    seed: int | None,
    frames: int | None,
    overrides: tuple[str, ...],
) -> int:
    """Make a labelled dataset from SCENARIO: a YAML file, or the name of a built-in scenario.

    By default it is 'aqua', Aqua over the Earth. A collection of scenarios makes a folder for each.
    """
    from posse_core._run.plan import make_plan
    from posse_core._run.run import run
    from posse_core._scenario.load import scenario_members

    plugins = load_plugins()
    if resume and out is None:
        raise InputError("--resume: name the folder of the run by --out")
    named = {"renderer.name": renderer, "seed": seed, "frames": frames}
    pool = _executor(plugins, executor, workers, frame_time_limit)
    given = contextlib.nullcontext(scenario or DEFAULT_SCENARIO)
    plans = {}
    results = []
    with _started_in(out) if resume and scenario is None and out is not None else given as source:
        for member in scenario_members(source):
            checked = read_scenario(member, overrides, **named)
            with naming(member.source), phase("preparing the trajectory and the spacecraft"):
                plans[member.name] = make_plan(checked, plugins.registry)
        folder = out or free_folder(Path(source).stem)
        folders = {name: f"{folder}/{name}" if len(plans) > 1 else folder for name in plans}
        for name, plan in plans.items():
            shown = contextlib.nullcontext(partial(_events, folders[name])) if as_json else _bar()
            try:
                with shown as progress:
                    result = run(plan, folders[name], plugins, pool, resume=resume, progress=progress)
            except KeyboardInterrupt:
                click.echo(f"posse: stopped; to continue: {_resuming(folders[name])}", err=True)
                return STOPPED
            if as_json:
                _emit("finished", **_as_json(result))
            results.append(result)
    for result in results:
        _print(result, to_stdout=not as_json)
    return 3 if any(result.failed for result in results) else 0


@contextlib.contextmanager
def _started_in(out: str) -> Iterator[str]:
    """A local copy of the scenario of the run at a location, with its files."""
    from posse_core._dataset.layout import INPUTS, SCENARIO
    from posse_core._files.store import open_store

    with contextlib.ExitStack() as stack:
        try:
            path = stack.enter_context(open_store(out).local_copy(SCENARIO, INPUTS))
            if not path.exists():
                raise FileNotFoundError
        except FileNotFoundError:
            raise InputError(
                f"--resume: {out} has no scenario.yaml; name the scenario that the run was started with"
            ) from None
        yield str(path)


def _executor(
    plugins: Plugins, name: str, workers: int | None, frame_time_limit_s: float | None
) -> Executor:
    given = {"workers": workers, "frame_time_limit_s": frame_time_limit_s}
    given = {key: value for key, value in given.items() if value is not None}
    options = plugins.registry.options("executor", name, given, where=f"--executor {name}")
    made: Executor = plugins.registry.create("executor", name, options)
    return made


@contextlib.contextmanager
def _bar() -> Iterator[Progress]:
    """Shows on a terminal what is done until the last frame."""
    with phase_before_bar("looking for frames that are there") as bar:
        yield lambda results, frames, done: bar(results, frames, done=done, first="opening the renderer")


def _events(
    out: str, results: Iterable[FrameResult[FrameMade]], frames: int, done: int
) -> Iterable[FrameResult[FrameMade]]:
    """Print a line when the run starts, and one per frame once its labels are on disk."""
    _emit("started", dataset=out, frames=frames, done=done)
    for result in results:
        yield result
        if result.made is None:
            _emit("failed", frame=result.index, error=result.error)
        else:
            _emit("frame", frame=result.index)


def _emit(event: str, **values: Any) -> None:
    click.echo(json.dumps({"event": event, **values}, ensure_ascii=False))


def _as_json(result: RunResult) -> dict[str, Any]:
    from posse_core._dataset.remarks import Remark

    return {
        "dataset": result.out,
        "frames": result.frames,
        "made": result.made,
        "failed": {str(index): error for index, error in result.failed.items()},
        "seconds": round(result.seconds, 3),
        "remarks": {remark.name.lower(): result.remarks.get(remark, 0) for remark in Remark},
    }


def _print(result: RunResult, *, to_stdout: bool) -> None:
    if to_stdout:
        click.echo(
            f"{result.out}: {result.made} frames made of {result.frames} in {result.seconds:.1f} s"
        )
        click.echo(f"{_remarks(result)}; next: {_next(result)}")
    for index, error in sorted(result.failed.items()):
        click.echo(f"posse: frame {index} failed: {' '.join(error.split())}", err=True)


def _remarks(result: RunResult) -> str:
    """``30 frames: 9 in eclipse, 4 dark``, of the frames that the dataset now has."""
    from posse_core._dataset.remarks import Remark

    counted = [
        f"{result.remarks[remark]} {remark.value}" for remark in Remark if remark in result.remarks
    ]
    words = f"{result.frames - len(result.failed)} frames"
    return f"{words}: {', '.join(counted)}" if counted else words


def _next(result: RunResult) -> str:
    """What the user may do with the dataset."""
    from posse_core._files.store import is_remote

    if result.failed:
        return _resuming(result.out)
    if is_remote(result.out):
        return "copy it to a folder for 'posse view'"
    return f"posse view {shlex.quote(result.out)}"


def _resuming(folder: str) -> str:
    return f"posse run --resume --out {shlex.quote(folder)}"
