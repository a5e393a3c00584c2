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
        count = channels.shape[-1]
        mean = self.mean(image)
        means = np.stack([self.mean(channels[..., k]) for k in range(count)], axis=-1)
        with_image = np.empty_like(channels)
        among = np.empty((*channels.shape, count), np.float32)
        for k in range(count):
            with_image[..., k] = self.mean(image * channels[..., k]) - mean * means[..., k]
            for m in range(k, count):
                both = self.mean(channels[..., k] * channels[..., m]) - means[..., k] * means[..., m]
                among[..., k, m] = among[..., m, k] = both
        among += np.float32(noise**2) * np.eye(count, dtype=np.float32)
        # One channel needs no solver, which takes longer than all the rest.
        alone = count == 1
        found = with_image / among[..., 0] if alone else np.linalg.solve(among, with_image[..., None])
        best = np.clip(found.reshape(channels.shape), *gains).astype(np.float32)
        left = (image - mean) - np.sum(best * (channels - means), axis=-1)
        return Explained(np.asarray(left, np.float32), best)


def smooth(image: Float32Array, sigma_px: float) -> Float32Array:
    """An image blurred by a Gaussian."""
    if sigma_px <= 0:
        return image
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT))
