"""The picture that a thermal camera sees: what side of which facet is in each pixel, and its
radiance."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import Float32Array, FloatArray, IntArray
from posse_core._geometry.triangles import dot, rotated
from posse_core._interfaces.look import Look
from posse_core._model.camera import Camera, PixelBox
from posse_core._sensors.thermal.background import background_w_m2_sr
from posse_core._sensors.thermal.facets import Facets
from posse_core._sensors.thermal.planck import Band

_ROWS = 64
"""Rows of the image that are computed at once, to save memory."""


def sides_seen(look: Look, facets: Facets, camera: Camera, uv_px: FloatArray) -> IntArray:
    """The sides (2N of :class:`Facets`) that rays hit: (..., 2) image positions → (...), −1 off the
    craft.

    Each row is seen at its own time.
    """
    hits = look.rays(
        camera.rays(uv_px).reshape(-1, 3), after_s=camera.row_after_s(uv_px[..., 1]).reshape(-1)
    )
    on = np.flatnonzero(hits.hit)
    triangle = facets.triangle_of_face[hits.triangle[on]]
    centre_body_m = facets.triangles.centre_body_m
    point_m = np.ascontiguousarray((hits.point_body_m[on] - centre_body_m).T)
    normal = rotated(
        look.state.craft.R_cam_from_body, np.take(facets.triangles.normal, triangle, axis=1)
    )
    behind = dot(normal, hits.normal[on].T) < 0
    side = np.full(len(hits.triangle), -1)
    side[on] = facets.bisection.at(triangle, point_m) + facets.count * behind
    return side.reshape(uv_px.shape[:-1])


def true_temperature_k(
    look: Look, facets: Facets, camera: Camera, temperature_k: FloatArray
) -> Float32Array:
    """(H, W) temperature at the centres of the pixels, from those of the facets (N,); NaN off the
    craft."""
    image_k = np.full((camera.height_px, camera.width_px), np.nan, dtype=np.float32)
    box = look.view(camera).box
    if not box.is_empty:
        side = sides_seen(look, facets, camera, box.pixel_centres_px())
        image_k[box.slices] = np.where(side >= 0, temperature_k[side % facets.count], np.nan)
    return image_k


def radiance_w_m2_sr(
    look: Look, facets: Facets, camera: Camera, sides_w_m2_sr: FloatArray, band: Band, samples: int
) -> Float32Array:
    """(H, W) radiance of craft and background, the mean of ``samples`` × ``samples`` rays in each pixel.

    Args:
        sides_w_m2_sr: (2N,) radiance of the facets' sides in the band.
    """
    height, width = camera.height_px, camera.width_px
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    offsets_px = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    box = look.view(camera).box
    image = np.empty((height, width), dtype=np.float32)
    for top in range(0, height, _ROWS):
        rows = PixelBox(0, top, width, min(_ROWS, height - top))
        samples_px = rows.pixel_centres_px()[:, :, None, :] + offsets_px
        light = background_w_m2_sr(camera.rays(samples_px), look.state, band)
        inside = box.within_rows(top, rows.height)
        if not inside.is_empty:
            within = inside.within(rows)
            side = sides_seen(look, facets, camera, samples_px[within])
            light[within] = np.where(side >= 0, sides_w_m2_sr[side], light[within])
        image[top : top + rows.height] = light.mean(axis=-1)
    return image
