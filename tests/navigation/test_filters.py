"""``ekf`` and ``ukf`` on a rendezvous of which everything is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rendezvous import World, errors, nees

from posse_core import Burn, ThrusterErrors
from posse_core._navigation.kalman import EkfNavigator, KalmanNavigator, UkfNavigator
from posse_core._navigation.options import KalmanOptions

KINDS = [EkfNavigator, UkfNavigator]


def flown(kind: type[KalmanNavigator], world: World, rng, options=None, known=None, **what):
    """A navigator after all frames of a world."""
    navigator = kind(options or KalmanOptions())
    navigator.start(world.problem(rng, **(known or {})))
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


@pytest.mark.parametrize("kind", KINDS)
def test_an_eccentric_orbit_is_followed(kind):
    """From perigee at e = 0.5, with a minute between frames."""
    world = World(e=0.5, t_s=np.arange(0.0, 1500.0, 60.0))
    navigator = flown(kind, world, np.random.default_rng(1))
    truth = world.truth()[-1]
    assert nees(truth, navigator.estimate(truth.t_s)) < 30.0
    assert np.linalg.norm(errors(truth, navigator.estimate(truth.t_s))[:3]) < 2.0


@pytest.mark.parametrize("what", ["pose", "sight+range"])
def test_other_readings_serve_as_well(what):
    world = World()
    navigator = flown(EkfNavigator, world, np.random.default_rng(2), what=what)
    truth = world.truth()[-1]
    estimate = navigator.estimate(truth.t_s)
    assert np.linalg.norm(errors(truth, estimate)[:3]) < 0.3
    assert (estimate.q_eci_from_body is not None) == (what == "pose")
    assert nees(truth, estimate) < 36.0


BURNS = (Burn(45.0, np.array([0.02, -0.01, 0.03])), Burn(95.0, np.array([-0.01, 0.04, 0.0])))


@pytest.mark.parametrize("kind", KINDS)
def test_readings_that_arrive_after_a_later_impulse_count_the_same(kind):
    """Delayed by 12 s, each arrives after the impulse that follows it; the result is the same."""
    world = World(t_s=np.arange(0.0, 150.0, 10.0), burns=BURNS)
    known = {"thrusters": ThrusterErrors(size=0.02, direction_rad=0.01)}
    estimates = []
    for delay_s in (0.0, 12.0):
        rng = np.random.default_rng(4)
        navigator = kind(KalmanOptions())
        navigator.start(world.problem(rng, **known))
        events = [(r.arrives_s, 1, r) for r in world.readings(rng, delay_s=delay_s)]
        events += [(burn.t_s, 0, burn) for burn in BURNS]
        for now_s, _, event in sorted(events, key=lambda event: event[:2]):
            if isinstance(event, Burn):
                navigator.burned(event)
            else:
                navigator.update(event)
            navigator.estimate(now_s)
        estimates.append(navigator.estimate(200.0))
    for name in ("r_rtn_m", "v_rtn_m_s", "covariance", "q_eci_from_body", "omega_body_rad_s"):
        np.testing.assert_array_equal(getattr(estimates[0], name), getattr(estimates[1], name))
    truth = world.truth(np.array([200.0]))[0]
    assert np.linalg.norm(errors(truth, estimates[0])[:3]) < 3.0


def test_an_impulse_that_was_carried_out_badly_is_seen_and_expected():
    """A tenth too strong, as a standard deviation of 5 % allows for; without it that is a surprise."""
    commanded = Burn(75.0, np.array([0.0, 0.5, 0.0]))
    world = World(
        t_s=np.arange(0.0, 150.0, 10.0),
        burns=(replace(commanded, dv_rtn_m_s=1.1 * commanded.dv_rtn_m_s),),
    )
    surprises = {}
    for size in (0.0, 0.05):
        rng = np.random.default_rng(5)
        navigator = EkfNavigator(KalmanOptions())
        navigator.start(world.problem(rng, thrusters=ThrusterErrors(size=size)))
        navigator.burned(commanded)
        innovations = [navigator.update(r) for r in world.readings(rng)]
        surprises[size] = innovations[9].nis
    assert surprises[0.05] < 60.0
    assert surprises[0.0] > 2 * surprises[0.05]


def test_a_line_of_sight_holds_the_direction_where_keypoints_are_refused():
    world = World(t_s=np.arange(0.0, 200.0, 10.0))
    rng = np.random.default_rng(6)
    readings = world.readings(rng)
    sights = world.readings(np.random.default_rng(7), what="sight+range")
    navigator = EkfNavigator(KalmanOptions())
    navigator.start(world.problem(rng))
    for k, (read, sight) in enumerate(zip(readings, sights, strict=True)):
        if k >= 5:
            points_px = read.keypoints.points_px + rng.uniform(-80, 80, (11, 2))
            keypoints = replace(read.keypoints, points_px=points_px)
            read = replace(sight, keypoints=keypoints)
        innovation = navigator.update(read)
    assert innovation.rejected == 22
    assert innovation.dof == 22 + 2 + 1
    truth = world.truth()[-1]
    assert np.linalg.norm(errors(truth, navigator.estimate(truth.t_s))[:3]) < 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_a_camera_that_looks_away_is_no_catastrophe(kind):
    """Its attitude is read as turned by 180°, so the whole target should be behind it."""
    world = World(t_s=np.arange(0.0, 150.0, 10.0))
    rng = np.random.default_rng(8)
    navigator = kind(KalmanOptions())
    navigator.start(world.problem(rng))
    for read in world.readings(rng):
        if read.index == 7:
            w, x, y, z = read.q_eci_from_camera
            read = replace(read, q_eci_from_camera=np.array([-y, z, w, -x]))
        innovation = navigator.update(read)
        assert innovation is None or np.isfinite(innovation.nis)
        assert np.isfinite(navigator.estimate(read.t_s).covariance).all()
    truth = world.truth()[-1]
    error = errors(truth, navigator.estimate(truth.t_s))
    assert np.linalg.norm(error[:3]) < 1.0
    assert np.degrees(np.linalg.norm(error[6:9])) < 3.0
