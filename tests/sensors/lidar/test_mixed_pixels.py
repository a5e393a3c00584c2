"""Beams that meet several surfaces: the share of each, and the echo that is measured."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.constants import c
from scipy.stats import norm

from posse_core._model.spacecraft import Material
from posse_core._sensors.lidar.beams import gaussian_beam
from posse_core._sensors.lidar.echoes import echoes
from posse_core.testing import scenes

EXACT = {"shot": False, "receiver_e": 0.0, "range_m": 0.0}
THETA = 0.01
"""Divergence, rad: at 20 m the beam's standard deviation is 50 mm."""


def edge(sense, offset_m, echo, *, behind_m=10.0, rays=2000, **more):
    """The reading of one beam that passes the edge of a plate, 20 m away, at a distance of ``offset_m``
    inside it; there is a wall of the same material behind."""
    plate = scenes.rectangle(
        "plate", "matt", centre_m=(offset_m - 4, 0, 0), u_m=(4, 0, 0), v_m=(0, 4, 0)
    )
    wall = scenes.rectangle("wall", "matt", centre_m=(0, 0, -behind_m), u_m=(9, 0, 0), v_m=(0, 9, 0))
    options = {
        "pattern": {"shape": "raster", "rays": rays, "columns": 1, "rows": 1, "divergence_rad": THETA,
                    "pulse_energy_j": 1e-6},
        "ranging": {"echo": echo},
        "receiver": {"saturation_e": None, **more},
        "noise": EXACT,
    }  # fmt: skip
    return sense([plate, wall], options, t_m=(0, 0, 20.0))


@pytest.mark.parametrize("sigmas", [-2.5, -1.3, -0.4, 0.0, 0.4, 1.3, 2.5])
def test_the_share_of_each_surface_is_that_of_the_gaussian_beam(sense, sigmas):
    """What returns from each is its share of the beam over the square of its range."""
    arrays = edge(sense, sigmas * 20 * THETA / 4, "centroid").arrays
    near, far = norm.cdf(sigmas) / 20**2, norm.sf(sigmas) / 30**2
    mixed_m = (near * 20 + far * 30) / (near + far)
    assert arrays["range_m"][0] == pytest.approx(mixed_m, abs=0.06)
    # The share that the measured range stands for, against the Gaussian's.
    share = 1 / (1 + (arrays["range_m"][0] - 20) / (30 - arrays["range_m"][0]) * 30**2 / 20**2)
    assert share == pytest.approx(norm.cdf(sigmas), abs=4e-3)
    assert arrays["true_range_m"][0] == (20 if sigmas >= 0 else 30)


@pytest.mark.parametrize("sigmas", [-1.0, -0.3, 0.0, 1.0])
def test_separate_surfaces_are_echoes_of_their_own(sense, sigmas):
    """The first is the plate; the strongest is what returns more."""
    offset_m = sigmas * 20 * THETA / 4
    near, far = norm.cdf(sigmas) / 20**2, norm.sf(sigmas) / 30**2
    first, strongest = (edge(sense, offset_m, echo) for echo in ("first", "strongest"))
    assert first.arrays["range_m"][0] == pytest.approx(20, abs=1e-3)
    assert first.arrays["part_id"][0] == 0
    assert strongest.arrays["range_m"][0] == pytest.approx(20 if near > far else 30, abs=1e-3)
    assert strongest.arrays["part_id"][0] == (0 if near > far else 1)
    ratio = first.arrays["intensity_e"][0] / strongest.arrays["intensity_e"][0]
    assert ratio == pytest.approx(near / max(near, far), rel=0.02)


def test_the_first_echo_must_exceed_the_threshold(sense):
    """A plate that the beam just grazes returns too little, and the wall behind is measured."""
    grazed = edge(sense, -2.5 * 20 * THETA / 4, "first")
    all_e = edge(sense, 10.0, "first").arrays["intensity_e"][0]
    assert grazed.arrays["range_m"][0] == pytest.approx(20, abs=1e-3)
    options = {"threshold_snr": 6.0}
    plate = scenes.rectangle(
        "plate", "matt", centre_m=(-4 - 2.5 * 0.05, 0, 0), u_m=(4, 0, 0), v_m=(0, 4, 0)
    )
    wall = scenes.rectangle("wall", "matt", centre_m=(0, 0, -10), u_m=(9, 0, 0), v_m=(0, 9, 0))
    noisy = {
        "pattern": {"shape": "raster", "rays": 2000, "columns": 1, "rows": 1, "divergence_rad": THETA,
                    "pulse_energy_j": 1e-6},
        "receiver": options,
        "noise": {"shot": False, "range_m": 0.0, "receiver_e": 0.05 * all_e / 6},
    }  # fmt: skip
    assert sense([plate, wall], noisy, t_m=(0, 0, 20)).arrays["range_m"][0] == pytest.approx(30, abs=1)


def test_surfaces_within_half_a_pulse_are_one_echo(sense):
    """A pulse of 3 ns tells surfaces apart that are more than 0.45 m from each other."""
    gap_m = c * 3e-9 / 2
    for behind_m, resolved in ((0.9 * gap_m, False), (1.1 * gap_m, True)):
        arrays = edge(sense, 0.0, "first", behind_m=behind_m).arrays
        middle_m = 20 if resolved else 20 + behind_m / 2
        assert arrays["range_m"][0] == pytest.approx(middle_m, abs=0.02)


