"""Rendering by the scalar variant, in passes of sixteen samples a pixel.

In each pass the Sun is one direction, so no sample is spent on finding it; over the passes the
directions fill the Sun's disc evenly, which makes penumbras of the right width for the cost of a hard
shadow. (A disc that emits costs 1.7 times as much; an emitter written in Python would be called for
each ray.)

The first pass draws the box; the second one the tiles of it in which the first met the craft; the
others those that are worth it by what the first two differ in.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter

from posse_core import (
    BoolArray,
    Camera,
    CraftState,
    Float32Array,
    FloatArray,
    PixelBox,
    R_with_z,
    RenderRequest,
    random_generator,
)
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.samples import MOST_ROUNDS, allot, mean_of_samples
from posse_render_mitsuba.world import (
    MITSUBA_FROM_CAM,
    World,
    homogeneous,
    near_plane_m,
)

SAMPLES_PER_PASS = 16
TILE_PX = 32
MARGIN_PX = 4
BLOCK_PX = 8
"""Of a block that one thread draws. Mitsuba's own choice depends on their number, and the random numbers
on the block."""
R2: FloatArray = 1.32471795724474602596 ** -np.array([1.0, 2.0])  # the plastic number's powers
SKY_WEIGHT = 9.0
"""Of the sky against a Sun that does not shine, in choosing where to look for light. While it shines
the sky is not looked for: paths find it."""


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
            {
                "type": "path",
                "max_depth": options.max_depth,
                "hide_emitters": True,
                "block_size": BLOCK_PX,
            }
        )

    def draw(self, world: World, request: RenderRequest) -> FloatArray:
        """(h, w, 4) radiance and coverage of the request's box."""
        craft, box = request.craft, request.box
        sun_w_m2 = float(craft.sun_irradiance_rgb_w_m2.sum())
        if request.environment is not None:
            world.set({"sky.sampling_weight": 0.0 if sun_w_m2 > 0 else SKY_WEIGHT})
        random = random_generator(request.seed, request.index, "mitsuba")
        shift = random.uniform(size=2)
        total = first = self._pass(world, request, 0, [box], shift, random)
        tiles = _tiles(first[..., 3] > 0, box)
        passes = np.full(len(tiles), min(self._count, 2))
        number = 1
        while (more := passes > number).any():
            places = [tiles[place] for place in np.flatnonzero(more)]
            image = self._pass(world, request, number, places, shift, random)
            total = total + image
            if number == 1:
                windows = [tile.within(box) for tile in tiles]
                deviation = _deviation(first, image, sun_w_m2 / np.pi, windows)
                passes = allot(deviation, self._count, least=2, most=MOST_ROUNDS * self._count)
            number += 1
        return mean_of_samples(total[..., :4], total[..., 4])

    def _pass(
        self,
        world: World,
        request: RenderRequest,
        number: int,
        places: Iterable[PixelBox],
        shift: FloatArray,
        random: np.random.Generator,
    ) -> FloatArray:
        """(h, w, 5) of the request's box: radiance, coverage and 1 in the places, where finite."""
        import mitsuba as mi

        craft, box = request.craft, request.box
        turn = homogeneous(R_with_z(-sun_direction_body(craft, number, shift)), np.zeros(3))
        world.set(
            {
                "sun.to_world": mi.Transform4f(turn),
                "sun.irradiance.value": mi.Color3f(*map(float, craft.sun_irradiance_rgb_w_m2)),
            }
        )
        result = np.zeros((box.height, box.width, 5))
        for place in places:
            image = mi.render(
                world.scene,
                integrator=self._integrator,
                sensor=self._sensor(craft, place),
                seed=mi.UInt32(int(random.integers(2**31))),
                spp=SAMPLES_PER_PASS,
            )
            values = np.insert(np.array(image, dtype=np.float64), 4, 1.0, axis=-1)
            good = np.isfinite(values).all(axis=-1, keepdims=True)
            result[place.within(box)] = np.where(good, values, 0)
        return result

    def _sensor(self, craft: CraftState, box: PixelBox) -> Any:
        """A camera whose film is the box."""
        import mitsuba as mi

        camera = self._camera
        rotation = craft.R_cam_from_body.T
        near_m, far_m = _clip_distances_m(float(craft.t_body_cam_m[2]), self._radius_m)
        to_world: Float32Array = homogeneous(rotation @ MITSUBA_FROM_CAM, -rotation @ craft.t_body_cam_m)
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


def _tiles(met: BoolArray, box: PixelBox) -> list[PixelBox]:
    """Those that hold what a first pass ``met`` (h, w) of the box, and a margin: a sliver of the craft
    that sixteen samples missed lies beside one that they met."""
    near = maximum_filter(met, 2 * MARGIN_PX + 1, mode="constant")
    tiles = []
    for top in range(0, box.height, TILE_PX):
        for left in range(0, box.width, TILE_PX):
            part = near[top : top + TILE_PX, left : left + TILE_PX]
            if part.any():
                tiles.append(PixelBox(box.x0 + left, box.y0 + top, part.shape[1], part.shape[0]))
    return tiles


def _deviation(
    first: FloatArray, second: FloatArray, white: float, windows: Sequence[tuple[slice, slice]]
) -> FloatArray:
    """(n,) standard deviation of a pass in each window: root mean square over its pixels, of radiance
    summed over the bands up to ``white``, since brighter is a glint of few pixels, which would have all.

    Args:
        first: (h, w, 5), and ``second``, of two passes.
    """
    one, other = (np.minimum(image[..., :3].sum(axis=-1), white) for image in (first, second))
    squares = (one - other) ** 2 / 2
    return np.sqrt([squares[window].mean() for window in windows])


def sun_direction_body(craft: CraftState, number: int, shift: FloatArray) -> FloatArray:
    """(3,) direction of a pass to the Sun's disc, which the first ones, however many, fill evenly.

    Roberts' sequence R2 (2018) in the unit square, moved about by ``shift`` (2,) in 0 … 1.
    """
    across, around = (shift + number * R2) % 1
    radius, angle = np.sqrt(across) * np.tan(craft.sun_angular_radius_rad), 2 * np.pi * around
    local = np.array([radius * np.cos(angle), radius * np.sin(angle), 1.0])
    return np.asarray(R_with_z(craft.sun_direction_body) @ (local / np.linalg.norm(local)))


def _offset(principal_px: float, size_px: int) -> float:
    return -((principal_px + 0.5) / size_px - 0.5)


def _clip_distances_m(z_m: float, radius_m: float) -> tuple[float, float]:
    """Planes before and behind a craft whose origin is at planar depth ``z_m``."""
    return near_plane_m(z_m, radius_m), max(z_m, 0.0) + 1.01 * radius_m
