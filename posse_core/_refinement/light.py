"""The light on the spacecraft, fitted to a crop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from posse_core._arrays import Float32Array, FloatArray
from posse_core._refinement.background import behind, near_pixels
from posse_core._refinement.crop import Crop, binned
from posse_core._refinement.flow import normals
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Drawn, Lights, Studio
from posse_core._refinement.windows import Windows, smooth

APART_PX = 2.0
"""By how many of a crop's pixels what is drawn may be beside what is seen, before steps are made."""
_DARK = 0.02
_CODING = 0.6
"""The slope of sRGB's coding falls with about this power of the brightness."""
_ROUNDS = 4
_LAMBERT = 2 / 3
"""The slope of what a matt surface sends back, by its normal, over that of the sky's radiance."""


@dataclass(frozen=True)
class Light:
    """How the spacecraft is lit and how sharp its image is.

    Attributes:
        lights: what shines.
        blur_px: standard deviation of the blur, in pixels of the image.
    """

    lights: Lights
    blur_px: float


@dataclass(frozen=True)
class Apart:
    """The spacecraft under each light alone, at full strength.

    Attributes:
        sun: under the Sun.
        sky: under an even sky.
        facing: (h, w, 3) unit normals of what is seen, towards the camera; 0 off it.
    """

    sun: Drawn
    sky: Drawn
    facing: Float32Array


class EvenlyLit(NamedTuple):
    """The spacecraft under an even sky.

    Attributes:
        drawn: what is seen.
        facing: (h, w, 3) its unit normals, towards the camera; 0 off it.
    """

    drawn: Drawn
    facing: Float32Array


class Averages(NamedTuple):
    """What is seen and drawn of the spacecraft, averaged over windows about N pixels.

    Attributes:
        seen: (N,) brightness of the image without the background.
        parts: (N, K) brightness under each light.
        slope: (N,) weights of differences, as far as they show in the coded image.
    """

    seen: FloatArray
    parts: FloatArray
    slope: FloatArray


def evenly_lit(crop: Crop, studio: Studio, placement: Placement) -> EvenlyLit:
    """Draw the spacecraft under an even sky."""
    drawn = studio.shape(crop.scale.drawn, crop.drawn_box, placement)
    return EvenlyLit(drawn, -normals(drawn.depth_m, crop.camera, crop.drawn_box))


def drawn_apart(
    crop: Crop,
    studio: Studio,
    placement: Placement,
    sun_direction_cam: FloatArray,
    even: EvenlyLit | None = None,
) -> Apart:
    """Draw the spacecraft under each light alone.

    Args:
        even: at this pose, if it is drawn already.
    """
    if even is None:
        even = evenly_lit(crop, studio, placement)
    lights = Lights(1.0, 0.0, sun_direction_cam)
    sun = studio.draw(crop.scale.drawn, crop.drawn_box, placement, lights)
    return Apart(sun, even.drawn, even.facing)


