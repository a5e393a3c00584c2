"""``posse propagate``: writes the trajectory of a scenario without rendering it."""

from __future__ import annotations

from pathlib import Path

import click

from posse_core._cli import completing
from posse_core._cli.common import naming, read_scenario, scenario_options
from posse_core._cli.progress import phase
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins


@click.command()
@click.argument("scenario", shell_complete=completing.scenarios)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="File to write; its name ends in .npz or .csv.",
)
@scenario_options
def command(
    scenario: str, out: Path, seed: int | None, frames: int | None, overrides: tuple[str, ...]
) -> None:
    """Write the trajectory of SCENARIO: target, chaser, attitudes, Sun, eclipse and solar flux."""
    from posse_core._files.trajectory import save_trajectory
    from posse_core._trajectory.build import make_trajectory

    if out.suffix not in (".npz", ".csv"):
        raise InputError(f"--out {out}: the file's name must end in .npz or .csv")
    checked = read_scenario(scenario, overrides, seed=seed, frames=frames)
    with naming(scenario), phase("computing the trajectory"):
        trajectory = make_trajectory(checked, load_plugins().registry)
    try:
        save_trajectory(trajectory, out)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror}") from None
    click.echo(f"{out}: {len(trajectory)} states")
