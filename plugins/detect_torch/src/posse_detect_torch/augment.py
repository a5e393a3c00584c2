"""Augmentation of grey pictures (0 … 1, linear in radiance); all random numbers come from the caller.

A picture is rotated and zoomed but never mirrored, since the mirror image shows a different spacecraft.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from posse_core import AnyArray, Float32Array, FloatArray
from posse_detect_torch.pictures import linear

Random = np.random.Generator
_COMPOSED = 0.5
"""Share of the spacecraft that are put in front of another background."""
_BACKGROUND_ZOOM = (0.35, 2.0)
_AVERAGED = 0.75
"""Zoom below which interpolation alone would skip pixels."""


def random_view(
    random: Random,
    size_px: int,
    zoom: tuple[float, float],
    shift: float,
    angle_rad: float,
) -> FloatArray:
    """Return a (2, 3) affine map that rotates and zooms a square about its centre and then shifts it.

    The map acts on pixel coordinates in which pixel (0, 0) extends from 0 to 1.

    Args:
        random: the random generator.
        size_px: side of the square.
        zoom: smallest and largest zoom; the logarithm of the zoom is drawn uniformly.
        shift: largest shift, as a share of the square's side. A picture that becomes smaller may be
            shifted farther by as much as leaves it in the square.
        angle_rad: angle of rotation; boxes stay tight at multiples of 90°.
    """
    scale = np.exp(random.uniform(*np.log(zoom)))
    cosine, sine = scale * np.cos(angle_rad), scale * np.sin(angle_rad)
    A = np.array([[cosine, -sine], [sine, cosine]])
    middle = np.full(2, size_px / 2)
    most = shift + max(0.0, (1 - scale) / 2)
    return np.column_stack([A, middle - A @ middle + random.uniform(-most, most, 2) * size_px])


def warp(
    picture: Float32Array, view: FloatArray, size_px: int, border: int = cv2.BORDER_CONSTANT
) -> Float32Array:
    """Apply an affine map to a square picture. What becomes clearly smaller is averaged over areas.

    Args:
        picture: (S, S).
        view: (2, 3) map.
        size_px: side of the result.
        border: what OpenCV puts outside the picture; black by default.
    """
    A, b = view[:, :2], view[:, 2]
    scale = float(np.sqrt(abs(np.linalg.det(A))))
    if scale < _AVERAGED:
        few = max(round(scale * len(picture)), 1)
        A = A * (len(picture) / few)
        picture = np.asarray(cv2.resize(picture, (few, few), interpolation=cv2.INTER_AREA))
    centres = np.column_stack([A, b + A @ [0.5, 0.5] - 0.5])  # OpenCV has pixel centres at integers
    size = (size_px, size_px)
    return np.asarray(cv2.warpAffine(picture, centres, size, flags=cv2.INTER_LINEAR, borderMode=border))


def move_points(points: FloatArray, view: FloatArray) -> FloatArray:
    """Apply an affine map to (..., 2) points; their pixel (0, 0) extends from 0 to 1."""
    return np.asarray(points @ view[:, :2].T + view[:, 2])


def move_boxes(boxes: FloatArray, view: FloatArray, size_px: int) -> FloatArray:
    """Apply an affine map to boxes (N, 4) left, top, right, bottom, and clip them to the square.

    The boxes stay tight if the map rotates by multiples of 90°.
    """
    ends = move_points(boxes.reshape(-1, 2, 2), view)
    moved = np.concatenate([ends.min(axis=1), ends.max(axis=1)], axis=1)
    return np.asarray(np.clip(moved, 0, size_px))


def in_front_of_some(
    picture: Float32Array, coverage: Float32Array, backgrounds: AnyArray, random: Random
) -> Float32Array:
    """Put some of the spacecraft in front of another background, each with an exposure of its own.

    A picture without a spacecraft becomes another background, of another contrast.

    A spacecraft that is dark in front of a bright Earth is rare in orbit, where the Sun lights both, and
    common in laboratories.

    Args:
        picture: (S, S) the spacecraft, in front of anything.
        coverage: (S, S) share of each pixel that the spacecraft covers, 0 … 1.
        backgrounds: (N, T, T) uint8 as of :func:`posse_detect_torch.pictures.cut_backgrounds`, of which
            one is rotated, zoomed, given another contrast and perhaps mirrored; with N = 0 the picture
            stays as it is.
        random: the random generator.
    """
    if len(backgrounds) == 0 or random.uniform() >= _COMPOSED:
        return picture
    size = len(picture)
    background = linear(backgrounds[random.integers(len(backgrounds))])
    view = random_view(random, size, _BACKGROUND_ZOOM, 0.0, random.uniform(0, 2 * np.pi))
    if random.uniform() < 0.5:
        background = background[:, ::-1]
    behind = warp(background, view, size, cv2.BORDER_REFLECT_101)
    mean = behind.mean()
    contrast = np.float32(2 ** random.uniform(-1, 1.5))
    behind = np.clip(mean + contrast * (behind - mean), 0, 1)
    craft_gain, background_gain = (np.float32(2 ** random.uniform(-2, 1)) for _ in range(2))
    whole = coverage * craft_gain * picture + (1 - coverage) * background_gain * behind
    # Averages of shares round to slightly more than 1, and what is left to slightly less than 0.
    return np.asarray(np.clip(whole, 0, 1), np.float32)


def exposure(picture: Float32Array, random: Random) -> Float32Array:
    """Change the exposure by −2 to +1 stops; values above full scale are clipped."""
    return np.asarray(np.minimum(picture * np.float32(2 ** random.uniform(-2, 1)), 1))


def noise(picture: Float32Array, random: Random) -> Float32Array:
    """Add shot noise for a full well of 500 to 20 000 electrons and read noise of up to 1 %."""
    full_well = np.exp(random.uniform(np.log(500), np.log(20_000)))
    variance = picture / full_well + random.uniform(0, 0.01) ** 2
    drawn = random.standard_normal(picture.shape, dtype=np.float32)
    return np.asarray(np.clip(picture + np.sqrt(variance) * drawn, 0, 1), np.float32)


def blur(picture: Float32Array, random: Random) -> Float32Array:
    """Blur with a Gaussian whose standard deviation is at most 1.2 pixels."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), random.uniform(0.2, 1.2)))


