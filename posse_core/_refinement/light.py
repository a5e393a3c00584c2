"""The light on the spacecraft, fitted to a crop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from posse_core._arrays import FloatArray
from posse_core._refinement.crop import Crop, binned
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Drawn, Lights, Studio
from posse_core._refinement.windows import smooth

_DARK = 0.02
_CODING = 0.6
"""The slope of sRGB's coding falls with about this power of the brightness."""
_ROUNDS = 4


@dataclass(frozen=True)
class Light:
    """How the spacecraft is lit and how sharp its image is.

    Attributes:
        lights: what shines.
        blur_px: standard deviation of the blur, in pixels of the image.
    """

    lights: Lights
    blur_px: float


def drawn_apart(
    crop: Crop, studio: Studio, placement: Placement, sun_direction_cam: FloatArray
) -> tuple[Drawn, Drawn]:
    """The spacecraft under the Sun alone and under an even sky alone, each at full strength."""
    scale, box = crop.scale.drawn, crop.drawn_box
    sun = studio.draw(scale, box, placement, Lights(1.0, 0.0, sun_direction_cam))
    return sun, studio.draw(scale, box, placement, Lights(0.0, 1.0, sun_direction_cam))


def fitted(
    crop: Crop, shown: tuple[Drawn, Drawn], sun_direction_cam: FloatArray, blur_px: float
) -> Light:
    """Fit the strength of the Sun and of an even sky, neither below 0, to the crop.

    What is white, even in part, does not count, and what is far from what is drawn counts little.

    Args:
        shown: of :func:`drawn_apart`.
    """
    scale, blur = crop.scale, blur_px * crop.scale.drawn
    covered = binned(smooth(shown[0].coverage, blur), scale.finer)
    inside = covered > (0.9 if np.count_nonzero(covered > 0.9) >= 20 else 0.3)
    inside &= ~crop.is_saturated
    seen = crop.linear[inside].astype(np.float64)
    if not len(seen):
        return Light(Lights(1.0, 0.0, sun_direction_cam), blur_px)
    columns = [binned(smooth(each.bright, blur), scale.finer)[inside] for each in shown]
    parts = np.stack(columns, axis=1).astype(np.float64)
    slope = 1 / np.maximum(seen, _DARK) ** _CODING
    weight, strength = slope, np.zeros(2)
    for _ in range(_ROUNDS):
        strength = nnls(parts * weight[:, None], seen * weight)[0]
        off = np.abs(parts @ strength - seen) * slope
        spread = 1.4826 * float(np.median(off)) + 1e-4
        weight = slope / np.sqrt(np.maximum(1, off / (1.5 * spread)))
    sun, sky = strength.tolist()
    return Light(Lights(float(sun), float(sky), sun_direction_cam), blur_px)


def together(shown: tuple[Drawn, Drawn], lights: Lights) -> Drawn:
    """What is seen under both."""
    sun, sky = shown
    bright = np.float32(lights.sun) * sun.bright + np.float32(lights.sky) * sky.bright
    return Drawn(bright, sun.coverage, sun.depth_m)
