"""``posse annotate``: labels one's own photographs of a spacecraft with its pose."""

from __future__ import annotations

import contextlib
import shlex
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from posse_core._cli import completing
from posse_core._cli.common import camera_of, echo_json, echo_table
from posse_core._cli.progress import bar, phase
from posse_core._errors import CheckFailed, InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._model.spacecraft import Spacecraft
    from posse_core._photos.solve import PhotoPose


@click.command()
@click.argument("photos", type=click.Path(path_type=Path))
@click.option(
    "--target",
    required=True,
    shell_complete=completing.crafts,
    help="The spacecraft: its name ('posse plugins' lists them as scenes) or a package's folder.",
)
@click.option(
    "--camera",
    "camera_file",
    required=True,
    type=click.Path(path_type=Path),
    help="Calibration of the camera: a camera.json, or another as for a scenario's camera.calibration.",
)
@click.option(
    "--points",
    type=click.Path(path_type=Path),
    help="Points that the page has saved: compute the poses.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder for the labelled photographs, which may be an earlier one; by default PHOTOS/labelled.",
)
@click.option(
    "--sigma-px",
    default=1.0,
    show_default=True,
    type=click.FloatRange(min=0, min_open=True),
    help="Standard deviation of a clicked position along each axis, px.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the poses as JSON.")
def command(
    photos: Path,
    target: str,
    camera_file: Path,
    points: Path | None,
    out: Path | None,
    sigma_px: float,
    as_json: bool,
) -> None:
    """Label the photographs in the folder PHOTOS with the pose of a spacecraft.

    Without --points, the command writes PHOTOS/annotate.html. Open it in a browser, click the keypoints
    on the photographs, save the points, and run the command again with --points: it computes the poses
    and writes labels in the formats of COCO and SPEED, covariances and residuals, and pictures of the
    poses.
    When points do not fit, the command names them and ends with code 1.
    """
    from posse_core._files.atomic import write_bytes
    from posse_core._photos.labelled import POSES, pose_record, write_labelled
    from posse_core._photos.points import check_photo, photos_in, read_points
    from posse_core._photos.solve import solve_photo
    from posse_core._view.annotate.page import ANNOTATE, annotate_page

    if out is not None and points is None:
        raise InputError("--out: there is nothing to write into it without --points")
    camera = camera_of(camera_file)
    craft = _craft(target)
    names = photos_in(photos)
    if points is None:
        for name in bar(names, len(names), "checking photographs", unit="photo"):
            check_photo(photos / name, camera)
        page = photos / ANNOTATE
        again = ["posse", "annotate", str(photos), "--target", target, "--camera", str(camera_file)]
        with phase(f"writing {page}"):
            text = shlex.join([*again, "--points", "points.json"])
            write_bytes(page, annotate_page(craft, camera, names, text))
        click.echo(f"{page}: {len(names)} photographs; open it in a browser, save points.json, then:")
        click.echo(text)
        return
    folder = out or photos / "labelled"
    _check_out(folder, POSES)
    clicked = read_points(points, craft, camera, names)
    if not clicked:
        raise InputError(f"{points}: has no points; click some on {photos / ANNOTATE}")
    for name in clicked:
        check_photo(photos / name, camera)
    every = [
        solve_photo(name, clicked[name], craft, camera, sigma_px)
        for name in bar(clicked, len(clicked), "computing poses", unit="photo")
    ]
    solved = [each for each in every if each.pose is not None]
    if solved:
        with _replaced(folder) as new, phase("drawing poses"):
            write_labelled(new, photos, solved, craft, camera)
    if as_json:
        echo_json([pose_record(each) for each in solved])
    else:
        _print(solved, folder, len(names) - len(clicked))
    _judge(every)


def _craft(target: str) -> Spacecraft:
    """The spacecraft that ``--target`` names, with its joints at zero.

    Raises:
        InputError: it has fewer keypoints than a pose needs.
    """
    from posse_core._detection.fitting import MIN_POINTS
    from posse_core._scenario.component import create, target_named
    from posse_core._simulator.returned import built

    registry = load_plugins().registry
    choice = target_named(target, registry)
    craft = built(create(registry, "scene", choice), choice.name).welded(())
    if len(craft.keypoints_body_m) < MIN_POINTS:
        raise InputError(
            f"--target {target}: has {len(craft.keypoints_body_m)} keypoints, and a pose needs"
            f" {MIN_POINTS}; pick more"
        )
    return craft


def _check_out(folder: Path, mark: str) -> None:
    """Check that a folder is new, empty, or of this command, which leaves the file ``mark``.

    Raises:
        InputError: it is none of these, or cannot be made.
    """
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir()) and not (folder / mark).is_file()):
        raise InputError(f"--out {folder}: is there and not of 'posse annotate'; name a new folder")
    if not folder.absolute().parent.is_dir():
        raise InputError(f"--out {folder}: there is no folder {folder.parent}; make it first")


@contextlib.contextmanager
def _replaced(folder: Path) -> Iterator[Path]:
    """An empty folder, which becomes ``folder`` when the block ends without an error."""
    from posse_core._files.atomic import PARTIAL

    new = Path(tempfile.mkdtemp(PARTIAL, f".{folder.name}.", folder.absolute().parent))
    try:
        yield new
        new.chmod(0o755)
        if folder.exists():
            shutil.rmtree(folder)
        new.rename(folder)
    finally:
        shutil.rmtree(new, ignore_errors=True)


def _print(solved: Sequence[PhotoPose], folder: Path, untouched: int) -> None:
    import numpy as np

    rows = []
    for each in solved:
        pose = each.pose
        assert pose is not None
        sigma = np.sqrt([np.linalg.eigvalsh(pose.covariance[i : i + 3, i : i + 3])[-1] for i in (0, 3)])
        rows.append(
            (
                each.photo,
                f"{pose.inliers.sum()} of {len(each.names)}",
                f"{each.rms_px:.2f}",
                f"{pose.range_m:.4g}",
                f"{np.degrees(sigma[0]):.2g}",
                f"{sigma[1]:.2g}",
            )
        )
    if rows:
        header = ("photograph", "points", "rms, px", "range, m", "attitude ±, deg", "position ±, m")
        echo_table(header, rows)
        click.echo(f"{folder}: {len(rows)} photographs with poses; look at {folder / 'overlays'}, then:")
        click.echo(f"posse validate {folder / 'coco.json'}; posse validate {folder / 'speed.json'}")
    if untouched:
        click.echo(f"{untouched} photographs have no points")


def _judge(every: Sequence[PhotoPose]) -> None:
    """Say what is wrong with points, each in one line.

    Raises:
        CheckFailed: something is.
    """
    for each in every:
        for fault in each.faults:
            lost = "; no pose is written" if each.pose is None else ""
            click.echo(f"posse: warning: {each.photo}: {fault}{lost}", err=True)
        if each.remark:
            click.echo(f"posse: warning: {each.photo}: {each.remark}", err=True)
    wrong = sum(1 for each in every if each.faults)
    if wrong:
        raise CheckFailed(f"{wrong} of {len(every)} photographs have points that do not fit")
