"""Images of the spacecraft at a pose, by a renderer that is kept open for each size of images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import CraftState
from posse_core._model.hull import hull_points
from posse_core._model.scene import EnvironmentMap, RenderRequest, Scene
from posse_core._model.spacecraft import Part, Spacecraft, is_plain
from posse_core._refinement.placement import Placement
from posse_core._refinement.simplified import simplified
from posse_core._scenario.component import ComponentChoice

_SUN_RADIUS_RAD = 0.00465
_FORWARD = np.array([0.0, 0.0, -1.0])
_SKY_HEIGHT = 16
_STEP = 0.05
"""Slopes of the sky are rounded to this, so that drawings of one light share a map."""
EVEN = (0.0, 0.0, 0.0)
"""The slope of an even sky."""


@dataclass(frozen=True)
class Lights:
    """What shines on the spacecraft.

    Attributes:
        sun: what a white plate that faces the Sun returns, as a share of white in the image.
        sky: what a white plate under an even sky returns.
        sun_direction_cam: (3,) unit vector from the spacecraft to the Sun, camera axes.
        sky_slope: from where the sky shines more: its radiance is as 1 + slope · direction, in camera
            axes, and not below 0.
    """

    sun: float
    sky: float
    sun_direction_cam: FloatArray
    sky_slope: tuple[float, float, float] = EVEN


@dataclass(frozen=True)
class Drawn:
    """What is seen of the spacecraft in a box.

    Attributes:
        bright: (h, w) linear brightness; the share that the spacecraft does not cover is black.
        coverage: (h, w) share of the pixel that it covers.
        depth_m: (h, w) planar z, NaN off the spacecraft.
    """

    bright: Float32Array
    coverage: Float32Array
    depth_m: Float32Array


def scaled(camera: Camera, scale: float) -> Camera:
    """The pinhole with the camera's matrix, its images so much larger."""
    return replace(
        camera,
        width_px=round(camera.width_px * scale),
        height_px=round(camera.height_px * scale),
        fx_px=camera.fx_px * scale,
        fy_px=camera.fy_px * scale,
        cx_px=(camera.cx_px + 0.5) * scale - 0.5,
        cy_px=(camera.cy_px + 0.5) * scale - 0.5,
        line_time_s=0.0,
        distortion=None,
    )


class Studio:
    """Draws the spacecraft of a setting.

    Attributes:
        camera: that takes the images.
        images: number of images drawn so far.
        hull_m: (H, 3) those of the spacecraft's vertices that are on its convex hull.
        knows_materials: whether the spacecraft's materials are those of its mesh, and not grey for want
            of any.
    """

    def __init__(self, setting: RefinerSetting, renderer: ComponentChoice) -> None:
        self._setting, self._choice = setting, renderer
        self.camera = setting.camera
        self._open: dict[float, Renderer] = {}
        self._craft = _merged(setting.spacecraft)
        parts = setting.spacecraft.parts
        self.hull_m = hull_points(np.concatenate([part.vertices_body_m for part in parts]))
        self.images = 0
        self.knows_materials = not any(map(is_plain, setting.spacecraft.materials.values()))

    def draw(self, scale: float, box: PixelBox, placement: Placement, lights: Lights) -> Drawn:
        """Draw a box of the image at a scale."""
        if scale not in self._open:
            camera = scaled(self._setting.camera, scale)
            name, options = self._choice.name, self._choice.options
            self._open[scale] = self._setting.renderer(name, options, Scene(self._craft, camera))
        # The sky is as bright always, as renderers keep what they make of it; drawings are dimmed.
        level = lights.sky if lights.sky > 0 else 1.0
        craft = CraftState(
            R_cam_from_body=placement.R_cam_from_body,
            t_body_cam_m=placement.t_body_cam_m,
            sun_direction_cam=lights.sun_direction_cam,
            sun_irradiance_rgb_w_m2=np.full(3, np.pi * lights.sun / level / 3),
            sun_angular_radius_rad=_SUN_RADIUS_RAD,
        )
        x, y, z = (round(slope / _STEP) for slope in lights.sky_slope)
        sky = _sky(x, y, z) if lights.sky > 0 else None
        light = self._open[scale].render(RenderRequest(craft, box, sky, 0))
        self.images += 1
        depth_m = light.depth_m
        if depth_m is None:
            depth_m = np.where(
                light.coverage > 0, np.float32(placement.t_body_cam_m[2]), np.float32(np.nan)
            )
        bright = np.asarray(np.float32(level) * light.radiance_rgb.sum(axis=-1), np.float32)
        return Drawn(bright, light.coverage, depth_m)

    def shape(self, scale: float, box: PixelBox, placement: Placement) -> Drawn:
        """The same under an even sky alone, so that nothing is in shadow."""
        return self.draw(scale, box, placement, Lights(0.0, 1.0, _FORWARD))

    def close(self) -> None:
        """Close the renderers."""
        for renderer in self._open.values():
            renderer.close()
        self._open.clear()


@lru_cache(maxsize=64)
def _sky(x: int, y: int, z: int) -> EnvironmentMap:
    """The sky with a slope in steps."""
    brighter = EnvironmentMap.directions_cam(_SKY_HEIGHT) @ np.array([x, y, z])
    radiance = np.maximum(0, 1 + _STEP * brighter) / 3
    return EnvironmentMap(np.repeat(radiance[..., None], 3, axis=2).astype(np.float32))


def _merged(craft: Spacecraft) -> Spacecraft:
    """The same spacecraft with one part for each material and not too many triangles, which is drawn
    sooner."""
    parts = []
    for key in craft.materials:
        own = [part for part in craft.parts if part.material == key]
        if own:
            firsts = np.cumsum([0, *(len(part.vertices_body_m) for part in own)])[:-1]
            pairs = zip(own, firsts, strict=True)
            parts.append(
                Part(
                    key,
                    np.concatenate([part.vertices_body_m for part in own]),
                    np.concatenate([part.faces + first for part, first in pairs]),
                    np.concatenate([part.normals_body for part in own]),
                    np.concatenate([part.uv for part in own]),
                    key,
                )
            )
    return replace(craft, parts=simplified(parts, craft.radius_m))
