"""Point spread functions: blurring of extended light, and spots of point sources."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.special import ndtr

from posse_core.model.arrays import Float32Array, FloatArray
from posse_core.scenario.sensor import PsfConfig


class GaussianPsf:
    """A Gaussian spot, cut at 4.5 σ and made whole again."""

    def __init__(self, config: PsfConfig) -> None:
        self._sigma_px = config.sigma_px
        self.radius_px = int(np.ceil(4.5 * config.sigma_px))
        x = np.arange(-self.radius_px, self.radius_px + 1)
        kernel = np.exp(-0.5 * (x / self._sigma_px) ** 2)
        self._kernel = kernel / kernel.sum()

    def blur(self, image: Float32Array) -> Float32Array:
        """(H, W, C) → (H, W, C). As much light comes in over an edge as leaves, so none is lost."""
        blurred = cv2.sepFilter2D(
            image, cv2.CV_32F, self._kernel, self._kernel, borderType=cv2.BORDER_REFLECT
        )
        return np.asarray(blurred, dtype=np.float32).reshape(image.shape)

    def spots(self, offsets_px: FloatArray) -> FloatArray:
        """Shares of a point's light in the pixels around it, which add up to 1.

        (S, 2) place (u, v) from the centre of the middle pixel → (S, n, n), n = 2 ``radius_px`` + 1,
        rows along v.
        """
        edges = np.arange(-self.radius_px, self.radius_px + 2) - 0.5
        shares = np.diff(ndtr((edges - offsets_px[..., None]) / self._sigma_px), axis=-1)
        shares /= shares.sum(axis=-1, keepdims=True)
        return np.asarray(shares[:, 1, :, None] * shares[:, 0, None, :])


class NoPsf:
    """All light of a point in its own pixel."""

    radius_px = 0

    def blur(self, image: Float32Array) -> Float32Array:
        """(H, W, C), unchanged."""
        return image

    def spots(self, offsets_px: FloatArray) -> FloatArray:
        """(S, 2) → (S, 1, 1) ones."""
        return np.ones((len(offsets_px), 1, 1))


def make_psf(config: PsfConfig | None) -> GaussianPsf | NoPsf:
    """The point spread function that a scenario asks for."""
    return NoPsf() if config is None else GaussianPsf(config)
