"""``posse preview``: shows one frame of a scenario, with its labels, before a run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import click

from posse_core._cli import completing
from posse_core._cli.common import options_from
from posse_core._cli.progress import phase
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

DEFAULT_OUT: Final = Path("preview.png")
_SOFTWARE: Final = "posse preview"
_QUICKEST: Final = "raster"


@click.command()
@click.argument("scenario", shell_complete=completing.scenarios)
@click.option("--frame", type=click.IntRange(min=0), help="Index of the frame; by default 0.")
@click.option(
    "--time",
    "t_s",
    type=float,
    metavar="S",
    help="The scenario at a time instead, in seconds since its epoch.",
)
@click.option(
    "--renderer",
    metavar="NAME",
    shell_complete=completing.components("renderer"),
    help="Renderer to use; by default raster, where it is installed, else the scenario's.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="File to write, which may exist; its name ends in .png. By default preview.png, which may be"
    " an earlier preview.",
)
@click.option(
    "-o",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    shell_complete=completing.scenario_keys,
    help="Set any key of the scenario, as in -o camera.width_px=320. May be repeated.",
)
def command(
    scenario: str,
    frame: int | None,
    t_s: float | None,
    renderer: str | None,
    out: Path | None,
    overrides: tuple[str, ...],
) -> None:
    """Show one frame of SCENARIO as a picture, to check it before a long run.

    The picture has the image with its boxes, mask, keypoints, body axes and the direction to the Sun,
    the images of the sensors beside the camera, and a caption. Nothing else is written.
    """
    from posse_core._api import open as open_scenario
    from posse_core._files.atomic import write_bytes
    from posse_core._files.compressed import png
    from posse_core._view.frame_picture import LABELS, frame_picture

    path = _checked(out)
    if frame is not None and t_s is not None:
        raise InputError("--time: the frame is given by --frame too; leave one of them out")
    if t_s is not None and not math.isfinite(t_s):
        raise InputError(f"--time {t_s}: give a number of seconds")
    given = options_from(overrides)
    if renderer is None and not any(key.split(".")[0] == "renderer" for key in given):
        renderer = _QUICKEST if _QUICKEST in load_plugins().registry.names("renderer") else None
    with phase("opening the scenario"):
        simulator = open_scenario(
            scenario, renderer=renderer, overrides={**given, "annotators": list(LABELS)}
        )
    with simulator:
        used = f"rendered by {simulator.scenario.renderer.name}"
        with phase("making the frame"):
            shot = simulator.frame(simulator.state(frame or 0, t_s=t_s))
        picture = frame_picture(
            shot,
            simulator.scene,
            simulator.sensors,
            rendered_by=used,
            auto_exposure=simulator.scenario.sensor.auto_exposure is not None,
        )
    try:
        write_bytes(path, png(picture, _SOFTWARE))
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}; name another by --out") from None
    click.echo(f"{path}: frame {shot.index} at t = {shot.state.t_s:.10g} s, {used}")


def _checked(out: Path | None) -> Path:
    """The file to write.

    Raises:
        InputError: it cannot be a picture, or it is a file that the user did not name and may miss.
    """
    from posse_core._files.compressed import software_text

    path = DEFAULT_OUT if out is None else out
    if path.suffix != ".png":
        raise InputError(f"--out {path}: the file's name must end in .png")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file by --out")
    if not path.absolute().parent.is_dir():
        raise InputError(f"--out {path}: there is no folder {path.parent}; make it first")
    if out is None and path.exists():
        with path.open("rb") as file:
            is_ours = software_text(_SOFTWARE) in file.read(100)
        if not is_ours:
            raise InputError(f"{path}: is not an earlier preview; name it by --out to replace it")
    return path
