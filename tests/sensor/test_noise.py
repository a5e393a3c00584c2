"""The sensor's random numbers against the distributions that they are named after."""

import numpy as np
import pytest
from scipy import stats

from posse_core._imaging.noise import GAUSSIAN_READ_E, detected, normal, poisson, shot


def _random(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("seed", range(4))
def test_normal_draws_are_gaussian(seed: int) -> None:
    """Kolmogorov and Smirnov's test of 10⁶ draws, and the number of draws in the tails."""
    drawn = normal(_random(seed), 1_000_001)
    assert drawn.shape == (1_000_001,)
    assert drawn.dtype == np.float32
    assert stats.kstest(drawn.astype(float), "norm").pvalue > 1e-4
    for sigma in (3, 4):
        expected = 2 * stats.norm.sf(sigma) * drawn.size
        found = np.count_nonzero(np.abs(drawn) > sigma)
        assert found == pytest.approx(expected, abs=5 * np.sqrt(expected))


def test_normal_draws_are_independent() -> None:
    """Neither draws nor their squares are correlated, next to each other or those of one radius."""
    drawn = normal(_random(7), 2_000_000).astype(float)
    limit = 5 / np.sqrt(1_000_000)
    for power in (1, 2):
        x = drawn**power
        assert abs(np.corrcoef(x[1:], x[:-1])[0, 1]) < limit
        assert abs(np.corrcoef(x[: x.size // 2], x[x.size // 2 :])[0, 1]) < limit


@pytest.mark.parametrize(
    "means", [(0.2,), (0.0, 0.01, 0.3), (0.9, 1.0), (0.001, 5.0, 0.4, 0.0), (3.0, 50.0)]
)
def test_poisson_draws_have_their_own_means(means: tuple[float, ...]) -> None:
    """Pearson's test of each mean's draws, where neighbours have other means."""
    count = 60_000
    drawn = poisson(np.tile(np.float32(means), count), _random(3)).reshape(count, len(means))
    for mean, own in zip(means, drawn.T, strict=True):
        if mean == 0:
            assert not own.any()
            continue
        last = int(stats.poisson.isf(50 / count, mean))
        expected = stats.poisson.pmf(np.arange(last + 1), mean)
        found = np.bincount(np.minimum(own, last + 1), minlength=last + 2)
        expected = np.append(expected, 1 - expected.sum()) * count
        kept = expected > 5
        scale = found[kept].sum() / expected[kept].sum()
        assert stats.chisquare(found[kept], scale * expected[kept]).pvalue > 1e-4
    for a in range(len(means) - 1):
        if means[a] and means[a + 1]:
            assert abs(np.corrcoef(drawn[:, a], drawn[:, a + 1])[0, 1]) < 5 / np.sqrt(count)


@pytest.mark.parametrize("mean_e", [80.0, 900.0, 980.0, 1000.0, 1100.0])
def test_read_noise_comes_after_the_full_well(mean_e: float) -> None:
    """E min(X, F) = μ Φ(a) − σ φ(a) + F (1 − Φ(a)) with a = (F − μ) / σ, and the variance of a Gaussian
    that is cut off there, plus the read noise's."""
    full_well_e, read_e, count = 1000.0, 12.0, 400_000
    drawn = detected(np.full(count, mean_e, np.float32), full_well_e, read_e, _random(5)).astype(float)
    sigma = np.sqrt(mean_e)
    a = (full_well_e - mean_e) / sigma
    below, density = stats.norm.cdf(a), stats.norm.pdf(a)
    mean = mean_e * below - sigma * density + full_well_e * (1 - below)
    square = (mean_e**2 + mean_e) * below - sigma * (mean_e + full_well_e) * density
    square += full_well_e**2 * (1 - below)
    variance = square - mean**2 + read_e**2
    assert drawn.mean() == pytest.approx(mean, abs=5 * np.sqrt(variance / count) + 1e-3)
    assert drawn.var() == pytest.approx(variance, rel=5 * np.sqrt(3 / count))


def test_bright_and_dark_pixels_of_one_block() -> None:
    mean_e = np.tile(np.float32([0.3, 10.0, 63.0, 65.0, 400.0]), 100_000)
    drawn = shot(mean_e, _random(9)).reshape(-1, 5).astype(float)
    means = np.array([0.3, 10.0, 63.0, 65.0, 400.0])
    np.testing.assert_allclose(drawn.mean(axis=0), means, atol=5 * np.sqrt(means.max() / 100_000))
    np.testing.assert_allclose(drawn.var(axis=0), means, rtol=0.04)


@pytest.mark.parametrize("mean_e", [0.0, 0.3, 5.0, 16.0, 32.0, 63.0])
@pytest.mark.parametrize("read_e", [0.999 * GAUSSIAN_READ_E, GAUSSIAN_READ_E, 25.0])
def test_photon_and_read_noise_of_dark_pixels_together(mean_e: float, read_e: float) -> None:
    """Their sum's distribution function is Σ P(k) Φ((x − k) / r), P being Poisson's. Edgeworth's first
    term limits how far a Gaussian is from one of the skewness 1/8 of a Poisson variable of mean 64."""
    count = 200_000
    block = np.full(count, mean_e, np.float32)
    drawn = detected(block, 1e6, read_e, _random(11)).astype(float)
    k = np.arange(stats.poisson.isf(1e-9, mean_e) + 2)
    x = np.linspace(
        mean_e - 5 * np.sqrt(mean_e + read_e**2), mean_e + 5 * np.sqrt(mean_e + read_e**2), 301
    )
    expected = stats.norm.cdf((x[:, None] - k) / read_e) @ stats.poisson.pmf(k, mean_e)
    found = np.searchsorted(np.sort(drawn), x) / count
    assert np.abs(found - expected).max() < 1 / 8 / (6 * np.sqrt(2 * np.pi)) + 1.9 / np.sqrt(count)
    variance = mean_e + read_e**2
    assert drawn.mean() == pytest.approx(mean_e, abs=5 * np.sqrt(variance / count))
    assert drawn.var() == pytest.approx(variance, rel=5 * np.sqrt(2.1 / count))


def test_saturated_and_dark_pixels_among_others() -> None:
    """Each pixel's noise is its own, whatever is beside it in the block."""
    means = np.float32([0.5, 40.0, 500.0, 5000.0])
    for read_e in (2.0, 12.0):
        drawn = (
            detected(np.tile(means, 100_000), 1000.0, read_e, _random(13)).reshape(-1, 4).astype(float)
        )
        expected = np.array([0.5, 40.0, 500.0, 1000.0])
        variance = np.array([0.5, 40.0, 500.0, 0.0]) + read_e**2
        assert np.all(np.abs(drawn.mean(axis=0) - expected) < 5 * np.sqrt(variance / 100_000))
        np.testing.assert_allclose(drawn.var(axis=0), variance, rtol=5 * np.sqrt(3 / 100_000))
