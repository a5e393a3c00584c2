"""A picture of a photograph with the spacecraft's lines where its pose puts them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray
from posse_core._detection.draw import Colour, Pen
from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import CraftState
from posse_core._model.labels import View
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._photos.box import box_px
from posse_core._photos.solve import PhotoPose

LONGEST_PX = 1400
"""Longer side of a picture at most."""
_MOST_ENLARGED = 8.0
_MARGIN = 0.15
"""Width of what a picture shows around the spacecraft, as a share of its longer side."""
_CREASE = np.cos(np.radians(25.0))
_LINES: Colour = (80, 255, 255)
_FITS: Colour = (80, 220, 80)
_MISFIT: Colour = (60, 60, 255)
"""Colours, blue-green-red."""


class Overlays:
    """Draws the poses of one spacecraft over photographs of one camera."""

    def __init__(self, craft: Spacecraft, camera: Camera) -> None:
        self._craft, self._camera = craft, camera
        self._caster = RayCaster(Scene(craft, camera))

    def picture(self, photo: AnyArray, solved: PhotoPose) -> AnyArray:
        """The part of a photograph with the spacecraft, its outline and creases by the pose, a cross
        where the pose puts each keypoint that was clicked, and a dot where it was clicked.

        Args:
            photo: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
            solved: with a pose.

        Returns:
            (h, w, 3) uint8, blue-green-red.
        """
        assert solved.pose is not None
        pose = solved.pose
        box = self._shown(solved)
        scale = min(LONGEST_PX / max(box.width, box.height), _MOST_ENLARGED)
        camera = _window(self._camera, box, scale)
        canvas = _resized(photo[box.slices], (camera.width_px, camera.height_px))
        state = CraftState.unlit(pose.R_cam_from_body, pose.t_body_cam_m)
        view = self._caster.through(camera).view(state)
        canvas[view.box.slices][_lines(view)] = _LINES
        pen = Pen(canvas, size_px=800)
        corner = np.array([box.x0, box.y0])
        clicked_px = scale * (solved.points_px - corner + 0.5) - 0.5
        placed_px = clicked_px - scale * solved.residuals_px
        for name, at, placed, fits in zip(
            solved.names, clicked_px, placed_px, pose.inliers, strict=True
        ):
            colour = _FITS if fits else _MISFIT
            pen.cross(placed, _LINES)
            if not fits:
                pen.arrow(at, placed, colour, "")
            pen.point(at, colour)
            u, v = np.round(at).astype(int).tolist()
            pen.words(name, (u + 4 * pen.line_px, v - 4 * pen.line_px), colour)
        return canvas

    def _shown(self, solved: PhotoPose) -> PixelBox:
        """The pixels around the spacecraft and all that was clicked."""
        assert solved.pose is not None
        craft = box_px(solved.pose, self._craft, self._camera)
        u, v = np.floor(solved.points_px + 0.5).astype(int).T.tolist()
        clicked = PixelBox(min(u), min(v), max(u) - min(u) + 1, max(v) - min(v) + 1)
        both = PixelBox.around([craft, clicked])
        return both.grown(1 + round(_MARGIN * max(both.width, both.height)), self._camera)


def _window(camera: Camera, box: PixelBox, scale: float) -> Camera:
    """The camera of a part of the image, with other pixels."""
    return replace(
        camera,
        width_px=max(1, round(scale * box.width)),
        height_px=max(1, round(scale * box.height)),
        fx_px=scale * camera.fx_px,
        fy_px=scale * camera.fy_px,
        cx_px=scale * (camera.cx_px - box.x0 + 0.5) - 0.5,
        cy_px=scale * (camera.cy_px - box.y0 + 0.5) - 0.5,
        line_time_s=0.0,
    )


def _lines(view: View) -> BoolArray:
    """(h, w) pixels of a view's box at the border of the spacecraft or of a part, or at a crease."""
    part_id = view.part_id
    lines = np.zeros(part_id.shape, dtype=bool)
    every, here, there = slice(None), slice(None, -1), slice(1, None)
    for one, other in (((here, every), (there, every)), ((every, here), (every, there))):
        differs = part_id[one] != part_id[other]
        both = (part_id[one] >= 0) & (part_id[other] >= 0)
        cosine = (view.normal_cam[one] * view.normal_cam[other]).sum(axis=-1)
        differs |= both & (cosine < _CREASE)
        lines[one] |= differs & (part_id[one] >= 0)
        lines[other] |= differs & (part_id[one] < 0)
    return lines


def _resized(photo: AnyArray, size: tuple[int, int]) -> AnyArray:
    """(h, w, 3) uint8, blue-green-red, of another size (w, h)."""
    small = (photo // 257).astype(np.uint8) if photo.dtype == np.uint16 else photo
    way = cv2.INTER_AREA if size[0] < small.shape[1] else cv2.INTER_LINEAR
    small = cv2.resize(small, size, interpolation=way)
    code = cv2.COLOR_GRAY2BGR if small.ndim == 2 else cv2.COLOR_RGB2BGR
    return np.asarray(cv2.cvtColor(small, code))
