"""The motions of SHIRT: a hold before a target that spins about one axis, an approach to one that
tumbles without torque."""

import numpy as np
import pytest

from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._trajectory.build import make_trajectory


def motion(name):
    registry = load_plugins().registry
    return make_trajectory(load_scenario(name, registry, {}), registry)


def test_the_first_holds_before_a_steady_spin():
    """SHIRT: 2371 images, 5 s apart, over two orbits; the target turns once in six minutes."""
    trajectory = motion("shirt-roe1")
    assert len(trajectory) == 2371
    np.testing.assert_allclose(np.diff(trajectory.t_s), 5.0)
    ranges_m = np.linalg.norm(trajectory.r_chaser_rtn_m, axis=1)
    assert 7.3 < ranges_m.min() < ranges_m.max() < 8.1
    rates_deg_s = np.degrees(trajectory.omega_body_rad_s)
    assert rates_deg_s[:, 0] == pytest.approx(1.0, abs=1e-3)
    assert np.abs(rates_deg_s[:, 1:]).max() < 0.01


def test_the_second_approaches_a_tumbling_target():
    trajectory = motion("shirt-roe2")
    assert len(trajectory) == 2371
    along_m = trajectory.r_chaser_rtn_m[:, 1]
    assert along_m[0] == pytest.approx(7.7, abs=0.3)
    assert along_m[-1] == pytest.approx(2.9, abs=0.3)
    orbit = 1185
    assert np.all(along_m[:-orbit] - along_m[orbit:] > 2.0)  # each orbit brings it nearer
    turned = np.degrees(np.ptp(trajectory.omega_body_rad_s, axis=0))
    assert (turned > 0.3).all()  # the axis goes through the whole body
    still_deg_s = np.degrees(np.linalg.norm(trajectory.omega_body_rad_s, axis=1))
    assert 0.6 < still_deg_s.min() < still_deg_s.max() < 0.8
