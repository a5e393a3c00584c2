"""How bright the craft is, and how alike two pictures of it are."""

from __future__ import annotations

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray

DISPLAY_GAMMA = 2.2


def part_light(radiance_rgb: AnyArray, part_id: IntArray, parts: int) -> FloatArray:
    """(parts,) sum of radiance over bands and over the pixels whose centre is on each part."""
    light = np.asarray(radiance_rgb, np.float64).sum(axis=-1)
    on = part_id >= 0
    return np.asarray(np.bincount(part_id[on], weights=light[on], minlength=parts), np.float64)


def agreement(radiance_rgb: AnyArray, expected_rgb: FloatArray, whole: BoolArray) -> tuple[float, float]:
    """A picture against a closed form, over whole pixels where there is one.

    Returns:
        Ratio of the band farthest from 1, and root mean square difference over the expected mean.
    """
    known = whole & np.isfinite(expected_rgb).all(axis=-1)
    got, expected = np.asarray(radiance_rgb, np.float64)[known], expected_rgb[known]
    ratios = got.sum(axis=0) / expected.sum(axis=0)
    worst = ratios[np.argmax(np.abs(ratios - 1))]
    return float(worst), float(np.sqrt(((got - expected) ** 2).mean()) / expected.mean())


def noise(one_rgb: AnyArray, other_rgb: AnyArray, covered: BoolArray) -> float:
    """Standard deviation of a pixel's radiance between seeds, over the mean radiance of the craft.

    From two pictures: √(½ ⟨(a − b)²⟩) / ⟨a⟩ over covered pixels, bands summed.
    """
    one = np.asarray(one_rgb, np.float64).sum(axis=-1)[covered]
    other = np.asarray(other_rgb, np.float64).sum(axis=-1)[covered]
    return float(np.sqrt(((one - other) ** 2).mean() / 2) / max(one.mean(), 1e-30))


def full_scale(radiance_rgb: AnyArray, covered: BoolArray) -> float:
    """Radiance, mean over bands, that pictures of a frame show as white: a per cent is brighter."""
    light = np.asarray(radiance_rgb, np.float64).mean(axis=-1)[covered]
    return max(float(np.quantile(light, 0.99)), 1e-12) if light.size else 1.0


def displayed(radiance: AnyArray, white: float) -> FloatArray:
    """Radiance of any shape → 0 … 1 as an eye judges it: clipped at ``white``, to the power 1/2.2."""
    return np.asarray(np.clip(np.asarray(radiance, np.float64) / white, 0, 1) ** (1 / DISPLAY_GAMMA))


def structural_similarity(a: FloatArray, b: FloatArray, where: BoolArray) -> float:
    """Mean SSIM of two images (h, w) of range 0 … 1, over the pixels ``where``.

    Wang, Bovik, Sheikh & Simoncelli, Image quality assessment: from error visibility to structural
    similarity, IEEE Trans. Image Processing 13 (2004): an 11 × 11 Gaussian window of σ 1.5, K₁ 0.01,
    K₂ 0.03.
    """

    def blurred(image: FloatArray) -> FloatArray:
        return np.asarray(cv2.GaussianBlur(image, (11, 11), 1.5, borderType=cv2.BORDER_REFLECT))

    mean_a, mean_b = blurred(a), blurred(b)
    var_a, var_b = blurred(a * a) - mean_a**2, blurred(b * b) - mean_b**2
    covariance = blurred(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    similarity = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    similarity /= (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
    return float(similarity[where].mean()) if where.any() else 1.0
