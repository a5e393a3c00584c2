"""Rendering by the scalar variant, in passes of eight samples a pixel.

In each pass the Sun is one direction, so no sample is spent on finding it; over the passes the
directions fill the Sun's disc evenly, which makes penumbras of the right width for the cost of a hard
shadow. (A disc that emits costs 1.7 times as much; an emitter written in Python would be called for
each ray.) All passes but the first leave out space, where a ray costs a third of one that meets the
craft: they draw the box in bands of rows, each from the first column to the last where the first pass
met something.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter

from posse_core.model.arrays import BoolArray, Float32Array, FloatArray
from posse_core.model.camera import Camera, PixelBox
from posse_core.model.scene import EnvironmentMap, FrameState, RenderRequest
from posse_core.randomness import generator
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.samples import mean_of_samples
from posse_render_mitsuba.world import MITSUBA_FROM_CAM, World, homogeneous, rotation_with_z

SAMPLES_PER_PASS = 8
ROWS_PER_BAND = 32
MARGIN_PX = 4
LEAST_WEIGHT = 1 / 9
"""Of the sky against the Sun, or the other way round, in choosing where to look for light: one
tenth of the samples at least, since what is dark in sum may be bright on the side that is seen."""


class Passes:
    """Draws boxes of one camera's image with the scalar variant, which must be set."""

    LAMPS: Mapping[str, Any] = {
        "sun": {"type": "directional", "irradiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
    }
    """Scene entries that :meth:`draw` needs: a Sun in one direction."""

    def __init__(self, camera: Camera, radius_m: float, options: MitsubaOptions) -> None:
        import mitsuba as mi

        self._camera = camera
        self._radius_m = radius_m
        self._sampler = options.sampler
        self._count = -(-options.spp // SAMPLES_PER_PASS)
        self._integrator = mi.load_dict(
            {"type": "path", "max_depth": options.max_depth, "hide_emitters": True}
        )

    def draw(self, world: World, request: RenderRequest) -> FloatArray:
        """(h, w, 4) radiance and coverage of the request's box."""
        import mitsuba as mi

        frame = request.frame
        random = generator(request.seed, frame.index, "mitsuba")
        if request.environment is not None:
            world.set({"sky.sampling_weight": sky_weight(request.environment, frame)})
        directions = _sun_directions_body(frame, self._count, random.uniform(size=2))
        box = request.box
        total = np.zeros((box.height, box.width, 4))
        passes = np.zeros((box.height, box.width))
        places = [box]
        for number, direction in enumerate(directions):
            turn = homogeneous(rotation_with_z(-direction), np.zeros(3))
            world.set(
                {
                    "sun.to_world": mi.Transform4f(turn),
                    "sun.irradiance.value": mi.Color3f(*map(float, frame.sun_irradiance_rgb_w_m2)),
                }
            )
            for place in places:
                seed = int(random.integers(2**31))
                window = place.within(box)
                image = np.array(
                    mi.render(
                        world.scene,
                        integrator=self._integrator,
                        sensor=self._sensor(frame, place),
                        seed=mi.UInt32(seed),
                        spp=SAMPLES_PER_PASS,
                    )
                )
                good = np.isfinite(image).all(axis=-1)
                total[window] += np.where(good[..., None], image, 0)
                passes[window] += good
            if number == 0:
                places = _bands(total[..., 3] > 0, box)
        return mean_of_samples(total, passes)

    def _sensor(self, frame: FrameState, box: PixelBox) -> Any:
        """A camera whose film is the box."""
        import mitsuba as mi

        camera = self._camera
        rotation = frame.R_cam_from_body.T
        near_m, far_m = _clip_distances_m(float(frame.t_body_cam_m[2]), self._radius_m)
        to_world: Float32Array = homogeneous(rotation @ MITSUBA_FROM_CAM, -rotation @ frame.t_body_cam_m)
        return mi.load_dict(
            {
                "type": "perspective",
                "fov_axis": "x",
                "fov": float(np.degrees(2 * np.arctan(box.width / (2 * camera.fx_px)))),
                "principal_point_offset_x": _offset(camera.cx_px - box.x0, box.width),
                "principal_point_offset_y": _offset(camera.cy_px - box.y0, box.height),
                "near_clip": near_m,
                "far_clip": far_m,
                "to_world": mi.ScalarTransform4f(to_world),
                "sampler": {"type": self._sampler, "sample_count": SAMPLES_PER_PASS},
                "film": {
                    "type": "hdrfilm",
                    "width": box.width,
                    "height": box.height,
                    "pixel_format": "rgba",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},  # any other would make the sums' order, so bits, vary
                },
            }
        )


def _bands(met: BoolArray, box: PixelBox) -> list[PixelBox]:
    """Boxes that hold what a first pass ``met`` (h, w) of the box, and a margin: a sliver of the craft
    that eight samples missed lies beside one that they met."""
    near = maximum_filter(met, 2 * MARGIN_PX + 1, mode="constant")
    bands = []
    for top in range(0, box.height, ROWS_PER_BAND):
        rows = near[top : top + ROWS_PER_BAND]
        columns = np.flatnonzero(rows.any(axis=0))
        if columns.size:
            left, right = int(columns[0]), int(columns[-1]) + 1
            bands.append(PixelBox(box.x0 + left, box.y0 + top, right - left, len(rows)))
    return bands


def _sun_directions_body(frame: FrameState, count: int, shift: FloatArray) -> FloatArray:
    """(count, 3) directions spread evenly over the Sun's disc, moved about by ``shift`` (2,) in 0 … 1.

    Vogel's sunflower (1979): even over the area, and seen along any diameter.
    """
    place = np.arange(count)
    radius = np.sqrt((place + shift[0]) / count) * np.tan(frame.sun_angular_radius_rad)
    angle = np.pi * (3 - np.sqrt(5)) * place + 2 * np.pi * shift[1]
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.ones(count)], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    return np.asarray(local @ rotation_with_z(frame.sun_direction_body).T)


def sky_weight(environment: EnvironmentMap, frame: FrameState) -> float:
    """How often the sky is sampled for each time that the Sun is: as their light is, W/m² each."""
    rows = environment.radiance_rgb.sum(axis=-1, dtype=np.float64).mean(axis=1)
    polar_rad = np.pi * (np.arange(len(rows)) + 0.5) / len(rows)
    sky_w_m2 = float(rows @ np.sin(polar_rad)) * 2 * np.pi**2 / len(rows)
    sun_w_m2 = float(frame.sun_irradiance_rgb_w_m2.sum())
    share = sky_w_m2 / sun_w_m2 if sun_w_m2 > 0 else np.inf
    return float(np.clip(share, LEAST_WEIGHT, 1 / LEAST_WEIGHT))


def _offset(principal_px: float, size_px: int) -> float:
    return -((principal_px + 0.5) / size_px - 0.5)


def _clip_distances_m(z_m: float, radius_m: float) -> tuple[float, float]:
    """Planes before and behind a craft whose origin is at planar depth ``z_m``."""
    nearest = z_m - 1.01 * radius_m
    return max(nearest, 1e-3 * radius_m), max(z_m, 0.0) + 1.01 * radius_m
