"""``posse import``: makes a spacecraft package from a mesh."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posse_core._cli.common import echo_json, echo_table
from posse_core._cli.progress import phase
from posse_core._errors import InputError
from posse_core._plugins.options import validated

if TYPE_CHECKING:
    from posse_core._arrays import FloatArray
    from posse_core._spacecraft.raw import RawMesh


_FLAGS = {
    "mesh": "MODEL",
    "scale_m_per_unit": "--scale",
    "body_axes": "--axes",
    "centre_of_mass_m": "--centre-of-mass",
}
"""Key of the mesh's options → what the user writes here."""


@click.command("import")
@click.argument("model", type=click.Path(path_type=Path))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder to make; by default named like the spacecraft.",
)
@click.option("--name", help="Name of the spacecraft in the labels; by default the file's name.")
@click.option("--scale", "scale_m_per_unit", type=float, help="Length of one unit of the file, metres.")
@click.option(
    "--length", "length_m", type=float, help="Instead of --scale: length of the longest side, metres."
)
@click.option(
    "--axes",
    "body_axes",
    default="x y z",
    show_default=True,
    help="Axes of the mesh that lie along body x, y and z, as in 'x -z y'.",
)
@click.option(
    "--centre-of-mass",
    "centre_of_mass_m",
    nargs=3,
    type=float,
    metavar="X Y Z",
    help="Position in body axes from the file's origin, metres; by default the centroid of the surface.",
)
@click.option(
    "--keypoints",
    type=click.Path(path_type=Path),
    help="YAML or JSON file with keypoints, as points or as corners of parts.",
)
@click.option(
    "--keypoint-count",
    default=16,
    show_default=True,
    type=click.IntRange(0, 200),
    help="Number of keypoints to propose if there is no file of them.",
)
@click.option(
    "--symmetry",
    "symmetries",
    multiple=True,
    metavar="AXIS:ORDER",
    help="A rotation that leaves the spacecraft's appearance unchanged, as in z:2 for half a turn about"
    " Z. May be repeated.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
def command(
    model: Path,
    out: Path | None,
    name: str | None,
    scale_m_per_unit: float | None,
    length_m: float | None,
    body_axes: str,
    centre_of_mass_m: tuple[float, float, float] | None,
    keypoints: Path | None,
    keypoint_count: int,
    symmetries: tuple[str, ...],
    as_json: bool,
) -> None:
    """Make a spacecraft package from MODEL, a mesh in glTF, OBJ, PLY or STL.

    The command lists the parts of the file, scales and turns the mesh (it asks for the scale if none is
    given at a terminal), proposes keypoints, and writes a folder that a scenario names by
    'target: {package: FOLDER}'. Its page keypoints.html shows the mesh, to pick other keypoints.
    """
    import numpy as np

    from posse_core._spacecraft import importing
    from posse_core._spacecraft.options import MeshOptions
    from posse_core._spacecraft.proposals import shape_symmetries
    from posse_core._spacecraft.raw import unique_names
    from posse_core._spacecraft.reader import read_mesh
    from posse_core._view.picker.page import PICKER, picker_page

    group = _group(symmetries)
    with phase(f"reading {model}"):
        raw = read_mesh(model)
        about = importing.summary(raw)
    if not as_json:
        _show(model, about)
    asks = scale_m_per_unit is None and length_m is None and sys.stdin.isatty()
    if asks:
        longest = float((raw.bounds[1] - raw.bounds[0]).max())
        length_m = click.prompt(f"Its longest side is {longest:.6g} units. How many metres?", type=float)
    scale = scale_of(raw, model, scale_m_per_unit, length_m)
    if asks and centre_of_mass_m is None and _keeps_origin():
        centre_of_mass_m = (0.0, 0.0, 0.0)
    title = name or unique_names([model.stem])[0]
    is_centroid = centre_of_mass_m is None
    options = validated(
        MeshOptions,
        {
            "mesh": model,
            "scale_m_per_unit": scale,
            "body_axes": body_axes,
            "centre_of_mass_m": centre_of_mass_m,
            "keypoints": keypoints,
        },
        lambda key: _FLAGS.get(str(key[0]), f"--{key[0]}"),
    )
    with phase("making the spacecraft"):
        made_of = importing.imported(
            raw, options, title, keypoint_count=keypoint_count, symmetries=group
        )
    craft, centre = made_of.craft, made_of.centre_of_mass_m
    folder = out or Path(title)
    importing.write_package(
        folder,
        model,
        craft,
        scale_m_per_unit=scale,
        body_axes=body_axes,
        centre_of_mass_m=centre,
        pages={PICKER: picker_page(craft, centre)},
    )
    made = {
        "package": str(folder),
        "picker": str(folder / PICKER),
        "scale_m_per_unit": scale,
        "size_m": [float(x) for x in np.diff(craft.bounds_body_m, axis=0)[0]],
        "centre_of_mass_m": [float(x) for x in centre],
        "keypoints": {k: [float(x) for x in point] for k, point in craft.keypoints_body_m.items()},
        "joints": {
            joint.name: {**importing.joint_keys(craft)[joint.name], "animations": list(joint.animations)}
            for joint in craft.joints
        },
        "symmetries": len(craft.symmetries),
        "shape_repeats": [f"{axis}:{order}" for axis, order in shape_symmetries(craft)],
    }
    if as_json:
        echo_json({**about, **made})
    else:
        _print(made, is_centroid=is_centroid)


def _group(symmetries: tuple[str, ...]) -> tuple[FloatArray, ...]:
    from posse_core._spacecraft.proposals import rotations

    try:
        return rotations([_symmetry(text) for text in symmetries])
    except ValueError as error:
        raise InputError(f"--symmetry: {error}") from None


def _symmetry(text: str) -> tuple[str, int]:
    axis, _, order = text.partition(":")
    if axis not in ("x", "y", "z") or not order.isdigit() or not 2 <= int(order) <= 360:
        raise InputError(
            f"--symmetry {text}: write an axis and an order, as in z:2 for half a turn about Z"
        )
    return axis, int(order)


def _keeps_origin() -> bool:
    """Ask whether the origin of the body axes is the file's."""
    kept = click.prompt(
        "The origin of the body axes: the centroid of its surface, or the file's origin, as poses of"
        " others (SPEED's) need it?",
        type=click.Choice(["centroid", "file"]),
        default="centroid",
    )
    return bool(kept == "file")


def scale_of(raw: RawMesh, path: Path, scale: float | None, length_m: float | None) -> float:
    """The length of one unit of a mesh, m, by --scale or --length.

    Raises:
        InputError: neither is given, or both; or the spacecraft is of an implausible size.
    """
    from posse_core._spacecraft.mesh import stated_scale

    if scale is not None and length_m is not None:
        raise InputError("--scale and --length set the same quantity; give one of them")
    longest = float((raw.bounds[1] - raw.bounds[0]).max())
    if length_m is not None:
        scale = length_m / longest
    if scale is not None and not 0.0 < scale < math.inf:
        raise InputError("--scale and --length must be above zero")
    try:
        return stated_scale(raw, path, scale)
    except InputError as error:
        raise InputError(f"{error} (here by --scale or --length)") from None


def _show(path: Path, about: dict[str, Any]) -> None:
    size = " × ".join(f"{x:.4g}" for x in about["size_units"])
    click.echo(f"{path}: {size} units, {about['triangles']} triangles, {about['vertices']} vertices")
    rows = [
        [
            part["name"],
            str(part["triangles"]),
            "yes" if part["watertight"] else "no",
            part["material"],
            ", ".join(f"{kind} {size}" for kind, size in part["textures"].items()) or "-",
        ]
        for part in about["parts"]
    ]
    echo_table(["part", "triangles", "watertight", "material", "textures"], rows)


def _print(made: dict[str, Any], *, is_centroid: bool) -> None:
    """is_centroid: the centre of mass was not given."""
    from posse_core._spacecraft.importing import SCENARIO
    from posse_core._spacecraft.package import DESCRIPTION

    size = " × ".join(f"{x:.4g}" for x in made["size_m"])
    centre = ", ".join(f"{x:.4g}" for x in made["centre_of_mass_m"])
    click.echo(f"\n{made['package']}: {size} m, centre of mass at [{centre}] m from the file's origin")
    if is_centroid:
        click.echo(
            "That is the centroid of its surface; for the file's own origin, as poses of others"
            f" (SPEED's) need it, write centre_of_mass_m: [0, 0, 0] in {made['package']}/{DESCRIPTION},"
            " or import with --centre-of-mass 0 0 0."
        )
    rows = [[name, *(f"{x:8.3f}" for x in point)] for name, point in made["keypoints"].items()]
    if rows:
        echo_table(["keypoint", "x, m", "y, m", "z, m"], rows)
    rows = [
        [
            name,
            joint["kind"],
            joint.get("parent", "-"),
            ", ".join(joint["parts"]) or "-",
            _range(joint),
            ", ".join(joint["animations"]) or "-",
        ]
        for name, joint in made["joints"].items()
    ]
    if rows:
        echo_table(["joint", "kind", "parent", "parts", "limits", "animations"], rows)
    if made["shape_repeats"] and not made["symmetries"]:
        turns = ", ".join(made["shape_repeats"])
        click.echo(f"Its shape repeats under {turns}; if its appearance does too, add --symmetry.")
    click.echo(f"To pick other keypoints, open {made['picker']} in a browser.")
    click.echo(f"target: {{package: {made['package']}}}, or: posse run {made['package']}/{SCENARIO}")


def _range(joint: dict[str, Any]) -> str:
    """The limits of a joint for a table."""
    for key, unit in (("limits_deg", "deg"), ("limits_m", "m")):
        if key in joint:
            low, high = joint[key]
            return f"{low:.6g} … {high:.6g} {unit}"
    return "-"
