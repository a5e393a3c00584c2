"""Rendering by compiled variants: one kernel call for many pixels.

Films and sensors of Mitsuba are left out, since their sizes become constants of the kernel, which
would then be compiled for each size of box. Here a ray's pixel, the camera and the Sun are data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from posse_core import Camera, FloatArray, RenderRequest, random_generator
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.samples import further_rounds, mean_of_samples
from posse_render_mitsuba.world import World

ROUND_SPP = 32
SAMPLES_PER_CALL = 1 << 20
"""Enough to make what a call costs beside them (0.01 s) small. Four times as many take 0.4 GB more."""
MOST_TRACES = 8
"""That are kept."""
NEVER = 2**31 - 1
"""More traces than there will be."""


class Wavefront:
    """Draws boxes of one camera's image with a compiled variant, which must be set."""

    LAMPS: Mapping[str, Any] = {}
    """The Sun is none of the scene's: see :mod:`posse_render_mitsuba.paths`."""

    def __init__(self, camera: Camera, radius_m: float, options: MitsubaOptions) -> None:
        import drjit as dr
        import mitsuba as mi

        from posse_render_mitsuba.paths import look

        self._camera = camera
        self._radius_m = radius_m
        # Once a pixel is looked at often enough for two rounds, the second goes to where the noise is.
        self._rounds = max(1.0, options.spp / ROUND_SPP)
        spp = min(options.spp, ROUND_SPP)
        self._sampler = mi.load_dict({"type": options.sampler, "sample_count": spp})
        self._spp = int(self._sampler.sample_count())
        self._sampler.set_samples_per_wavefront(self._spp)
        self._max_depth = options.max_depth
        # Traced once and replayed: tracing costs 0.1 s. It is traced again where there are as many
        # samples as an array of the craft's has entries, which small boxes may bring about often.
        self._look = dr.freeze(look, limit=MOST_TRACES, warn_after=NEVER)

    def draw(self, world: World, request: RenderRequest) -> FloatArray:
        """(h, w, 4) radiance and coverage of the request's box."""
        import drjit as dr
        import mitsuba as mi

        from posse_render_mitsuba.paths import Eye, Sun

        craft, box = request.craft, request.box
        random = random_generator(request.seed, request.index, "mitsuba")
        white = float(craft.sun_irradiance_rgb_w_m2.sum()) / np.pi
        places = box.pixel_centres_px().reshape(-1, 2)
        look = partial(
            self._look,
            world.scene,
            Eye.of(craft, self._camera, self._radius_m),
            Sun.of(craft),
            dr.opaque(mi.Float, white),
            self._max_depth,
        )
        first = self._round(look, places, random)
        sums, variance = first[:, :5], first[:, 5]
        if self._rounds > 1:
            shape = box.height, box.width
            again = further_rounds(variance.reshape(shape), sums[:, 3].reshape(shape), self._rounds)
            which = np.repeat(np.arange(len(places)), again.reshape(-1))
            more = self._round(look, places[which], random)
            np.add.at(sums, which, more[:, :5])
        return mean_of_samples(sums[:, :4], sums[:, 4]).reshape(box.height, box.width, 4)

    def _round(self, look: Callable[..., Any], places: FloatArray, random: Any) -> FloatArray:
        """See :meth:`_pixels`, of any number."""
        parts = [
            self._pixels(look, run, int(random.integers(2**31)))
            for run in _runs(places, SAMPLES_PER_CALL // self._spp)
        ]
        return np.concatenate([np.zeros((0, 6)), *parts])

    def _pixels(self, look: Callable[..., Any], places: FloatArray, seed: int) -> FloatArray:
        """(n, 6) of the pixels whose centres are at ``places`` (n, 2): sums of radiance and coverage
        over the samples, how many these are, and the variance of their radiance, summed over the bands
        up to white: brighter is a glint of few pixels, which would be looked at first. ``look`` is
        :func:`posse_render_mitsuba.paths.look` of a frame."""
        import drjit as dr
        import mitsuba as mi

        sampler = self._sampler.clone()
        sampler.seed(dr.opaque(mi.UInt32, seed), len(places) * self._spp)
        corner = (places - [self._camera.cx_px, self._camera.cy_px] - 0.5) / self._camera.fx_px
        x, y = (dr.repeat(mi.Float(np.float32(column)), self._spp) for column in corner.T)
        channels = look(sampler, x, y)
        sums = [np.array(dr.block_sum(channel, self._spp), dtype=np.float64) for channel in channels]
        *image, count, light_sum, square_sum = sums
        known = np.maximum(count, 1)
        variance = np.maximum(square_sum / known - (light_sum / known) ** 2, 0)
        return np.stack([*image, count, variance], axis=-1)


def _runs(places: FloatArray, largest: int) -> Iterator[FloatArray]:
    """Rows of ``places`` (n, 2) in order, ``largest`` at most at a time."""
    for start in range(0, len(places), largest):
        yield places[start : start + largest]
