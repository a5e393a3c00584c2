"""COLMAP: cameras, poses and sparse points of a static world, as text (Schönberger and Frahm 2016;
https://colmap.github.io/format.html).

COLMAP's world is the spacecraft: its axes are the body axes. Camera axes are OpenCV's, as in POSSE. The
centre of the top-left pixel is (0.5, 0.5), so half a pixel is added to every position in the image.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_image
from posse_core._errors import InputError
from posse_core._files.reading import read_text
from posse_core._files.text import text_file
from posse_core._formats.exported import ExportedBody, ExportedImage
from posse_core._formats.sparse_points import SparsePoints, sparse_points
from posse_core._formats.static_world import frames_by_spacecraft, write_images
from posse_core._interfaces.writer import Writer
from posse_core._model.camera import Camera
from posse_core._model.label_line import BodyLabels

PIXEL_CENTRE = 0.5
"""Position of the centre of the first pixel."""
CAMERA_ID = 1
REPROJECTION_ERROR_PX = 1e-3
"""How far an observation may be from its point's projection, px."""
_DIGITS_PX = 6
"""Decimal places of a position in the image."""


class ColmapWriter(Writer):
    """Writes a folder ``colmap/NAME`` for each spacecraft: ``images/``, ``masks/`` and ``sparse/0/``.

    The id of an image is the index of its frame plus one, because COLMAP's ids begin at 1.
    """

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the folder ``colmap``.

        Raises:
            InputError: The camera has a rolling shutter, or a frame lacks a label.
        """
        for name, positions in frames_by_spacecraft(dataset, "COLMAP").items():
            out = folder / "colmap" / name
            write_images(dataset, positions, out, mask_suffix=".png")
            model = out / "sparse" / "0"
            model.mkdir(parents=True)
            points = sparse_points(dataset, positions)
            with text_file(model / "cameras.txt") as text:
                text.write(_camera_line(dataset.camera))
            with text_file(model / "images.txt") as text:
                text.writelines(_image_lines(dataset, positions, points))
            with text_file(model / "points3D.txt") as text:
                text.writelines(_point_lines(dataset, positions, points))
        return [folder / "colmap"]


def _camera_line(camera: Camera) -> str:
    model, parameters = _camera_model(camera)
    return _line(CAMERA_ID, model, camera.width_px, camera.height_px, *parameters)


def _camera_model(camera: Camera) -> tuple[str, list[float]]:
    """Return the simplest of COLMAP's camera models that describes a camera, and its parameters."""
    principal_px = camera.cx_px + PIXEL_CENTRE, camera.cy_px + PIXEL_CENTRE
    pinhole = [camera.fx_px, camera.fy_px, *principal_px]
    if camera.distortion is None:
        return "PINHOLE", pinhole
    coefficients = camera.distortion.coefficients.tolist()
    if camera.distortion.model == "fisheye":
        return "OPENCV_FISHEYE", [*pinhole, *coefficients]
    if not any(coefficients[4:]):
        return "OPENCV", [*pinhole, *coefficients[:4]]
    return "FULL_OPENCV", [*pinhole, *coefficients, *[0.0] * (8 - len(coefficients))]


def _image_lines(dataset: Dataset, positions: Sequence[int], points: SparsePoints) -> Iterator[str]:
    """Yield two lines for each image: its pose, and its points."""
    ids = np.arange(1, len(points.x_body_m) + 1)
    for image, position in enumerate(positions):
        labels, shown = dataset[position], points.shown(image)
        pose = (*labels.q_cam_from_body, *labels.t_body_cam_m)
        yield _line(labels.index + 1, *pose, CAMERA_ID, Path(labels.image).name)
        x_cam_m = _in_camera(labels, points.x_body_m[shown])
        uv_px = (dataset.camera.project(x_cam_m) + PIXEL_CENTRE).round(_DIGITS_PX)
        seen = zip(uv_px[:, 0].tolist(), uv_px[:, 1].tolist(), ids[shown].tolist(), strict=True)
        yield _line(*(number for observation in seen for number in observation))


def _point_lines(dataset: Dataset, positions: Sequence[int], points: SparsePoints) -> Iterator[str]:
    image_ids = dataset.indices[list(positions)] + 1
    each = zip(points.x_body_m.tolist(), points.color_rgb.tolist(), points.tracks(), strict=True)
    for id_, (x_body_m, color_rgb, (images, places)) in enumerate(each, 1):
        track = np.stack([image_ids[images], places], axis=1).ravel().tolist()
        yield _line(id_, *x_body_m, *color_rgb, 0, *track)


def _line(*words: object) -> str:
    return " ".join(map(str, words)) + "\n"


def _in_camera(labels: BodyLabels, x_body_m: FloatArray) -> FloatArray:
    R = frames.matrix_from_quaternion(np.array(labels.q_cam_from_body))
    return np.asarray(x_body_m @ R.T + np.array(labels.t_body_cam_m))


def read_colmap(folder: Path, camera: Camera) -> Iterator[ExportedImage]:
    """Read the pose and the mask of every image of a folder ``colmap``.

    Raises:
        InputError: A camera is not that of the dataset, or an observation is not where the image's pose
            projects its point.
    """
    for scene in sorted(path for path in folder.iterdir() if path.is_dir()):
        model = scene / "sparse" / "0"
        if read_text(model / "cameras.txt") != _camera_line(camera):
            raise InputError(f"{model / 'cameras.txt'}: is not the dataset's camera")
        rows = (line.split() for line in read_text(model / "points3D.txt").splitlines())
        x_body_m = {int(row[0]): [float(x) for x in row[1:4]] for row in rows}
        lines = iter(read_text(model / "images.txt").splitlines())
        for pose, observations in zip(lines, lines, strict=True):
            _, *numbers, _, name = pose.split()
            qw, qx, qy, qz, tx, ty, tz = map(float, numbers)
            labels = BodyLabels(
                spacecraft=scene.name,
                q_cam_from_body=(qw, qx, qy, qz),
                t_body_cam_m=(tx, ty, tz),
            )
            off_px = _off_px(observations.split(), labels, camera, x_body_m)
            if off_px > REPROJECTION_ERROR_PX:
                raise InputError(
                    f"{model / 'images.txt'}: a point of {name} is {off_px:.3g} px from its projection"
                )
            mask = read_image(scene / "masks" / f"{name}.png") > 0
            yield ExportedImage(f"images/{name}", [ExportedBody(labels, mask)])


def _off_px(
    words: Iterable[str], labels: BodyLabels, camera: Camera, x_body_m: dict[int, list[float]]
) -> float:
    """Return the largest distance of an image's observations from the projections of their points."""
    seen = np.array(list(words), dtype=np.float64).reshape(-1, 3)
    if not len(seen):
        return 0.0
    x_cam_m = _in_camera(labels, np.array([x_body_m[int(id_)] for id_ in seen[:, 2]]))
    off_px = np.linalg.norm(camera.project(x_cam_m) + PIXEL_CENTRE - seen[:, :2], axis=1)
    return float(np.nan_to_num(off_px, nan=np.inf).max())
