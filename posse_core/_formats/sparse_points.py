"""Points on a spacecraft's surface with the images that show them: a sparse model, made by geometry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.mesh import Mesh
from posse_core._formats.images import eight_bit
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import Triangles
from posse_core._model.label_line import LabelLine

POINTS = 4096
"""Number of points on the surface. Those that fewer than two images show are left out."""
_HIDDEN_SHARE = 1e-6
"""How far behind the surface that its ray meets a point counts as hidden, as a share of the spacecraft's
size."""
_STEP_U, _STEP_V = 0.7548776662466927, 0.5698402909980532
"""Steps of Roberts' sequence R₂ (2018), 1/g and 1/g² with g³ = g + 1: it fills a square evenly."""


@dataclass(frozen=True)
class SparsePoints:
    """P points, each shown by at least two of F images.

    Attributes:
        x_body_m: (P, 3) body axes.
        color_rgb: (P, 3) uint8, the mean of the pixels that show the point.
        shown_bits: (F, ⌈P/8⌉) uint8: whether an image shows a point, eight points to a byte.
    """

    x_body_m: FloatArray
    color_rgb: AnyArray
    shown_bits: AnyArray

    def shown(self, image: int) -> BoolArray:
        """(P,) whether an image shows each point."""
        return np.unpackbits(self.shown_bits[image], count=len(self.x_body_m)).astype(bool)

    def tracks(self) -> Iterator[tuple[IntArray, IntArray]]:
        """Yield for each point the images that show it, and its position among the points of each."""
        before = np.zeros(len(self.shown_bits), dtype=np.int64)
        for eight in range(self.shown_bits.shape[1]):
            shown = np.unpackbits(self.shown_bits[:, eight, None], axis=1)
            for column in shown.T[: len(self.x_body_m) - 8 * eight]:
                images = np.flatnonzero(column)
                yield images, before[images]
                before[images] += 1


def sparse_points(dataset: Dataset, positions: Sequence[int]) -> SparsePoints:
    """Find the points on the spacecraft that frames of it show, by exact rays.

    Args:
        dataset: the dataset, with poses.
        positions: of frames that show one spacecraft.

    Raises:
        InputError: An image cannot be read.
    """
    mesh = dataset.mesh(dataset[positions[0]].spacecraft)
    x_body_m = surface_points(mesh, POINTS)
    sight = _Sight(dataset, mesh)
    total_rgb, images = np.zeros((POINTS, 3)), np.zeros(POINTS, dtype=np.int64)
    rows = []
    for position in positions:
        labels = dataset[position]
        uv_px, shown = sight.of(labels, x_body_m)
        rows.append(np.packbits(shown))
        images += shown
        column, row = np.rint(uv_px[shown]).astype(int).T
        pixels = eight_bit(dataset.image(position))[row, column]
        total_rgb[shown] += pixels if pixels.ndim == 2 else pixels[:, None]
    kept = images >= 2
    return SparsePoints(
        x_body_m=x_body_m[kept],
        color_rgb=np.rint(total_rgb[kept] / images[kept, None]).astype(np.uint8),
        shown_bits=np.stack([np.packbits(np.unpackbits(row, count=POINTS)[kept]) for row in rows]),
    )


def surface_points(mesh: Mesh, count: int) -> FloatArray:
    """(count, 3) points inside the mesh's triangles, spread evenly over its area; the same in each
    call."""
    corners_m = mesh.vertices_body_m[mesh.faces]
    a, b = corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0]
    area = np.cumsum(np.linalg.norm(np.cross(a, b), axis=1))
    number = np.arange(count)
    triangle = np.searchsorted(area, (number + 0.5) / count * area[-1])
    u, v = (0.5 + number * _STEP_U) % 1, (0.5 + number * _STEP_V) % 1
    mirrored = u + v > 1
    u, v = np.where(mirrored, 1 - u, u)[:, None], np.where(mirrored, 1 - v, v)[:, None]
    return np.asarray(corners_m[triangle, 0] + u * a[triangle] + v * b[triangle])


class _Sight:
    """Which points of one spacecraft an image shows."""

    def __init__(self, dataset: Dataset, mesh: Mesh) -> None:
        self._camera = dataset.camera
        self._vertices_body_m = mesh.vertices_body_m
        low, high = mesh.vertices_body_m.min(axis=0), mesh.vertices_body_m.max(axis=0)
        corners_body_m = mesh.vertices_body_m[mesh.faces]
        self._tracer = Tracer(Triangles.of_corners(corners_body_m, mesh.part_id, np.stack([low, high])))

    def of(self, labels: LabelLine, x_body_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(P, 2) positions in the image, px, and (P,) whether it shows the points."""
        R, t = frames.matrix_from_quaternion(np.array(labels.q_cam_from_body)), labels.t_body_cam_m
        x_cam_m = x_body_m @ R.T + t
        uv_px = self._camera.project(x_cam_m)
        size_px = np.array([self._camera.width_px, self._camera.height_px])
        inside = np.flatnonzero(((uv_px >= -0.5) & (uv_px < size_px - 0.5)).all(axis=1))
        triangles = self._tracer.triangles
        nearest_m = float((self._vertices_body_m @ R[2]).min()) + t[2]
        start_m = max(0.0, nearest_m - 0.01 * triangles.size_m)
        camera_m = -R.T @ np.array(t) - triangles.centre_body_m
        rays = (x_cam_m[inside] / x_cam_m[inside, 2:]) @ R
        _, z_m = self._tracer.first(camera_m[:, None], np.ascontiguousarray(rays.T), start_m)
        behind_m = (x_cam_m[inside, 2] - z_m) * np.linalg.norm(rays, axis=1)
        shown = np.zeros(len(x_body_m), dtype=bool)
        shown[inside] = behind_m < _HIDDEN_SHARE * triangles.size_m
        if labels.has("bodies"):  # one of which may be before the spacecraft
            column, row = np.rint(uv_px[shown]).astype(int).T
            shown[shown] = labels.mask_rle.mask()[row, column]
        return uv_px, shown
