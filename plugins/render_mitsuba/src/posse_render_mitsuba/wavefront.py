"""Rendering by Mitsuba's compiled variants (LLVM, CUDA): one kernel call renders many pixels.

Mitsuba's films and sensors are not used, because their sizes become constants of the kernel, which would
then be compiled again for each new box size. Here the pixels of the rays, the camera and the Sun are
inputs of the kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from posse_core import EnvironmentMap, FloatArray, RenderRequest, Scene, random_generator
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.samples import further_rounds, mean_of_samples
from posse_render_mitsuba.world import Place, World

if TYPE_CHECKING:
    from posse_render_mitsuba.materials import Materials

ROUND_SPP = 32
"""Samples per pixel of one round, a power of two."""
SAMPLES_PER_CALL = 1 << 20
"""Enough samples that the fixed cost of a call (0.01 s) is small; four times as many take 0.4 GB
more."""
BRIGHTEST = 8.0
"""Samples that are brighter count as so bright where noise is compared; a white plate that faces the Sun
has 1."""
MAX_KERNELS = 8
"""How many traced kernels are kept for replay."""
NEVER = 2**31 - 1
"""More traces than one process makes, so that Dr.Jit never warns of too many."""


class Wavefront:
    """Renders pixel boxes of one camera's image. A compiled variant must be set beforehand."""

    def __init__(self, scene: Scene, options: MitsubaOptions) -> None:
        import drjit as dr

        from posse_render_mitsuba.paths import sample_pixels

        self._scene = scene
        self._worlds: dict[tuple[int, ...] | None, tuple[World, Materials]] = {}
        self._camera = scene.camera
        # When the samples per pixel allow more than one round, those after the first go to noisy pixels.
        self._rounds = max(1.0, options.spp / ROUND_SPP)
        self._digits = (min(options.spp, ROUND_SPP) - 1).bit_length()
        self._spp = 1 << self._digits
        self._max_depth = options.max_depth
        # The kernel is traced once and then replayed, because tracing costs 0.1 s. Dr.Jit traces it
        # again if the number of samples equals the length of one of the scene's arrays, which happens
        # often with small boxes. On CUDA devices, Dr.Jit 1.5 ends the process when it replays.
        self._sample_pixels: Any = sample_pixels
        if options.variant != "cuda":
            self._sample_pixels = dr.freeze(sample_pixels, limit=MAX_KERNELS, warn_after=NEVER)

    def draw(self, place: Place, request: RenderRequest) -> FloatArray:
        """(h, w, 4) radiance in three bands, W m⁻² sr⁻¹, and coverage of the request's box."""
        import drjit as dr
        import mitsuba as mi

        from posse_render_mitsuba.paths import CameraRays, Sun

        craft, box = request.craft, request.box
        world, materials = self._world(request.environment)
        world.move(place.poses)
        materials.set(craft)
        if request.environment is not None:
            world.set_environment(request.environment, place.poses)
        random = random_generator(request.seed, request.index, "mitsuba")
        brightest = BRIGHTEST * float(craft.sun_irradiance_rgb_w_m2.sum()) / np.pi
        centres_px = box.pixel_centres_px().reshape(-1, 2)
        sample_pixels = partial(
            self._sample_pixels,
            world.scene,
            materials.table,
            CameraRays.of(place, self._camera),
            Sun.of(craft),
            dr.opaque(mi.Float, brightest),
            self._max_depth,
        )
        first = self._round(sample_pixels, centres_px, random)
        sums, variance = first[:, :5], first[:, 5]
        if self._rounds > 1:
            shape = box.height, box.width
            further = further_rounds(variance.reshape(shape), sums[:, 3].reshape(shape), self._rounds)
            pixels = np.repeat(np.arange(len(centres_px)), further.reshape(-1))
            more = self._round(sample_pixels, centres_px[pixels], random)
            np.add.at(sums, pixels, more[:, :5])
        return mean_of_samples(sums[:, :4], sums[:, 4]).reshape(box.height, box.width, 4)

    def _world(self, environment: EnvironmentMap | None) -> tuple[World, Materials]:
        """The scene without a sky, or with one of the environment's size, and its materials."""
        import mitsuba as mi

        from posse_render_mitsuba.craft import fixed_shapes, link_shapes
        from posse_render_mitsuba.materials import Materials

        kind = None if environment is None else environment.radiance_rgb.shape
        if kind not in self._worlds:
            never_called = mi.load_dict({"type": "diffuse"})
            make = link_shapes if len(self._scene.link_radii_m) > 1 else fixed_shapes
            shapes = make(self._scene, lambda piece: never_called)
            world = World(self._scene, shapes, {}, environment)
            self._worlds[kind] = world, Materials(self._scene, shapes)
        return self._worlds[kind]

    def _round(
        self, sample_pixels: Callable[..., Any], centres_px: FloatArray, random: np.random.Generator
    ) -> FloatArray:
        """As :meth:`_pixels`, for any number of pixels: split into as many kernel calls as needed."""
        parts = [
            self._pixels(sample_pixels, chunk_px, random)
            for chunk_px in _chunks(centres_px, SAMPLES_PER_CALL // self._spp)
        ]
        return np.concatenate([np.zeros((0, 6)), *parts])

    def _pixels(
        self, sample_pixels: Callable[..., Any], centres_px: FloatArray, random: np.random.Generator
    ) -> FloatArray:
        """Sample some pixels in one kernel call.

        Args:
            sample_pixels: :func:`posse_render_mitsuba.paths.sample_pixels` with a frame's arguments.
            centres_px: (n, 2) centres of the pixels, px.
            random: makes a seed of each pixel.

        Returns:
            (n, 6): the sums of radiance (three bands) and coverage over the samples, the number of
            samples, and the variance of their radiance. The variance is that of the sum over the bands,
            clipped at :data:`BRIGHTEST`; unclipped, a few pixels with glints would take most of the
            further samples.
        """
        import drjit as dr
        import mitsuba as mi

        from posse_render_mitsuba.strata import Strata

        pixels = len(centres_px)
        seeds = random.integers(2**32, size=pixels, dtype=np.uint32)
        strata = Strata(
            dr.repeat(mi.UInt32(seeds), self._spp),
            dr.tile(dr.arange(mi.UInt32, self._spp), pixels),
            self._digits,
        )
        corner = (centres_px - [self._camera.cx_px, self._camera.cy_px] - 0.5) / self._camera.fx_px
        x, y = (dr.repeat(mi.Float(np.float32(column)), self._spp) for column in corner.T)
        channels = sample_pixels(strata, x, y)
        sums = [np.array(dr.block_sum(channel, self._spp), dtype=np.float64) for channel in channels]
        *image, count, clipped_sum, square_sum = sums
        divisor = np.maximum(count, 1)
        variance = np.maximum(square_sum / divisor - (clipped_sum / divisor) ** 2, 0)
        return np.stack([*image, count, variance], axis=-1)


def _chunks(centres_px: FloatArray, size: int) -> Iterator[FloatArray]:
    """Split ``centres_px`` (n, 2) into consecutive chunks of at most ``size`` rows."""
    for start in range(0, len(centres_px), size):
        yield centres_px[start : start + size]
