"""The chaser's true motion and its thrusters: against a motion in one piece, and by statistics."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import Burn, Constants, Epoch, PropagationProblem, Start, Target, ThrusterErrors, create
from posse_core._flight.chaser import Chaser, carried_out, disturbed

EPOCH = Epoch.from_iso("2022-01-31T02:02:27.58")
TARGET = Target(np.array([7.1e6, 0.0, 0.0]), np.array([0.0, 2000.0, 8000.0]), Constants())
START = Start.from_rtn(TARGET, np.array([5.0, -60.0, 3.0]), np.array([0.0, 0.02, -0.01]))
BURNS = (
    Burn(30.0, np.array([0.01, 0.05, -0.02])),
    Burn(71.5, np.array([0.0, -0.03, 0.0])),
    Burn(400.0, np.array([-0.02, 0.0, 0.04])),
)


@pytest.mark.parametrize("name", ["roe", "nonlinear", "yamanaka-ankersen"])
def test_impulses_one_by_one_are_the_motion_with_all_of_them(name):
    """The propagator is given all impulses at once; the chaser fires them as it goes."""
    t_s = np.arange(0.0, 601.0, 50.0)
    problem = PropagationProblem(EPOCH, TARGET, (START,), t_s, BURNS)
    whole = create("propagator", name).propagate(problem)
    chaser = Chaser(create("propagator", name), problem, START)
    waiting = list(BURNS)
    for i, now_s in enumerate(t_s):
        while waiting and waiting[0].t_s <= now_s:
            chaser.fire(waiting.pop(0))
        rtn = chaser.at(now_s)
        np.testing.assert_allclose(rtn[:3], whole.r_chaser_rtn_m[i], atol=1e-6)
        np.testing.assert_allclose(rtn[3:], whole.v_chaser_rtn_m_s[i], atol=1e-9)


def test_errors_of_an_impulse_have_their_size_and_no_preferred_direction():
    errors = ThrusterErrors(size=0.02, direction_rad=0.03)
    dv = np.array([0.1, -0.2, 0.2])
    made = np.array([carried_out(dv, errors, np.random.default_rng(seed)) for seed in range(4000)])
    size = np.linalg.norm(made, axis=1) / 0.3 - 1
    assert abs(size.mean()) < 4 * 0.02 / np.sqrt(4000)
    assert size.std() == pytest.approx(0.02, rel=0.05)
    along = dv / 0.3
    across = made / np.linalg.norm(made, axis=1)[:, None] - along
    covariance = np.cov((across - (across @ along)[:, None] * along).T)
    wanted = 0.03**2 * (np.eye(3) - np.outer(along, along))
    np.testing.assert_allclose(covariance, wanted, atol=0.1 * 0.03**2)


def test_the_least_impulse():
    errors = ThrusterErrors(least_m_s=0.01)
    generator = np.random.default_rng(0)
    assert not carried_out(np.array([0.0, 0.0099, 0.0]), errors, generator).any()
    np.testing.assert_array_equal(
        carried_out(np.array([0.0, 0.0101, 0.0]), errors, generator), [0.0, 0.0101, 0.0]
    )


def test_a_disturbed_attitude_is_off_by_its_standard_deviation_about_each_axis():
    R = Rotation.from_rotvec([0.3, -1.0, 0.5]).as_matrix()
    off = np.array(
        [
            Rotation.from_matrix(R.T @ disturbed(R, 1e-3, np.random.default_rng(seed))).as_rotvec()
            for seed in range(2000)
        ]
    )
    np.testing.assert_allclose(np.cov(off.T), 1e-6 * np.eye(3), atol=1e-7)
