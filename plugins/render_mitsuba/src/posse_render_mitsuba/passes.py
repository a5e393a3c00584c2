"""Rendering by Mitsuba's scalar variant, in passes of sixteen samples per pixel.

In each pass the Sun is a directional light, so no samples are spent on finding it. Over the passes its
directions fill the Sun's disc evenly, which gives penumbras of the right width at the cost of hard
shadows. (An emitting disc costs 1.7 times as much, and an emitter written in Python would be called once
per ray.)

The first pass renders the whole box. The second renders the tiles of it in which the first pass hit the
spacecraft. The difference between these two estimates the noise of each tile, and the remaining passes
are distributed over the tiles accordingly.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import maximum_filter

from posse_core import (
    BoolArray,
    CraftState,
    EnvironmentMap,
    Float32Array,
    FloatArray,
    PixelBox,
    R_with_z,
    RenderRequest,
    Scene,
    random_generator,
)
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.samples import MAX_ROUNDS_FACTOR, allot, mean_of_samples
from posse_render_mitsuba.world import (
    MITSUBA_FROM_CAM,
    Place,
    World,
    homogeneous,
)

if TYPE_CHECKING:
    from posse_render_mitsuba.finishes import Finishing

SAMPLES_PER_PASS = 16
TILE_PX = 32
MARGIN_PX = 4
BLOCK_PX = 8
"""Side of the blocks that the threads render. It is fixed because Mitsuba's default depends on the
number of threads, and the random numbers of a pixel depend on its block."""
R2: FloatArray = 1.32471795724474602596 ** -np.array([1.0, 2.0])  # powers of the plastic number
SKY_WEIGHT = 9.0
"""Sampling weight of the sky in eclipse; the Sun, which then sends no light, has weight 1. In sunlight
the sky's weight is 0: only paths that leave the spacecraft by chance find it."""


