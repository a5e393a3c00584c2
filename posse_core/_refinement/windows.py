"""An image explained, in the neighbourhood of each pixel, by channels that are drawn.

Light, material and exposure change what is drawn by factors that vary little from pixel to pixel. So the
image is compared with what is best of it in each neighbourhood: I = Σ g_k F_k + o, with gains g_k and an
offset o of a Gaussian window's own, by least squares. With one channel this is the local, normalised
correlation; with several it is a guided filter (He et al. 2010) whose guide is what is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import Float32Array

_LEAST_WEIGHT = np.float32(1e-6)


@dataclass(frozen=True)
class Explained:
    """What the channels leave of an image.

    Attributes:
        residual: (h, w) image minus the explanation.
        gains: (h, w, K).
    """

    residual: Float32Array
    gains: Float32Array


class Windows:
    """Gaussian windows about each pixel, in which pixels have weights."""

    def __init__(self, weight: Float32Array, sigma_px: float) -> None:
        self._weight, self._sigma_px = weight, sigma_px
        self._sum = smooth(weight, sigma_px) + _LEAST_WEIGHT

    def mean(self, image: Float32Array) -> Float32Array:
        """The weighted mean in each window."""
        return np.asarray(smooth(self._weight * image, self._sigma_px) / self._sum, np.float32)

    def variance(self, image: Float32Array) -> Float32Array:
        """The variance in each window."""
        mean = self.mean(image)
        return np.asarray(np.maximum(self.mean(image * image) - mean * mean, 0), np.float32)

    def left_of(self, image: Float32Array, channel: Float32Array, noise: float) -> Float32Array:
        """What one channel (h, w) leaves of an image (h, w)."""
        return self.explained(image, channel[..., None], noise).residual

    def explained(
        self,
        image: Float32Array,
        channels: Float32Array,
        noise: float,
        gains: tuple[float, float] = (-np.inf, np.inf),
    ) -> Explained:
        """Explain an image (h, w) by channels (h, w, K).

        Args:
            noise: standard deviation below which a channel's variation says nothing.
            gains: least and greatest gain.
        """
        drawn = np.ascontiguousarray(np.moveaxis(channels, -1, 0))
        count, mean = len(drawn), self.mean(image)
        means = np.stack([self.mean(channel) for channel in drawn])
        with_image = np.stack([self.mean(image * channel) for channel in drawn]) - mean * means
        among = np.empty((count, *drawn.shape), np.float32)
        for k in range(count):
            for m in range(k, count):
                among[k, m] = self.mean(drawn[k] * drawn[m]) - means[k] * means[m]
            among[k, k] += np.float32(noise**2)
        best = np.clip(_solved(among, with_image), *gains)
        left = (image - mean) - np.sum(best * (drawn - means), axis=0)
        return Explained(np.asarray(left, np.float32), np.moveaxis(best, 0, -1))


def _solved(among: Float32Array, with_image: Float32Array) -> Float32Array:
    """The solutions (K, h, w) of positive definite equations, those of each pixel.

    LAPACK takes many times as long for systems that are so small and so many.

    Args:
        among: (K, K, h, w) upper triangles of the matrices; changed.
        with_image: (K, h, w) right sides; changed.
    """
    count = len(with_image)
    for k in range(count):
        for m in range(k + 1, count):
            share = among[k, m] / among[k, k]
            among[m, m:] -= share * among[k, m:]
            with_image[m] -= share * with_image[k]
    for k in reversed(range(count)):
        for m in range(k + 1, count):
            with_image[k] -= among[k, m] * with_image[m]
        with_image[k] /= among[k, k]
    return with_image


def smooth(image: Float32Array, sigma_px: float) -> Float32Array:
    """An image blurred by a Gaussian."""
    if sigma_px <= 0:
        return image
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT))
