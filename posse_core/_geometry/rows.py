"""Points of the spacecraft as the rows of an image see them, each at the row's own time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._geometry.triangles import rotated
from posse_core._model.camera import Camera
from posse_core._model.craft_state import BodyState, CraftState
from posse_core._model.labels import View
from posse_core._model.scene import Scene

_ITERATIONS = 8
"""Most iterations to find the row that sees a point. The remaining error of each is the distance, in
rows, that the point moves within the previous one's error in time."""
_ROW_ERROR = 1e-9
"""Iterations end when none moves a point's row by more than this."""


def seen_by_rows(
    body: BodyState, camera: Camera, x_link_m: FloatArray, link: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Find where points of a body are when the rows of a camera see them.

    Args:
        body: its state at the frame's instant.
        camera: the camera.
        x_link_m: (N, 3) points of one link, in its axes.
        link: number of the link within the body.

    Returns:
        (N, 3) camera axes, and (N,) seconds after the frame's instant. Above and below the image, the
        first and the last row's time applies; where no row can see a point, because it is behind the
        camera or beyond the reach of its lens, the frame's instant.
    """
    after_s = np.zeros(len(x_link_m))
    x_cam_m = body.in_camera(x_link_m, after_s, link)
    for _ in range(_ITERATIONS if camera.line_time_s > 0 else 0):
        before_s = after_s
        after_s = np.nan_to_num(camera.row_after_s(camera.project(x_cam_m)[:, 1]))
        x_cam_m = body.in_camera(x_link_m, after_s, link)
        if np.abs(after_s - before_s).max(initial=0.0) <= _ROW_ERROR * camera.line_time_s:
            break
    return x_cam_m, after_s


def surface_points(
    craft: CraftState, scene: Scene, view: View
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find the points of the bodies that the pixels of a view show.

    Args:
        craft: the state at the frame's instant.
        scene: the bodies, and the view's camera.
        view: of the scene at this state, N of whose pixels show a body.

    Returns:
        (N, 2) positions of the pixels, px, in the order of ``view.hit``; (N, 3) the points in camera
        axes at the time of the pixel's row; (N, 3) the same in the axes of each point's link.
    """
    camera = scene.camera
    uv_px = view.box.pixel_centres_px()[view.hit]
    x_cam_m = camera.rays(uv_px) * view.depth_m[view.hit, None].astype(np.float64)
    first_row = view.box.y0
    # Where all rows are exposed together, one stands for all.
    rows = view.box.height if camera.line_time_s > 0 else 1
    rows_s = camera.row_after_s(np.arange(first_row, first_row + rows, dtype=np.float64))
    row = np.nonzero(view.hit)[0]
    x_link_m = np.empty_like(x_cam_m)
    for body, link, points in by_link(scene, view.part_id[view.hit]):
        R, t = craft.bodies[body].link_poses_after(link, rows_s)
        of_row = row[points] if rows > 1 else slice(0, 1)
        from_origin_m = (x_cam_m[points] - t[of_row]).T
        # R's transposes, as (3, 3, N).
        x_link_m[points] = rotated(R[of_row].T, from_origin_m).T
    return uv_px, x_cam_m, x_link_m


def points_seen_by_rows(
    craft: CraftState, scene: Scene, x_link_m: FloatArray, part_id: IntArray
) -> tuple[FloatArray, FloatArray]:
    """As :func:`seen_by_rows`, of points of any links.

    Args:
        craft: the state at the frame's instant.
        scene: the bodies, and the camera.
        x_link_m: (N, 3) in the axes of each point's link.
        part_id: (N,) part that each is on.
    """
    x_cam_m, after_s = np.empty_like(x_link_m), np.empty(len(x_link_m))
    for body, link, points in by_link(scene, part_id):
        x_cam_m[points], after_s[points] = seen_by_rows(
            craft.bodies[body], scene.camera, x_link_m[points], link
        )
    return x_cam_m, after_s


def by_link(scene: Scene, part_id: IntArray) -> Iterator[tuple[int, int, IntArray]]:
    """Divide N points by the links of their parts (N,): number of the body, number of the link within
    it, and the indices of its points."""
    links = scene.link_of_part[part_id]
    for index in np.unique(links):
        yield *scene.links[index], np.flatnonzero(links == index)
