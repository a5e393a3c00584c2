"""``posse import-poses``: makes a scenario from the poses of another dataset's labels."""

from __future__ import annotations

import os
from pathlib import Path

import click

from posse_core._cli import completing
from posse_core._cli.common import camera_of
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins


@click.command("import-poses")
@click.argument("labels", type=click.Path(path_type=Path))
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), help="Folder to make; it must not exist."
)
@click.option(
    "--target",
    required=True,
    shell_complete=completing.crafts,
    help="Spacecraft to render: its name ('posse plugins' lists them as scenes) or a package's folder.",
)
@click.option(
    "--sun",
    "sun_cam",
    nargs=3,
    type=float,
    default=(-0.5, -0.5, -0.7),
    show_default=True,
    metavar="X Y Z",
    help="Direction of the Sun in camera axes: right, down, forward.",
)
@click.option(
    "--camera",
    "camera_file",
    type=click.Path(path_type=Path),
    help="A camera.json as in SPEED+, or another calibration as for a scenario's camera.calibration; by"
    " default the camera.json beside LABELS or in the folder above.",
)
@click.option(
    "--every",
    "every_s",
    type=click.FloatRange(1e-6, 1e6),
    metavar="SECONDS",
    help="The poses are one motion, so many seconds apart; by default each stands by itself.",
)
@click.option(
    "--centre-of-mass",
    "centre_m",
    nargs=3,
    type=float,
    default=(0.0, 0.0, 0.0),
    metavar="X Y Z",
    help="The target's centre of mass in the labels' body axes, m, which becomes its origin.",
)
def command(
    labels: Path,
    out: Path,
    target: str,
    sun_cam: tuple[float, float, float],
    camera_file: Path | None,
    every_s: float | None,
    centre_m: tuple[float, float, float],
) -> None:
    """Make a scenario with the poses of LABELS: SPEED's or SPEED+'s JSON, or URSO's poses_gt.csv.

    'posse run OUT/scenario.yaml' then renders them anew. The labels do not say where the Sun and the
    Earth are, so the Sun is assumed in the direction of --sun, and there is no Earth. A motion is put on
    a circular orbit, with the camera looking back along it.
    """
    import numpy as np

    from posse_core._formats.poses import camera_beside, read_poses
    from posse_core._scenario.component import TargetChoice, target_named
    from posse_core._scenario.from_poses import write_scenario

    choice = target_named(target, load_plugins().registry)
    if choice.name == "package":
        # A path in a scenario is from the scenario's folder.
        choice = TargetChoice.model_validate({"package": os.path.relpath(target, out)})
    if out.exists():
        raise InputError(f"{out}: this folder exists already; name a new one")
    if not np.isfinite([*centre_m, every_s or 0.0]).all():
        raise InputError("--every and --centre-of-mass: a number is not finite; give metres and seconds")
    poses = read_poses(labels).with_origin(np.array(centre_m))
    camera = camera_beside(labels) if camera_file is None else camera_of(camera_file)
    path = write_scenario(labels, poses, np.array(sun_cam), choice, camera, out, every_s=every_s)
    if camera is None:
        click.echo(
            f"posse: no camera.json beside {labels}; the scenario has the default camera;"
            " give another by --camera",
            err=True,
        )
    click.echo(f"{path}: {len(poses.names)} poses")