def test_a_pixel_of_a_flash_is_divided_evenly(sense):
    """A pixel whose left 70 % see a plate, and whose other part a wall behind."""
    width_m = 20 * math.tan(math.radians(0.5)) * 2
    plate = scenes.rectangle(
        "plate", "matt", centre_m=(0.2 * width_m - 4, 0, 0), u_m=(4, 0, 0), v_m=(0, 9, 0)
    )
    wall = scenes.rectangle("wall", "matt", centre_m=(0, 0, -10), u_m=(30, 0, 0), v_m=(0, 30, 0))
    options = {
        "pattern": {
            "shape": "flash",
            "width_px": 1,
            "height_px": 1,
            "hfov_deg": 1,
            "rays_per_side": 50,
        },
        "ranging": {"echo": "centroid"},
        "noise": EXACT,
        "receiver": {"saturation_e": None},
    }
    found_m = sense([plate, wall], options, t_m=(0, 0, 20)).arrays["range_m"][0]
    near, far = 0.7 / 20**2, 0.3 / 30**2
    assert found_m == pytest.approx((near * 20 + far * 30) / (near + far), abs=0.02)


def test_a_beam_off_the_spacecraft_meets_it_with_its_rim(sense):
    """Its axis meets nothing, and the part of it that does returns."""
    plate = scenes.rectangle("plate", "matt", centre_m=(-4.03, 0, 0), u_m=(4, 0, 0), v_m=(0, 4, 0))
    pattern = {"shape": "raster", "rays": 500, "columns": 1, "rows": 1, "divergence_rad": THETA}
    reading = sense([plate], {"pattern": pattern, "noise": EXACT}, t_m=(0, 0, 20))
    assert np.isnan(reading.arrays["true_range_m"][0])
    assert reading.arrays["range_m"][0] == pytest.approx(20, abs=1e-2)
    assert reading.labels["returns"] == 1


def test_the_cross_section_is_gaussian():
    """Mean, variances and encircled energy of the rays, in all directions of the axis."""
    rng = np.random.default_rng(1)
    axis = rng.normal(size=(20, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    rays = gaussian_beam(axis, 4e-3, 1000)
    np.testing.assert_allclose(rays[:, 0], axis, rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1, rtol=1e-12)
    off = rays - np.sum(rays * axis[:, None], -1, keepdims=True) * axis[:, None]
    np.testing.assert_allclose(off.mean(axis=1), 0, atol=1e-8)
    np.testing.assert_allclose(np.sum(off**2, -1).mean(axis=1), 2 * 1e-6, rtol=2e-3)
    # Within the divergence, the full angle at 1/e², there are 86.5 % of the energy.
    inside = (np.linalg.norm(off, axis=-1) < 2e-3).mean(axis=1)
    np.testing.assert_allclose(inside, 1 - math.exp(-2), atol=2e-3)


def one_by_one(range_m, signal, gap_m, which, threshold):
    """One beam's echo, ray by ray."""
    order = sorted((r, k) for k, r in enumerate(range_m) if math.isfinite(r))
    groups: list[list[int]] = []
    for r, ray in order:
        if groups and (which == "centroid" or r - range_m[groups[-1][-1]] <= gap_m):
            groups[-1].append(ray)
        else:
            groups.append([ray])
    totals = [sum(signal[ray] for ray in group) for group in groups]
    if not totals or max(totals) == 0:
        return 0.0, math.nan
    best = totals.index(max(totals))
    if which == "first":
        best = next((i for i, total in enumerate(totals) if total > 0 and total >= threshold), best)
    group = groups[best]
    return totals[best], sum(signal[ray] * range_m[ray] for ray in group) / totals[best]


@given(st.integers(0, 2**32 - 1), st.sampled_from(["first", "strongest", "centroid"]), st.integers(1, 8))
def test_echoes_of_many_beams_are_those_of_each(seed, which, rays):
    rng = np.random.default_rng(seed)
    range_m = np.where(rng.random((30, rays)) < 0.3, np.inf, rng.uniform(5, 8, (30, rays)))
    signal = np.where(np.isfinite(range_m), rng.integers(0, 9, (30, rays)), 0).astype(float)
    threshold = rng.uniform(0, 15, 30)
    found = echoes(range_m, signal, 0.4, which, threshold)
    for i in range(30):
        total, mean_m = one_by_one(range_m[i], signal[i], 0.4, which, threshold[i])
        assert found.signal[i] == pytest.approx(total)
        np.testing.assert_allclose(found.range_m[i], mean_m, rtol=1e-12)


def test_the_material_of_each_surface_counts(sense):
    """A dark plate before a bright wall: the wall is stronger although the beam is on the plate."""
    black, white = Material("black", (0.02, 0.02, 0.02), specular=0.0), Material("white", specular=0.0)
    plate = scenes.rectangle("plate", "black", centre_m=(-4, 0, 0), u_m=(4, 0, 0), v_m=(0, 4, 0))
    wall = scenes.rectangle("wall", "white", centre_m=(0, 0, -10), u_m=(9, 0, 0), v_m=(0, 9, 0))
    options = {
        "pattern": {"shape": "raster", "rays": 50, "columns": 1, "rows": 1, "divergence_rad": THETA},
        "ranging": {"echo": "strongest"},
        "noise": EXACT,
    }
    arrays = sense([plate, wall], options, t_m=(0, 0, 20), materials=(black, white)).arrays
    assert arrays["part_id"][0] == 1
    assert arrays["range_m"][0] == pytest.approx(30, abs=1e-3)