def coarsen(picture: Float32Array, random: Random) -> Float32Array:
    """Show a picture as if the spacecraft were up to four times as far away."""
    few = round(len(picture) / np.exp(random.uniform(0, np.log(4))))
    shrunk = cv2.resize(picture, (few, few), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(shrunk, picture.shape[::-1], interpolation=cv2.INTER_LINEAR))


def glare(picture: Float32Array, random: Random) -> Float32Array:
    """Add a ramp of stray light from one side, as from a bright limb outside the image."""
    size = len(picture)
    angle = random.uniform(0, 2 * np.pi)
    along = np.arange(size, dtype=np.float32) / size - 0.5
    ramp = 0.5 + np.cos(angle) * along[None, :] + np.sin(angle) * along[:, None]
    light = random.uniform(0, 0.3) * np.clip(ramp, 0, 1) ** 2
    return np.asarray(np.minimum(picture + light, 1), np.float32)


def stars(picture: Float32Array, random: Random) -> Float32Array:
    """Add up to sixty bright points anywhere; on the spacecraft they resemble glints."""
    out = picture.copy()
    size = len(picture)
    count = random.integers(1, 60)
    pixels = random.integers(0, size, (2, count))
    out[pixels[0], pixels[1]] = np.maximum(out[pixels[0], pixels[1]], random.uniform(0, 1, count) ** 2)
    return out


def cut_out(picture: Float32Array, random: Random) -> Float32Array:
    """Cover the picture with one to three grey rectangles, with sides of at most a sixth of its own."""
    out = picture.copy()
    size = len(picture)
    for _ in range(random.integers(1, 4)):
        width, height = random.integers(2, max(size // 6, 3), 2)
        x, y = random.integers(0, size - width), random.integers(0, size - height)
        out[y : y + height, x : x + width] = random.uniform(0, 0.5)
    return out


_PROBABILITIES: tuple[tuple[Callable[[Float32Array, Random], Float32Array], float], ...] = (
    (glare, 0.2),
    (stars, 0.3),
    (cut_out, 0.3),
    (exposure, 0.8),
    (blur, 0.3),
    (noise, 0.5),
)


def change_appearance(picture: Float32Array, random: Random) -> Float32Array:
    """Apply each change with its own probability, from the light to the sensor."""
    for change, probability in _PROBABILITIES:
        if random.uniform() < probability:
            picture = change(picture, random)
    return picture
