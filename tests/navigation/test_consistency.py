"""Whether the filters' errors are as large as their covariances say, over 50 flights each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from rendezvous import World, nees
from scipy.stats import chi2

from posse_core import random_generator
from posse_core._navigation.kalman import EkfNavigator, KalmanNavigator, UkfNavigator
from posse_core._navigation.options import KalmanOptions

SEEDS = 50
# The worlds have no process noise, so neither have the filters.
STILL = {"acceleration_m_s2_rthz": 1e-9, "angular_acceleration_deg_s2_rthz": 1e-7}
BIAS = {"bias_share": 0.007, "bias_time_s": 3600.0, "bias_angle_deg": 15.0, "bias_zoom": 1e6}


@dataclass
class Found:
    """Means over the seeds: NEES after the last frame, NIS over all frames but the first three."""

    motion: float
    whole: float
    nis: float
    nis_dof: int


def found(kind: type[KalmanNavigator], world: World, options: KalmanOptions, biased=False) -> Found:
    rows, nis = [], []
    (truth,) = world.truth(world.t_s[-1:])
    for seed in range(SEEDS):
        rng = random_generator(seed, 0, "navigation")
        navigator = kind(options)
        navigator.start(world.problem(rng, camera_attitude_rad=world.camera_attitude_rad))
        share = world.biases(rng, 0.007, 3600.0, np.radians(15.0)) if biased else 0.0
        innovations = [navigator.update(r) for r in world.readings(rng, poses=1, bias_share=share)]
        nis += [i.nis for i in innovations[3:]]
        estimate = navigator.estimate(truth.t_s)
        rows.append((nees(truth, estimate, slice(0, 6)), nees(truth, estimate)))
    motion, whole = np.mean(rows, axis=0)
    return Found(motion, whole, np.mean(nis), len(nis) * 22)


def within(value: float, dof: int, count: int) -> bool:
    """Whether the mean of ``count`` independent χ² of ``dof`` is in its central 95 %."""
    low, high = chi2.ppf([0.025, 0.975], dof * count) / count
    return bool(low < value < high)


@pytest.mark.parametrize("kind", [EkfNavigator, UkfNavigator])
def test_errors_and_innovations_are_as_large_as_the_filter_says(kind):
    """Keypoints of 1 px, white, and a camera whose attitude is known to 0.5 mrad."""
    world = World(t_s=np.arange(0.0, 120.0, 10.0), camera_attitude_rad=5e-4)
    options = KalmanOptions(bias_share=0.0, adaptive=False, **STILL)
    it = found(kind, world, options)
    assert within(it.motion, 6, SEEDS)
    assert within(it.whole, 12, SEEDS)
    assert within(it.nis, 22, it.nis_dof // 22)


def test_biased_keypoints_are_consistent_with_bias_states_and_not_without():
    world = World(t_s=np.arange(0.0, 120.0, 10.0))
    honest = found(EkfNavigator, world, KalmanOptions(adaptive=False, **BIAS, **STILL), biased=True)
    assert within(honest.motion, 6, SEEDS)
    assert within(honest.whole, 12, SEEDS)
    blind = KalmanOptions(bias_share=0.0, adaptive=False, **STILL)
    assert found(EkfNavigator, world, blind, biased=True).whole > 3 * 12


def test_the_keypoints_noise_is_learnt():
    """Noise of 2 px that the detector takes for 1 px: the factor on its variance becomes about 4."""
    world = World(t_s=np.arange(0.0, 300.0, 10.0), sigma_px=2.0)
    rng = np.random.default_rng(0)
    told = [
        (r, type(r.keypoints)(r.keypoints.points_body_m, r.keypoints.points_px, np.ones(11)))
        for r in world.readings(rng)
    ]
    scales = {}
    for adaptive in (True, False):
        navigator = EkfNavigator(KalmanOptions(bias_share=0.0, adaptive=adaptive))
        navigator.start(world.problem(np.random.default_rng(1)))
        nis = []
        for readings, keypoints in told:
            innovation = navigator.update(replace(readings, keypoints=keypoints))
            nis.append(innovation.nis / innovation.dof if innovation else np.nan)
        scales[adaptive] = np.mean(nis[15:])
    assert 0.7 < scales[True] < 1.5
    assert scales[False] > 2.5
