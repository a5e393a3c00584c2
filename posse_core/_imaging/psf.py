"""Point spread functions: they blur images and give the spots of point sources."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from scipy.special import j1, ndtr

from posse_core._arrays import Float32Array, FloatArray
from posse_core._scenario.sensor import PsfConfig

_STEPS_PER_PX = 8
"""Positions of a spot's centre within a pixel, per axis, for which :class:`RadialPsf` has a table."""


class GaussianPsf:
    """A Gaussian spot, cut off at 4.5 σ and normalised."""

    def __init__(self, config: PsfConfig) -> None:
        self._sigma_px = config.sigma_px
        self.radius_px = int(np.ceil(4.5 * config.sigma_px))
        x = np.arange(-self.radius_px, self.radius_px + 1)
        kernel = np.exp(-0.5 * (x / self._sigma_px) ** 2)
        self._kernel = kernel / kernel.sum()

    def blur(self, image: Float32Array) -> Float32Array:
        """(H, W, C) → (H, W, C). The image is mirrored at its borders, so that no light is lost."""
        blurred = cv2.sepFilter2D(
            image, cv2.CV_32F, self._kernel, self._kernel, borderType=cv2.BORDER_REFLECT
        )
        return np.asarray(blurred, dtype=np.float32).reshape(image.shape)

    def spots(self, offsets_px: FloatArray) -> FloatArray:
        """Shares of the light of point sources in the pixels around them; each spot adds up to 1.

        Args:
            offsets_px: (S, 2) positions (u, v) of the points relative to the centre of their pixel.

        Returns:
            (S, n, n) with n = 2 ``radius_px`` + 1; rows are along v.
        """
        edges = np.arange(-self.radius_px, self.radius_px + 2) - 0.5
        shares = np.diff(ndtr((edges - offsets_px[..., None]) / self._sigma_px), axis=-1)
        shares /= shares.sum(axis=-1, keepdims=True)
        return np.asarray(shares[:, 1, :, None] * shares[:, 0, None, :])


