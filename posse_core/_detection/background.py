"""The background behind the spacecraft in a frame: space, the Earth's limb, or the Earth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import SCENARIO, TRAJECTORY, inside
from posse_core._environment.earth import R_itrf_from_gcrf
from posse_core._errors import InputError
from posse_core._files.tables import read_table
from posse_core._frames import matrix_from_quaternion, unit
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine
from posse_core._scenario.yaml_lines import YamlText
from posse_core._sky.ellipsoid import SEMI_AXES_M, entry_distance_m

BACKGROUNDS = ("space", "limb", "Earth by day", "Earth by night")
_FIELDS = ("t_s", "q_eci_from_camera", "r_chaser_eci_m", "r_sun_eci_m")
_ACROSS = 9  # rays along each side of the box


def backgrounds(dataset: Dataset, lines: Sequence[LabelLine]) -> list[str | None]:
    """Return one of :data:`BACKGROUNDS` for each frame, or None if its scenario is not known.

    Rays are traced through the visible box, or through the whole image if the spacecraft is not visible.
    If some rays hit the Earth's ellipsoid and others miss it, the background is the limb. If all hit it,
    the Sun is above or below the horizon at most of the points hit.

    Raises:
        posse_core.InputError: The trajectory or a scenario cannot be read.
    """
    files = [_scenario_file(dataset, line) for line in lines]
    has_earth = {file: _earth_in(file) for file in set(files) if file is not None}
    if True not in has_earth.values():
        return [None if file is None else BACKGROUNDS[0] for file in files]
    table = read_table(dataset.folder / TRAJECTORY, _FIELDS)
    epoch, camera = table.epoch, dataset.camera
    if epoch is None:
        raise InputError(f"{table.path} has no 'epoch_utc'; files made by 'posse run' have it")
    result: list[str | None] = []
    for line, file in zip(lines, files, strict=True):
        if file is None or not has_earth[file]:
            result.append(None if file is None else BACKGROUNDS[0])
            continue
        t_s, q, r_camera_m, r_sun_m = (table[name][line.index] for name in _FIELDS)
        R = R_itrf_from_gcrf(*epoch.tt(t_s), *epoch.ut1(t_s))
        box_px = line.box_visible_px or (0, 0, camera.width_px, camera.height_px)
        R_ecef_from_cam = R @ matrix_from_quaternion(q)
        result.append(background(R_ecef_from_cam, R @ r_camera_m, R @ r_sun_m, camera, box_px))
    return result


def background(
    R_ecef_from_cam: FloatArray,
    r_camera_ecef_m: FloatArray,
    r_sun_ecef_m: FloatArray,
    camera: Camera,
    box_px: Sequence[float],
) -> str:
    """Return the one of :data:`BACKGROUNDS` that is behind a box.

    Args:
        R_ecef_from_cam: (3, 3) rotation from camera axes to Earth-fixed axes.
        r_camera_ecef_m, r_sun_ecef_m: (3,) geocentric positions, Earth-fixed axes.
        camera: the camera.
        box_px: x, y, width, height.
    """
    x, y, width, height = box_px
    along = (np.arange(_ACROSS) + 0.5) / _ACROSS
    u, v = np.meshgrid(x - 0.5 + along * width, y - 0.5 + along * height)
    rays = unit(camera.rays(np.stack([u, v], axis=-1).reshape(-1, 2))) @ R_ecef_from_cam.T
    distance_m = entry_distance_m(r_camera_ecef_m, rays)
    met = np.isfinite(distance_m)
    if not met.all():
        return "limb" if met.any() else "space"
    lit = _sun_is_up(r_camera_ecef_m + distance_m[:, None] * rays, r_sun_ecef_m)
    return "Earth by day" if lit > 0.5 else "Earth by night"


def _sun_is_up(points_m: FloatArray, r_sun_m: FloatArray) -> float:
    """Return the share of points (P, 3) on the ellipsoid where the Sun is up; Earth-fixed axes."""
    normals = points_m / SEMI_AXES_M**2
    return float(np.mean(np.sum(normals * (r_sun_m - points_m), axis=1) > 0))


def _scenario_file(dataset: Dataset, line: LabelLine) -> Path | None:
    """Return the scenario that a frame was made from, if the dataset has it."""
    name = SCENARIO
    if line.has("origin"):  # made by 'posse collect', which copies the scenario of each source
        sources = [s for s in dataset.manifest.sources or () if s.dataset == line.origin[0]]
        name = (sources[0].scenario if len(sources) == 1 else None) or ""
    path = inside(dataset.folder, name)
    return path if path.is_file() else None


def _earth_in(scenario: Path) -> bool:
    """Say whether the sky of a scenario has an Earth."""
    try:
        return bool(YamlText.read(scenario).value["sky"]["earth"])
    except (KeyError, TypeError):
        raise InputError(
            f"{scenario}: not a scenario as a run keeps it: sky.earth is missing; make the dataset again"
        ) from None