class Passes:
    """Renders pixel boxes of one camera's image. The scalar variant must be set beforehand."""

    def __init__(self, scene: Scene, options: MitsubaOptions) -> None:
        import mitsuba as mi

        from posse_render_mitsuba.bsdfs import bsdfs

        self._scene = scene
        self._bsdfs = bsdfs(scene)
        self._finishings: dict[int, Finishing] = {}
        self._worlds: dict[tuple[int, ...] | None, World] = {}
        self._camera = scene.camera
        self._count = -(-options.spp // SAMPLES_PER_PASS)
        self._integrator = mi.load_dict(
            {
                "type": "path",
                "max_depth": options.max_depth,
                "hide_emitters": True,
                "block_size": BLOCK_PX,
            }
        )

    def draw(self, place: Place, request: RenderRequest) -> FloatArray:
        """(h, w, 4) radiance in three bands, W m⁻² sr⁻¹, and coverage of the request's box."""
        craft, box = request.craft, request.box
        sun_w_m2 = float(craft.sun_irradiance_rgb_w_m2.sum())
        world = self._world(request.environment)
        world.move(place.poses)
        self._finish(craft)
        if request.environment is not None:
            world.set_environment(request.environment, place.poses)
            world.set({"sky.sampling_weight": 0.0 if sun_w_m2 > 0 else SKY_WEIGHT})
        random = random_generator(request.seed, request.index, "mitsuba")
        shift = random.uniform(size=2)
        total = first = self._pass(world, place, request, 0, [box], shift, random)
        tiles = _tiles(first[..., 3] > 0, box)
        passes = np.full(len(tiles), min(self._count, 2))
        index = 1
        while (more := passes > index).any():
            image = self._pass(
                world, place, request, index, [tiles[i] for i in np.flatnonzero(more)], shift, random
            )
            total = total + image
            if index == 1:
                windows = [tile.within(box) for tile in tiles]
                deviation = _deviation(first, image, sun_w_m2 / np.pi, windows)
                passes = allot(deviation, self._count, least=2, most=MAX_ROUNDS_FACTOR * self._count)
            index += 1
        return mean_of_samples(total[..., :4], total[..., 4])

    def _world(self, environment: EnvironmentMap | None) -> World:
        """The scene without a sky, or with one of the environment's size."""
        from posse_render_mitsuba.craft import fixed_shapes

        kind = None if environment is None else environment.radiance_rgb.shape
        if kind not in self._worlds:
            sun = {"type": "directional", "irradiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
            shapes = fixed_shapes(self._scene, lambda piece: self._bsdfs[id(piece.material)])
            self._worlds[kind] = World(self._scene, shapes, {"sun": sun}, environment)
        return self._worlds[kind]

    def _finish(self, craft: CraftState) -> None:
        """Give the materials that vary the factors and patterns of a frame."""
        from posse_render_mitsuba.finishes import PLAIN, Finishing

        now = {}
        finishes = self._scene.finishes(craft)
        for piece, finish in zip(self._scene.pieces, finishes, strict=True):
            key = id(piece.material)
            if finish is not None:
                now[key] = finish
                if key not in self._finishings:
                    self._finishings[key] = Finishing(self._bsdfs[key], piece.material)
        for key, finishing in self._finishings.items():
            finishing.set(now.get(key, PLAIN))

    def _pass(
        self,
        world: World,
        place: Place,
        request: RenderRequest,
        index: int,
        tiles: Iterable[PixelBox],
        shift: FloatArray,
        random: np.random.Generator,
    ) -> FloatArray:
        """Render tiles of the request's box once; ``index`` is that of the pass, from 0.

        Returns:
            (h, w, 5) for the whole box: radiance (three bands), coverage, and 1 in those pixels of the
            tiles whose values are finite; 0 elsewhere.
        """
        import mitsuba as mi

        craft, box = request.craft, request.box
        sun_to_world = homogeneous(R_with_z(-sun_direction_body(craft, index, shift)), np.zeros(3))
        world.set(
            {
                "sun.to_world": mi.Transform4f(sun_to_world),
                "sun.irradiance.value": mi.Color3f(*map(float, craft.sun_irradiance_rgb_w_m2)),
            }
        )
        result = np.zeros((box.height, box.width, 5))
        for tile in tiles:
            image = mi.render(
                world.scene,
                integrator=self._integrator,
                sensor=self._sensor(place, tile),
                seed=mi.UInt32(int(random.integers(2**31))),
                spp=SAMPLES_PER_PASS,
            )
            values = np.insert(np.array(image, dtype=np.float64), 4, 1.0, axis=-1)
            finite = np.isfinite(values).all(axis=-1, keepdims=True)
            result[tile.within(box)] = np.where(finite, values, 0)
        return result

    def _sensor(self, place: Place, box: PixelBox) -> Any:
        """A Mitsuba sensor whose film is the box."""
        import mitsuba as mi

        camera = self._camera
        rotation = place.poses.R_cam_from_world.T
        to_world: Float32Array = homogeneous(
            rotation @ MITSUBA_FROM_CAM, -rotation @ place.poses.t_world_cam_m
        )
        return mi.load_dict(
            {
                "type": "perspective",
                "fov_axis": "x",
                "fov": float(np.degrees(2 * np.arctan(box.width / (2 * camera.fx_px)))),
                "principal_point_offset_x": _offset(camera.cx_px - box.x0, box.width),
                "principal_point_offset_y": _offset(camera.cy_px - box.y0, box.height),
                "near_clip": place.near_m,
                "far_clip": place.far_m,
                "to_world": mi.ScalarTransform4f(to_world),
                "sampler": {"type": "multijitter", "sample_count": SAMPLES_PER_PASS},
                "film": {
                    "type": "hdrfilm",
                    "width": box.width,
                    "height": box.height,
                    "pixel_format": "rgba",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},  # with others, the order of the sums varies
                },
            }
        )


def _tiles(hit: BoolArray, box: PixelBox) -> list[PixelBox]:
    """Tiles of the box that contain a pixel in which the first pass ``hit`` (h, w) the spacecraft, or a
    pixel within ``MARGIN_PX`` of one: a sliver that sixteen samples missed adjoins one that they hit."""
    near = maximum_filter(hit, 2 * MARGIN_PX + 1, mode="constant")
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
    """(n,) standard deviation of one pass in each window, as root mean square over the window's pixels.

    It is that of the radiance summed over the bands and clipped at ``white``; unclipped, a few pixels
    with glints would take nearly all passes.

    Args:
        first: (h, w, 5) result of one pass.
        second: (h, w, 5) result of another pass.
    """
    one, other = (np.minimum(image[..., :3].sum(axis=-1), white) for image in (first, second))
    squares = (one - other) ** 2 / 2
    return np.sqrt([squares[window].mean() for window in windows])


def sun_direction_body(craft: CraftState, index: int, shift: FloatArray) -> FloatArray:
    """(3,) unit vector, body axes, to the point of the Sun's disc that lights the pass ``index``.

    The points are Roberts' sequence R2 (2018) in the unit square, shifted by ``shift`` (2,) in 0 … 1
    (modulo 1) and mapped to the disc. The first n of them fill the disc evenly for any n.
    """
    across, around = (shift + index * R2) % 1
    radius, angle = np.sqrt(across) * np.tan(craft.sun_angular_radius_rad), 2 * np.pi * around
    local = np.array([radius * np.cos(angle), radius * np.sin(angle), 1.0])
    return np.asarray(R_with_z(craft.sun_direction_body) @ (local / np.linalg.norm(local)))


def _offset(principal_px: float, size_px: int) -> float:
    return -((principal_px + 0.5) / size_px - 0.5)