def fitted(
    crop: Crop,
    shown: Apart,
    sun_direction_cam: FloatArray,
    blur_px: float,
    apart_px: float,
    least_sun: float = 0.0,
) -> Light:
    """Fit the strengths of the Sun and of the sky, neither below 0, to the crop.

    Where the Sun shines from beyond the spacecraft, most of what is seen is lit by the Earth, and the
    sky may be brighter on one side. What is white, even in part, does not count, and what is far from
    what is drawn counts little.

    Args:
        apart_px: by how many of the crop's pixels what is drawn may be beside what is seen. Both are
            averaged over windows of this size, as edges and booms would else be dark where they are
            drawn bright, and the light be found too faint.
        least_sun: how much brighter a plate that faces the Sun is, at least, than one that faces the
            brightest part of the sky.
    """
    has_slope = sun_direction_cam[2] > 0
    brights = [shown.sun.bright, *(_halves(shown) if has_slope else [shown.sky.bright])]
    blur, finer = blur_px * crop.scale.drawn, crop.scale.finer
    sharp = [binned(smooth(bright, blur), finer) for bright in brights]
    averaged = averages(crop, shown.sun, sharp, blur_px, apart_px)
    if averaged is None:
        return Light(Lights(1.0, 0.0, sun_direction_cam), blur_px)
    seen, parts, slope = averaged
    parts[:, 1:] += least_sun * parts[:, :1]
    weight, strength = slope, np.zeros(len(brights))
    for _ in range(_ROUNDS):
        strength = nnls(*_condensed(parts * weight[:, None], seen * weight))[0]
        off = np.abs(parts @ strength - seen) * slope
        spread = 1.4826 * float(np.median(off)) + 1e-4
        weight = slope / np.sqrt(np.maximum(1, off / (1.5 * spread)))
    sun = float(strength[0] + least_sun * strength[1:].sum())
    if not has_slope:
        return Light(Lights(sun, float(strength[1]), sun_direction_cam), blur_px)
    halves = strength[1:].reshape(3, 2)
    sky = float(halves.sum() / 2)
    x, y, z = ((halves[:, 0] - halves[:, 1]) / 2 / max(sky, 1e-9) / _LAMBERT).tolist()
    return Light(Lights(sun, sky, sun_direction_cam, (x, y, z)), blur_px)


def averages(
    crop: Crop, drawn: Drawn, brights: Sequence[Float32Array], blur_px: float, apart_px: float
) -> Averages | None:
    """What is seen of the spacecraft and what several lights give, averaged over windows of a size in
    the crop's pixels, where the spacecraft is drawn and nothing is white; None if that is nowhere.

    Args:
        drawn: gives the coverage.
        brights: (h, w) brightness under each light, at full strength, as sharp as the crop and in its
            pixels.
    """
    inside = near_pixels(drawn, crop.scale.finer) & ~crop.is_saturated
    if not inside.any():
        return None
    windows = Windows(inside.astype(np.float32), apart_px)
    own = crop.linear - beside(crop, drawn, blur_px)
    seen = windows.mean(own)[inside].astype(np.float64)
    parts = np.stack([windows.mean(bright)[inside] for bright in brights], axis=1).astype(np.float64)
    return Averages(seen, parts, 1 / np.maximum(seen, _DARK) ** _CODING)


def beside(crop: Crop, drawn: Drawn, blur_px: float) -> Float32Array:
    """(h, w) linear brightness of the crop beside the spacecraft, as far as it is not covered."""
    covered = binned(smooth(drawn.coverage, blur_px * crop.scale.drawn), crop.scale.finer)
    return np.asarray((1 - covered) * behind(drawn, crop), np.float32)


def _condensed(parts: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same least squares in one equation more than there are unknowns, by the eigenvectors of the
    normal matrix: (N, K) and (N,) → (K + 1, K) and (K + 1,)."""
    whole = np.column_stack([parts, seen])
    squares, across = np.linalg.eigh(whole.T @ whole)
    few = np.sqrt(np.maximum(squares, 0))[:, None] * across.T
    return few[:, :-1], few[:, -1]


def _halves(shown: Apart) -> list[Float32Array]:
    """The spacecraft under skies that are as bright on one side of each axis as they are dark on the
    other: along x, against x, along y and so on, in camera axes."""
    return [
        np.asarray(shown.sky.bright * (1 + sign * shown.facing[..., axis]) / 2, np.float32)
        for axis in range(3)
        for sign in (1, -1)
    ]


def together(shown: Apart, lights: Lights) -> Drawn:
    """What is seen under both."""
    shade = 1 + _LAMBERT * (shown.facing @ np.array(lights.sky_slope, np.float32))
    sky = np.float32(lights.sky) * shade * shown.sky.bright
    bright = np.float32(lights.sun) * shown.sun.bright + sky
    return Drawn(np.asarray(bright, np.float32), shown.sun.coverage, shown.sun.depth_m)
