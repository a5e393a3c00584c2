"""Whether the labelled share of lit pixels is what the mesh leaves to the Sun.

The mesh is seen from the Sun by the rasteriser that proves masks: what a pixel of the frame shows is lit
if it faces the Sun, and nothing is nearer to the Sun on its line.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posse_core._arrays import BoolArray, IntArray
from posse_core._evaluation.case import POSE, Case
from posse_core._evaluation.checks import Check
from posse_core._evaluation.raster import first_hits
from posse_core._model.camera import Camera

LIT_ERROR = 0.05
"""How far a labelled share may be from the mesh's: shadows are drawn in steps of a pixel."""
_SIDE_PX = 256
_DISTANCE = 1e4
"""Of the place from where the Sun's view is drawn, over the spacecraft's size."""
_GRAZING = 1e-3
_MOST_PIXELS = 4096
_LEAST_PIXELS = 50


def _sunlight(case: Case) -> Iterator[str]:
    row, column = np.nonzero(case.target.mask & (case.body_seen == 0))
    if len(row) < _LEAST_PIXELS or case.camera.line_time_s > 0:
        return
    chosen = slice(None, None, max(1, -(-len(row) // _MOST_PIXELS)))
    row, column = row[chosen], column[chosen]
    least, most = (float(lit.mean()) for lit in sunlit(case, row, column))
    said = case.labels.fraction_lit
    if said is None or not least - LIT_ERROR <= said <= most + LIT_ERROR:
        yield f"fraction_lit is {said}, and the Sun lights {least:.2f} to {most:.2f} of it"


def sunlit(case: Case, row: IntArray, column: IntArray) -> tuple[BoolArray, BoolArray]:
    """(N,) whether the Sun surely lights what pixels show, and (N,) whether it may.

    Args:
        case: a frame whose camera exposes all rows at the same time.
        row, column: (N,) pixels in which the mesh is seen.
    """
    sun = case.target.R_cam_from_body @ np.array(case.labels.sun_direction_body)
    rays = case.camera.rays(np.stack([column, row], axis=-1))
    points_m = rays * case.hits.depth_m[row, column, None]
    normal = case.normals_of_faces(case.hits.face[row, column], row)
    cosine = -np.sum(normal * sun, axis=1) * np.sign(np.sum(normal * rays, axis=1))
    # Axes of a camera that looks from the Sun at what the frame shows.
    side = np.cross(sun, np.eye(3)[int(np.abs(sun).argmin())])
    side /= np.linalg.norm(side)
    R_sun_from_cam = np.stack([side, np.cross(-sun, side), -sun])
    vertices_m = case.vertices_m()
    low_m, high_m = vertices_m.min(axis=0), vertices_m.max(axis=0)
    centre_m, radius_m = (low_m + high_m) / 2, float(np.linalg.norm(high_m - low_m)) / 2
    far_m = np.array([0.0, 0.0, _DISTANCE * radius_m])
    focal_px = _SIDE_PX / 2 * _DISTANCE
    middle_px = (_SIDE_PX - 1) / 2
    view = Camera(_SIDE_PX, _SIDE_PX, focal_px, focal_px, middle_px, middle_px, sensor_width_m=1.0)
    seen = first_hits(
        view, (vertices_m - centre_m) @ R_sun_from_cam.T + far_m, case.faces, case.part_of_face
    )
    places_m = (points_m - centre_m) @ R_sun_from_cam.T + far_m
    uv = np.clip(np.nan_to_num(view.project(places_m)).round(), 0, _SIDE_PX - 1).astype(np.int64)
    nearer_m = places_m[:, 2] - seen.depth_m[uv[:, 1], uv[:, 0]]
    pixel_m = 2 * radius_m / _SIDE_PX
    slope = 1 / np.maximum(np.abs(cosine), 0.05)
    surely = (cosine > _GRAZING) & (nearer_m < 0.5 * pixel_m)
    return surely, (cosine > -_GRAZING) & (nearer_m < 2 * pixel_m * slope)


SUNLIGHT = Check(
    "sunlight",
    f"share of lit pixels is what the mesh leaves to the Sun, {LIT_ERROR:.0%}",
    _sunlight,
    ("mask_rle", "fraction_lit", "sun_direction_body", *POSE),
)
"""Check of a frame whose schema is right."""
