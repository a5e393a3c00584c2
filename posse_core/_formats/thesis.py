"""The files of the thesis (Sections 3.2, 3.4.2, 3.4.3 and 3.5), which its tools and networks read.

Where the thesis does not state axes or units, the names of the columns do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from posse_core import _frames as frames
from posse_core._dataset.dataset import Dataset
from posse_core._files.text import text_file, write_csv, write_members
from posse_core._formats.needs import labels_with
from posse_core._interfaces.writer import Writer
from posse_core._model.label_line import LabelLine
from posse_core._model.trajectory import Trajectory

NEEDS_POSE = ("q_cam_from_body", "t_body_cam_m")
NEEDS = (*NEEDS_POSE, "keypoints", "box_visible_px")

POINTS_COLUMNS = (
    *("camera_lvlh_x", "camera_lvlh_y", "camera_lvlh_z", "camera_range_m"),
    *("sun_eci_x_m", "sun_eci_y_m", "sun_eci_z_m"),
    *("q_eci_from_body_w", "q_eci_from_body_x", "q_eci_from_body_y", "q_eci_from_body_z"),
    *("sun_visibility", "solar_flux_w_m2"),
    *("earth_eci_x_m", "earth_eci_y_m", "earth_eci_z_m"),
    *("earth_reflected_w_m2", "earth_rotation_rad"),
)
"""The eight outputs of the thesis' propagator in its order; vectors are relative to the target."""
POSE_COLUMNS = (
    *("camera_body_x_m", "camera_body_y_m", "camera_body_z_m"),
    *("q_body_from_cam_w", "q_body_from_cam_x", "q_body_from_cam_y", "q_body_from_cam_z"),
)


class ThesisWriter(Writer):
    """Writes ``posse/``: ``points.csv``, ``pose_data.csv``, ``annotations.json``, ``dataset.csv``."""

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the four files."""
        out = folder / "posse"
        out.mkdir(exist_ok=True)
        rows_of_points = points_rows(dataset.trajectory, dataset.indices.tolist())
        write_csv(out / "points.csv", POINTS_COLUMNS, rows_of_points)
        poses = ((labels.image, *camera_pose(labels)) for labels in _labels(dataset))
        write_csv(out / "pose_data.csv", ("filename", *POSE_COLUMNS), poses)
        rows = ((labels.image, labels.spacecraft, *camera_pose(labels)) for labels in _labels(dataset))
        write_csv(out / "dataset.csv", ("filename", "spacecraft", *POSE_COLUMNS), rows)
        with text_file(out / "annotations.json") as text:
            text.write('{"keypoints": ')
            write_members(text, ((labels.image, labels.keypoints) for labels in _labels(dataset)))
            text.write(',\n"bounding_box": ')
            write_members(text, ((labels.image, _anchors(labels)) for labels in _labels(dataset)))
            text.write("}\n")
        return [
            out / name for name in ("points.csv", "pose_data.csv", "annotations.json", "dataset.csv")
        ]


def points_rows(trajectory: Trajectory, indices: Iterable[int]) -> Iterator[list[float]]:
    """Yield the rows of ``points.csv`` for these frames."""
    for i in indices:
        r_lvlh_m = frames.R_LVLH_FROM_RTN @ trajectory.r_chaser_rtn_m[i]
        r_target_m = trajectory.r_target_eci_m[i]
        row = [
            *(r_lvlh_m / np.linalg.norm(r_lvlh_m)),
            np.linalg.norm(r_lvlh_m),
            *(trajectory.r_sun_eci_m[i] - r_target_m),
            *trajectory.q_eci_from_body[i],
            trajectory.sun_fraction_target[i],
            trajectory.solar_flux_w_m2[i],
            *(-r_target_m),
            trajectory.earth_albedo_w_m2[i],
            trajectory.earth_rotation_rad[i],
        ]
        yield [float(x) for x in row]


def camera_pose(labels: LabelLine) -> list[float]:
    """Return the camera's position (m) and attitude (scalar first), body axes, as ``POSE_COLUMNS``."""
    R_cam_from_body = frames.matrix_from_quaternion(np.array(labels.q_cam_from_body))
    r_camera_body_m = -R_cam_from_body.T @ np.array(labels.t_body_cam_m)
    w, x, y, z = labels.q_cam_from_body
    return [*r_camera_body_m.tolist(), w, -x, -y, -z]


def _labels(dataset: Dataset) -> Iterator[LabelLine]:
    return labels_with(dataset, "the thesis' format", NEEDS)


def _anchors(labels: LabelLine) -> list[list[float]] | None:
    """Return the top-left and bottom-right pixel of the box; None if the spacecraft is not visible."""
    if labels.box_visible_px is None:
        return None
    x, y, width, height = labels.box_visible_px
    return [[x, y], [x + width - 1, y + height - 1]]
