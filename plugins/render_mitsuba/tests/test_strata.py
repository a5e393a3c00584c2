"""The random numbers of the compiled variants: even over the samples of a pixel, else independent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from posse_core import AnyArray, FloatArray, IntArray
from posse_render_mitsuba.variants import choose


@pytest.fixture(autouse=True)
def compiled() -> None:
    """Set the compiled variant of this machine."""
    import mitsuba as mi

    choice = choose("auto")
    if choice.variant == "scalar_rgb":
        # These numbers are of the compiled variants alone, which need a libLLVM of the system.
        pytest.skip("no libLLVM works on this machine")
    mi.set_variant(choice.variant)


def numbers(segment: int, samples: Sequence[int], digits: int, pixels: int = 200) -> FloatArray:
    """(pixels, samples, 6): light, scattered, choice, roulette of some of the samples."""
    import drjit as dr
    import mitsuba as mi

    from posse_render_mitsuba.strata import Strata

    seeds: AnyArray = np.random.default_rng(3).integers(2**32, size=pixels, dtype=np.uint32)
    pixel = mi.UInt32(np.repeat(seeds, len(samples)))
    sample = mi.UInt32(np.tile(np.uint32(samples), pixels))
    found = Strata(pixel, sample, digits).numbers(dr.opaque(mi.UInt32, segment))
    parts: list[Any] = [*found.light, *found.scattered, found.choice, found.roulette]
    return np.stack([np.array(part, dtype=np.float64) for part in parts], axis=-1).reshape(
        pixels, len(samples), len(parts)
    )


@pytest.mark.parametrize("digits", [0, 1, 3, 5])
@pytest.mark.parametrize("segment", [0, 1, 4])
def test_the_samples_of_a_pixel_fill_all_strata(digits: int, segment: int) -> None:
    """Each part of the unit square, of 2⁻ᵃ × 2⁻ᵇ with a + b the digits, has one sample in it."""
    count = 1 << digits
    found = numbers(segment, range(count), digits)
    assert (found >= 0).all()
    assert (found < 1).all()

    def are_all_there(cells: IntArray) -> bool:
        return bool((np.sort(cells, axis=1) == np.arange(count)).all())

    for x in (0, 2):
        for a in range(digits + 1):
            across, up = 2**a, 2 ** (digits - a)
            column = (found[..., x] * across).astype(np.int64)
            assert are_all_there(column * up + (found[..., x + 1] * up).astype(np.int64))
    assert are_all_there((found[..., 4] * count).astype(np.int64))


def test_numbers_are_independent_but_for_the_strata() -> None:
    """Pairs of numbers of a pixel's eighth sample, of one segment, of two and of the next pixel, and
    the digits after the first ones are spread as by chance (χ²)."""
    first, second = (numbers(segment, [7], 5, pixels=100_000)[:, 0] for segment in (1, 2))
    columns = [*first.T, *second.T]
    neighbours = [np.roll(column, 1) for column in columns]

    def are_spread(cells: FloatArray) -> bool:
        counts = np.bincount(cells.astype(int), minlength=256)
        expected = cells.size / 256
        chi2 = float(np.sum((counts - expected) ** 2) / expected)
        return abs(chi2 - 255) < 5 * np.sqrt(2 * 255)

    for i, a in enumerate(columns):
        assert are_spread(a * 2**13 % 256)
        for b in (*columns[:i], *neighbours):
            assert are_spread(np.floor(a * 16) * 16 + np.floor(b * 16))
