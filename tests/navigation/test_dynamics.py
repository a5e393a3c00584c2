"""The flow of motion and attitude against integration by SciPy, closed forms and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendezvous import World
from scipy.integrate import solve_ivp

from posse_core._attitude.tumbling import torque_free_attitude
from posse_core._constants import Constants
from posse_core._dynamics.forces import oblateness
from posse_core._frames import matrix_from_rotation_vector
from posse_core._navigation.dynamics import Dynamics
from posse_core._navigation.kinematics import Kinematics
from posse_core._navigation.linearisation import SigmaPoints, Tangents
from posse_core._navigation.options import DynamicsOptions

INERTIA = np.array([[1.0, 0.1, 0.0], [0.1, 1.7, -0.2], [0.0, -0.2, 2.2]])


def kinematics(dr=(10.0, -60.0, 15.0), dv=(0.05, -0.02, 0.01), omega=(0.01, 0.03, -0.02)) -> Kinematics:
    R = matrix_from_rotation_vector(np.array([0.4, 1.0, -0.7]))
    return Kinematics(np.array(dr), np.array(dv), R, np.array(omega))


@pytest.mark.parametrize("gravity", ["two-body", "j2"])
def test_the_orbits_are_those_of_two_spacecraft_integrated_apart(gravity):
    """Target and chaser by DOP853 in geocentric coordinates, for an hour from perigee at e = 0.5."""
    dynamics = Dynamics(World(e=0.5).target, None, DynamicsOptions(dynamics=gravity))
    at, x = dynamics.instant(0.0), kinematics()
    c = Constants()

    def rate(_t, state):
        r = state[:3]
        a = -c.mu_earth_m3_s2 * r / np.linalg.norm(r) ** 3
        if gravity == "j2":
            bulge = oblateness(r, c.mu_earth_m3_s2, c.earth_radius_m, c.j2)
            a = a + np.array(bulge, float).ravel()
        return np.concatenate([state[3:], a])

    def after(r, v):
        start = np.concatenate([r, v])
        return solve_ivp(rate, (0, 3600.0), start, "DOP853", rtol=3e-14, atol=1e-9).y[:, -1]

    target = after(at.r_eci_m, at.v_eci_m_s)
    chaser = after(at.r_eci_m + x.dr_eci_m, at.v_eci_m_s + x.dv_eci_m_s)
    flow = dynamics.flow(at, x, 3600.0)
    np.testing.assert_allclose(flow.at.r_eci_m, target[:3], atol=0.5)
    np.testing.assert_allclose(flow.x.dr_eci_m, (chaser - target)[:3], atol=2e-4)
    np.testing.assert_allclose(flow.x.dv_eci_m_s, (chaser - target)[3:], atol=2e-7)


@pytest.mark.parametrize("omega", [(0.01, 0.03, -0.02), (0.0, 0.0, 0.5), (0.1, 0.001, 0.0), (0, 0, 0)])
def test_the_attitude_is_that_of_the_closed_form(omega):
    dynamics = Dynamics(World().target, INERTIA, DynamicsOptions())
    x = kinematics(omega=omega)
    turned = torque_free_attitude(INERTIA, np.array(omega, float), x.R_eci_from_body, np.array([100.0]))[
        0
    ]
    flow = dynamics.flow(dynamics.instant(0.0), x, 100.0)
    np.testing.assert_allclose(flow.x.R_eci_from_body, turned, atol=3e-5)


def test_an_unknown_inertia_is_a_constant_rate():
    dynamics = Dynamics(World().target, None, DynamicsOptions())
    x = kinematics(omega=(0.0, 1.5, 0.3))
    flow = dynamics.flow(dynamics.instant(0.0), x, 60.0)
    turn = matrix_from_rotation_vector(60.0 * x.omega_body_rad_s)
    np.testing.assert_allclose(flow.x.R_eci_from_body, x.R_eci_from_body @ turn, atol=1e-13)
    np.testing.assert_array_equal(flow.x.omega_body_rad_s, x.omega_body_rad_s)


small = st.floats(-1.0, 1.0)


@settings(max_examples=25, deadline=None)
@given(
    omega=st.tuples(small, small, small).map(lambda w: 0.1 * np.array(w)),
    span_s=st.floats(0.5, 120.0),
    known=st.booleans(),
    e=st.sampled_from([0.0, 0.1, 0.5]),
)
def test_the_transition_is_the_derivative_of_the_flow(omega, span_s, known, e):
    dynamics = Dynamics(World(e=e).target, INERTIA if known else None, DynamicsOptions(dynamics="j2"))
    at, x = dynamics.instant(0.0), kinematics(omega=omega)
    flow = dynamics.flow(at, x, span_s)
    step = np.repeat([1.0, 1e-3, 1e-4, 1e-6], 3)
    plus = dynamics.moved(at, x.plus(np.diag(step)), span_s).minus(flow.x)
    minus = dynamics.moved(at, x.plus(-np.diag(step)), span_s).minus(flow.x)
    difference = ((plus - minus) / (2 * step[:, None])).T
    scale = np.repeat([1.0, 1.0 / span_s, 1.0, 1.0], 3)[:, None] * (1 + span_s)
    np.testing.assert_allclose(flow.transition / scale, difference / scale, atol=2e-5)


def test_process_noise_grows_as_a_sample_of_random_walks():
    """Against white accelerations in steps of a second, over a minute; the orbit hardly matters then."""
    options = DynamicsOptions(acceleration_m_s2_rthz=1e-3, angular_acceleration_deg_s2_rthz=0.01)
    dynamics = Dynamics(World().target, None, options)
    noise = dynamics.flow(dynamics.instant(0.0), kinematics(omega=(0, 0, 0)), 60.0).noise
    rng = np.random.default_rng(0)
    steps = rng.standard_normal((4000, 600)) * 1e-3 / np.sqrt(0.1)
    speed = np.cumsum(steps, axis=1) * 0.1
    way = np.sum(speed, axis=1) * 0.1
    sample = np.cov(way, speed[:, -1])
    for k in range(3):
        found = noise[np.ix_([k, 3 + k], [k, 3 + k])]
        np.testing.assert_allclose(found, sample, rtol=0.07)
        turning = noise[np.ix_([6 + k, 9 + k], [6 + k, 9 + k])]
        np.testing.assert_allclose(turning, sample * np.radians(10.0) ** 2, rtol=0.07)


def test_a_flow_there_and_back_is_none():
    dynamics = Dynamics(World(e=0.5).target, INERTIA, DynamicsOptions(dynamics="j2"))
    at, x = dynamics.instant(0.0), kinematics()
    there = dynamics.flow(at, x, 700.0)
    back = dynamics.flow(there.at, there.x, 0.0)
    np.testing.assert_allclose(back.x.minus(x), 0.0, atol=3e-5)


def test_sigma_points_and_tangents_agree_where_the_covariance_is_small():
    dynamics = Dynamics(World().target, INERTIA, DynamicsOptions())
    at, x = dynamics.instant(0.0), kinematics()
    covariance = np.diag(np.repeat([1e-2, 1e-4, 1e-4, 1e-6], 3) ** 2)
    one = Tangents().flow(dynamics, at, x, covariance, 60.0, (1.0, 1.0))
    other = SigmaPoints().flow(dynamics, at, x, covariance, 60.0, (1.0, 1.0))
    np.testing.assert_allclose(other.transition, one.transition, atol=1e-4)
    np.testing.assert_allclose(other.x.minus(one.x), 0.0, atol=1e-7)
    np.testing.assert_allclose(other.noise, one.noise, atol=1e-9)
