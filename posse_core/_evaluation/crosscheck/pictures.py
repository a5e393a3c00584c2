"""Pictures of a comparison: the renderers side by side, and what is different."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray
from posse_core._evaluation.crosscheck.light import displayed
from posse_core._evaluation.crosscheck.shots import Shot
from posse_core._evaluation.crosscheck.silhouette import Exact
from posse_core._evaluation.pages import jpeg

WIDTH_PX = 240
HEIGHT_PX = 240
DARK = 0.004
"""Share of full scale below which a ratio says nothing."""
_FULL_STOP = 1.0
_FULL_COVERAGE = 0.25


@dataclass(frozen=True)
class FramePictures:
    """Captions and JPEG files of one frame.

    The pictures; then per renderer after the first the ratio of its light to the first's (blue: half,
    red: twice; grey: too dark to say); then per renderer its coverage minus the exact one (blue: a
    quarter of a pixel too little, red: too much).
    """

    captions: tuple[str, ...]
    jpegs: tuple[bytes, ...]

    @classmethod
    def of(cls, exact: Exact, shots: Mapping[str, Shot], white: float) -> FramePictures:
        """Draw a frame, at a scale that makes small craft visible."""
        made: dict[str, AnyArray] = {
            name: np.round(255 * displayed(shot.radiance_rgb, white)) for name, shot in shots.items()
        }
        names = list(shots)
        for name in names[1:]:
            ratio = _stops(shots[name], shots[names[0]])
            shown = [shots[n].radiance_rgb.mean(axis=-1) > DARK * white for n in (name, names[0])]
            made[f"{name} : {names[0]}"] = diverging(ratio / _FULL_STOP, shown[0] | shown[1])
        for name, shot in shots.items():
            error = (shot.coverage - exact.coverage) / _FULL_COVERAGE
            made[f"{name} edges"] = diverging(error, np.ones(error.shape, dtype=bool))
        return cls(
            tuple(made),
            tuple(jpeg(cv2.cvtColor(_scaled(image), cv2.COLOR_RGB2BGR)) for image in made.values()),
        )


def diverging(value: AnyArray, known: BoolArray) -> AnyArray:
    """(h, w) of −1 … 1 → (h, w, 3): blue, white, red; grey where not known."""
    v = np.clip(np.nan_to_num(value), -1, 1)
    red, blue = np.clip(v, 0, 1), np.clip(-v, 0, 1)
    colour = 255 * np.stack([1 - blue, 1 - np.maximum(red, blue), 1 - red], axis=-1)
    return np.asarray(np.where(known[..., None], colour, 90.0))


def _stops(a: Shot, b: Shot) -> AnyArray:
    """Ratio of the light as a power of two; a little blurred, since noise is not the question."""
    light = [cv2.GaussianBlur(s.radiance_rgb.mean(axis=-1), (0, 0), 1.0) for s in (a, b)]
    return np.asarray(np.log2(np.maximum(light[0], 1e-12) / np.maximum(light[1], 1e-12)))


def _scaled(image: AnyArray) -> AnyArray:
    height, width = image.shape[:2]
    scale = min(WIDTH_PX / width, HEIGHT_PX / height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    method = cv2.INTER_NEAREST if scale > 1 else cv2.INTER_AREA
    return np.asarray(cv2.resize(image.astype(np.uint8), size, interpolation=method))
