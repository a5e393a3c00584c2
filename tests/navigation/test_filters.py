"""``ekf`` and ``ukf`` on a rendezvous of which everything is known."""

from __future__ import annotations

import numpy as np
import pytest
from rendezvous import World, errors

from posse_core._navigation.kalman import EkfNavigator, KalmanNavigator, UkfNavigator
from posse_core._navigation.options import KalmanOptions

KINDS = [EkfNavigator, UkfNavigator]


def flown(kind: type[KalmanNavigator], world: World, rng, options=None, **what):
    """A navigator after all frames of a world."""
    navigator = kind(options or KalmanOptions())
    navigator.start(world.problem(rng))
    for readings in world.readings(rng, **what):
        navigator.update(readings)
    return navigator


@pytest.mark.parametrize("kind", KINDS)
def test_a_tumbling_target_is_known_after_half_a_turn(kind):
    """Keypoints of 1 px: attitude within 2° and rate within 5 %."""
    rate = np.array([0.01, -0.02, 0.012])
    half_turn_s = np.pi / np.linalg.norm(rate)
    world = World(rate_body_rad_s=rate, t_s=np.arange(0.0, half_turn_s, 10.0))
    navigator = flown(kind, world, np.random.default_rng(3))
    truth = world.truth()[-1]
    error = errors(truth, navigator.estimate(truth.t_s))
    assert np.degrees(np.linalg.norm(error[6:9])) < 2.0
    assert np.linalg.norm(error[9:]) < 0.05 * np.linalg.norm(rate)
    assert np.linalg.norm(error[:3]) < 1.0
