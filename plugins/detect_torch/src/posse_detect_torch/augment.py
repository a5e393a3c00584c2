"""Augmentation of grey pictures, 0 … 1 in linear light; every draw comes from the generator given.

A picture is turned and zoomed but never mirrored: a mirrored spacecraft is another one.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from posse_core import Float32Array, FloatArray

Random = np.random.Generator


def random_view(
    random: Random, size_px: int, zoom: tuple[float, float], shift: float, angle_rad: float
) -> FloatArray:
    """(2, 3) affine map of a square, which turns and zooms it about its middle and then shifts it.

    It maps the square's own coordinates, in which pixel (0, 0) reaches from 0 to 1.

    Args:
        zoom: least and greatest, drawn evenly in its logarithm.
        shift: greatest, in sides of the square.
        angle_rad: of the turn; quarters keep boxes tight.
    """
    scale = np.exp(random.uniform(*np.log(zoom)))
    cosine, sine = scale * np.cos(angle_rad), scale * np.sin(angle_rad)
    A = np.array([[cosine, -sine], [sine, cosine]])
    middle = np.full(2, size_px / 2)
    return np.column_stack([A, middle - A @ middle + random.uniform(-shift, shift, 2) * size_px])


def warp(picture: Float32Array, view: FloatArray) -> Float32Array:
    """(S, S) picture seen through a view; black where the picture does not reach."""
    A, b = view[:, :2], view[:, 2]
    centres = np.column_stack([A, b + A @ [0.5, 0.5] - 0.5])  # OpenCV counts from pixel centres
    return np.asarray(cv2.warpAffine(picture, centres, picture.shape[::-1], flags=cv2.INTER_LINEAR))


def move_points(points: FloatArray, view: FloatArray) -> FloatArray:
    """(..., 2) points in the square's coordinates, through a view."""
    return np.asarray(points @ view[:, :2].T + view[:, 2])


def move_boxes(boxes: FloatArray, view: FloatArray, size_px: int) -> FloatArray:
    """(N, 4) left, top, right, bottom through a view that turns by quarters, cut at the border."""
    ends = move_points(boxes.reshape(-1, 2, 2), view)
    moved = np.concatenate([ends.min(axis=1), ends.max(axis=1)], axis=1)
    return np.asarray(np.clip(moved, 0, size_px))


def exposure(picture: Float32Array, random: Random) -> Float32Array:
    """Two stops darker to one brighter; what exceeds full scale is cut."""
    return np.asarray(np.minimum(picture * np.float32(2 ** random.uniform(-2, 1)), 1))


def noise(picture: Float32Array, random: Random) -> Float32Array:
    """Shot noise of a full well of 500 to 20 000 electrons, and read noise up to 1 %."""
    full_well = np.exp(random.uniform(np.log(500), np.log(20_000)))
    variance = picture / full_well + random.uniform(0, 0.01) ** 2
    drawn = random.standard_normal(picture.shape, dtype=np.float32)
    return np.asarray(np.clip(picture + np.sqrt(variance) * drawn, 0, 1), np.float32)


def blur(picture: Float32Array, random: Random) -> Float32Array:
    """Gaussian of up to 1.2 pixels."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), random.uniform(0.2, 1.2)))


def glare(picture: Float32Array, random: Random) -> Float32Array:
    """A ramp of light from one side, as from a bright limb outside the image."""
    size = len(picture)
    angle = random.uniform(0, 2 * np.pi)
    along = np.arange(size, dtype=np.float32) / size - 0.5
    ramp = 0.5 + np.cos(angle) * along[None, :] + np.sin(angle) * along[:, None]
    light = random.uniform(0, 0.3) * np.clip(ramp, 0, 1) ** 2
    return np.asarray(np.minimum(picture + light, 1), np.float32)


def stars(picture: Float32Array, random: Random) -> Float32Array:
    """Up to sixty bright points anywhere, the craft's own pixels included, as glints are."""
    out = picture.copy()
    size = len(picture)
    count = random.integers(1, 60)
    places = random.integers(0, size, (2, count))
    out[places[0], places[1]] = np.maximum(out[places[0], places[1]], random.uniform(0, 1, count) ** 2)
    return out


def cut_out(picture: Float32Array, random: Random) -> Float32Array:
    """One to three rectangles of up to a sixth of the side, each of one even light."""
    out = picture.copy()
    size = len(picture)
    for _ in range(random.integers(1, 4)):
        width, height = random.integers(2, max(size // 6, 3), 2)
        x, y = random.integers(0, size - width), random.integers(0, size - height)
        out[y : y + height, x : x + width] = random.uniform(0, 0.5)
    return out


_CHANCES: tuple[tuple[Callable[[Float32Array, Random], Float32Array], float], ...] = (
    (glare, 0.2),
    (stars, 0.3),
    (cut_out, 0.3),
    (exposure, 0.8),
    (blur, 0.3),
    (noise, 0.5),
)


def look(picture: Float32Array, random: Random) -> Float32Array:
    """A picture with each change at its own chance; light comes first and the sensor last."""
    for change, chance in _CHANCES:
        if random.uniform() < chance:
            picture = change(picture, random)
    return picture