class RadialPsf:
    """A spot that depends only on the distance from its centre, integrated over the pixels."""

    def __init__(
        self, profile: Callable[[FloatArray], FloatArray], radius_px: int, detail_px: float
    ) -> None:
        """``profile`` gives the intensity by distance in pixels; ``detail_px`` is the size of its
        smallest detail."""
        self.radius_px = radius_px
        side = 2 * radius_px + 1
        # The spot is computed once at high resolution. The tables are sums of it over pixels whose
        # borders are shifted by steps of a pixel's fraction.
        step = int(np.ceil(1 / min(1.0, detail_px)))
        fine = _STEPS_PER_PX * step
        axis = (np.arange((side + 1) * fine) + 0.5) / fine - (side + 1) / 2
        spot = profile(np.hypot(axis[:, None], axis))
        bank = np.empty((_STEPS_PER_PX + 1, _STEPS_PER_PX + 1, side, side))
        for i in range(_STEPS_PER_PX + 1):
            for j in range(_STEPS_PER_PX + 1):
                y, x = fine - i * step, fine - j * step
                part = spot[y : y + side * fine, x : x + side * fine]
                bank[i, j] = part.reshape(side, fine, side, fine).sum(axis=(1, 3))
        bank /= bank.sum(axis=(2, 3), keepdims=True)
        self._bank = bank
        self._kernel = bank[_STEPS_PER_PX // 2, _STEPS_PER_PX // 2]

    def blur(self, image: Float32Array) -> Float32Array:
        """(H, W, C) → (H, W, C). The image is mirrored at its borders, so that no light is lost."""
        blurred = cv2.filter2D(image, cv2.CV_32F, self._kernel, borderType=cv2.BORDER_REFLECT)
        return np.asarray(blurred, dtype=np.float32).reshape(image.shape)

    def spots(self, offsets_px: FloatArray) -> FloatArray:
        """As :meth:`GaussianPsf.spots`, interpolated linearly between tables an eighth of a pixel
        apart."""
        at = np.clip((offsets_px + 0.5) * _STEPS_PER_PX, 0, _STEPS_PER_PX - 1e-9)
        low = at.astype(np.intp)
        share = (at - low)[..., None, None]
        (j, i), (dj, di) = low.T, (share[:, 0], share[:, 1])
        upper = self._bank[i, j] * (1 - dj) + self._bank[i, j + 1] * dj
        lower = self._bank[i + 1, j] * (1 - dj) + self._bank[i + 1, j + 1] * dj
        return np.asarray(upper * (1 - di) + lower * di)


class NoPsf:
    """No blur: all light of a point falls into its own pixel."""

    radius_px = 0

    def blur(self, image: Float32Array) -> Float32Array:
        """(H, W, C), unchanged."""
        return image

    def spots(self, offsets_px: FloatArray) -> FloatArray:
        """(S, 2) → (S, 1, 1) ones."""
        return np.ones((len(offsets_px), 1, 1))


def make_psf(
    config: PsfConfig | None, f_number: float, pixel_pitch_m: float
) -> GaussianPsf | RadialPsf | NoPsf:
    """The point spread function of a scenario's configuration."""
    if config is None:
        return NoPsf()
    if config.shape == "gaussian":
        return GaussianPsf(config)
    if config.shape == "defocus":
        half_px = config.diameter_px / 2
        return RadialPsf(
            lambda r: (r <= half_px).astype(np.float64), int(np.ceil(half_px + 0.5)), half_px
        )
    # Airy (1835): (2 J₁(x) / x)², x = π r / (λ N).
    unit_px = 550e-9 * f_number / pixel_pitch_m / np.pi

    def airy(r_px: FloatArray) -> FloatArray:
        x = np.maximum(r_px / unit_px, 1e-6)
        return np.asarray((2 * j1(x) / x) ** 2)

    # 97.5 % of the light is within the eighth dark ring; the spot is cut off there and normalised.
    radius_px = int(np.clip(np.ceil(8 * np.pi * unit_px + 0.5), 2, 40))
    return RadialPsf(airy, radius_px, np.pi * unit_px)


_GLARE_SIGMAS = np.array([0.25, 0.5, 1.0, 2.0])
"""Standard deviations of the Gaussians of equal weight that make a halo, in multiples of a unit."""
_GLARE_HALF = 0.7624
"""Radius within which half of the halo's light falls, in the same unit."""
_GLARE_FINEST_PX = 3.0
"""Standard deviation that the narrowest Gaussian has at the resolution at which it is computed."""


def glared(image: Float32Array, share: float, half_px: float) -> Float32Array:
    """An image of which a share of the light is scattered into a wide halo: (H, W, C) → (H, W, C).

    The halo is a sum of four Gaussians, which falls off nearly as the inverse square of the distance, as
    measured halos of lenses do (veiling glare). It is computed at a lower resolution. The image is
    mirrored at its borders, so that no light is lost.

    Args:
        share: of the light.
        half_px: radius within which half of the scattered light falls.
    """
    height, width = image.shape[:2]
    unit_px = half_px / _GLARE_HALF
    factor = max(1.0, _GLARE_SIGMAS[0] * unit_px / _GLARE_FINEST_PX)
    size = max(1, round(width / factor)), max(1, round(height / factor))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    sigmas = [
        (float(sigma * size[0] / width), float(sigma * size[1] / height))
        for sigma in _GLARE_SIGMAS * unit_px
    ]
    blurred = [
        cv2.GaussianBlur(small, (0, 0), sigmaX=x, sigmaY=y, borderType=cv2.BORDER_REFLECT)
        for x, y in sigmas
    ]
    halo = cv2.resize(np.mean(blurred, axis=0), (width, height), interpolation=cv2.INTER_LINEAR)
    mixed = np.float32(1.0 - share) * image + np.float32(share) * halo.reshape(image.shape)
    return np.asarray(mixed, dtype=np.float32)
