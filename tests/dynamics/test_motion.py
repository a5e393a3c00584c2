"""Forces and integrated motion: what is conserved, and closed forms of each force."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._constants import EARTH_ROTATION_RATE_RAD_S, Constants
from posse_core._dynamics import elements, forces, j2
from posse_core._dynamics.nonlinear import Body, ForceModel, equations, integrate

CONSTANTS = Constants()
MU, RADIUS, J2 = CONSTANTS.mu_earth_m3_s2, CONSTANTS.earth_radius_m, CONSTANTS.j2
ZERO = np.zeros(3)


def flown(orbit: Any, orbits: float, model: ForceModel, count: int = 9) -> tuple[Any, Any, Any]:
    """Times, positions and velocities of an orbit, by itself."""
    r, v = elements.state_from_keplerian(np.asarray(orbit), MU)
    t_s = np.linspace(0, orbits * 2 * np.pi * np.sqrt(orbit[0] ** 3 / MU), count)
    r, v, _, _ = integrate((r, v, ZERO, ZERO), t_s, model, CONSTANTS)
    return t_s, r, v


def energy(r: Any, v: Any, j2_value: float) -> Any:
    distance = np.linalg.norm(r, axis=-1)
    sine = r[..., 2] / distance
    oblate = MU * j2_value * RADIUS**2 / (2 * distance**3) * (3 * sine**2 - 1)
    return np.sum(v**2, axis=-1) / 2 - MU / distance + oblate


orbit_cases = st.sampled_from(
    [
        (7.0e6, 0.0, 0.0),
        (7.2e6, 1e-4, 1.7),
        (1.6e7, 0.52, 2.3),
        (7.0e7, 0.9, 1.1),
        (4.2164e7, 0.0, np.pi),
    ]
)


@given(orbit_cases, st.tuples(*[st.floats(-3, 3)] * 3), st.sampled_from(["two-body", "j2"]))
def test_energy_and_momentum_about_the_axis_are_kept(shape: Any, rest: Any, gravity: Any) -> None:
    _, r, v = flown((*shape, *rest), 10, ForceModel(gravity))
    value = energy(r, v, J2 if gravity == "j2" else 0.0)
    assert np.ptp(value) < 1e-11 * abs(value[0])
    h = np.cross(r, v)
    assert np.ptp(h[:, 2]) < 1e-11 * np.linalg.norm(h[0])
    if gravity == "two-body":
        assert np.max(np.abs(h - h[0])) < 1e-11 * np.linalg.norm(h[0])


SWINGING = [(7.1e6, 1e-3, 1.7, 1.0, 2.0, 3.0), (1.6e7, 0.52, 2.3, 1.0, 2.0, 0.5), (7e6, 0, 0.3, 0, 0, 0)]


@pytest.mark.parametrize(
    ("orbit", "theory"),
    [
        *((orbit, "canonical") for orbit in SWINGING),
        # The published one leaves a part of the order e J2 in the longitude.
        *((orbit, "brouwer-lyddane") for orbit in SWINGING if orbit[1] < 0.01),
    ],
)
def test_mean_elements_stay_where_osculating_ones_swing(orbit: Any, theory: Any) -> None:
    t_s, r, v = flown(orbit, 1, ForceModel("j2"), 41)
    osculating = elements.qns_from_state(r, v, MU)
    mean = j2.mean_from_osculating(osculating, CONSTANTS, theory)
    secular = j2.j2_secular(mean[0], CONSTANTS, t_s)
    # First order takes out all but a part of the order J2.
    for k in (0, 2, 3, 4):
        assert np.max(np.abs(mean - secular)[:, k]) < 8e-3 * np.ptp(osculating[:, k])


@given(st.floats(0, 0.7), st.floats(0, np.pi), *[st.floats(-3, 3)] * 3)
def test_canonical_mean_elements_have_no_singular_orbit(
    e: float, i: float, raan: float, argp: float, anomaly: float
) -> None:
    osculating = elements.qns_from_keplerian(np.array([7e6 / (1 - e), e, i, raan, argp, anomaly]))
    mean = j2.mean_from_osculating(osculating, CONSTANTS, "canonical")
    again = j2.osculating_from_mean(mean, CONSTANTS, "canonical")
    r, _ = elements.state_from_qns(osculating, MU)
    r_2, _ = elements.state_from_qns(again, MU)
    assert np.linalg.norm(r_2 - r) < 1e-12 * np.linalg.norm(r) / (1 - e)
    r_mean, _ = elements.state_from_qns(mean, MU)
    assert np.linalg.norm(r_mean - r) < 0.02 * np.linalg.norm(r)


def test_secular_rates_are_those_of_sun_synchronous_orbits() -> None:
    # 800 km, 98.6°: one turn of the node a year (Vallado 2013, section 11.4.1).
    start = elements.qns_from_keplerian(np.array([RADIUS + 800e3, 0.0, np.radians(98.6029), 0, 0, 0]))
    year_s = 365.2422 * 86400
    end = j2.j2_secular(start, CONSTANTS, year_s)
    assert (end[5] - start[5]) / (2 * np.pi) == pytest.approx(1.0, abs=2e-3)


def test_there_and_back_is_nowhere() -> None:
    r, v = elements.state_from_keplerian(np.array([7.2e6, 0.01, 1.0, 2.0, 3.0, 0.5]), MU)
    start = (r, v, np.array([10.0, -50.0, 20.0]), np.array([0.01, 0.02, -0.03]))
    model = ForceModel("j2")
    out = integrate(start, np.array([-9000.0]), model, CONSTANTS)
    back = integrate(tuple(x[0] for x in out), np.array([9000.0]), model, CONSTANTS)
    assert np.max(np.abs(back[2][0] - start[2])) < 1e-6
    assert np.max(np.abs(back[0][0] - r)) < 1e-3


def test_times_may_repeat_and_stand_in_any_order() -> None:
    r, v = elements.state_from_keplerian(np.array([7.2e6, 0.01, 1.0, 2.0, 3.0, 0.5]), MU)
    start = (r, v, np.array([10.0, -50.0, 20.0]), ZERO)
    t_s = np.array([500.0, 0.0, -300.0, 500.0, 100.0])
    many = integrate(start, t_s, ForceModel("j2"), CONSTANTS)
    for k, t in enumerate(t_s):
        one = integrate(start, np.array([t]), ForceModel("j2"), CONSTANTS)
        assert many[2][k] == pytest.approx(one[2][0], abs=1e-8)


def value(expression: Any) -> Any:
    return np.array(ca.DM(ca.evalf(expression))).ravel()


@given(st.tuples(*[st.floats(-1e7, 1e7)] * 3), st.tuples(*[st.floats(-1e4, 1e4)] * 3))
def test_the_difference_of_two_attractions_is_the_difference(r: Any, dr: Any) -> None:
    r, dr = np.array(r) + np.array([7e6, 0, 0]), np.array(dr)
    if min(np.linalg.norm(r), np.linalg.norm(r + dr)) < 1e6:
        return
    whole = -MU * (r + dr) / np.linalg.norm(r + dr) ** 3 + MU * r / np.linalg.norm(r) ** 3
    got = value(forces.two_body_difference(ca.DM(r), ca.DM(dr), MU))
    assert got == pytest.approx(whole, abs=1e-14 * MU / np.linalg.norm(r) ** 2)


def test_oblateness_is_the_slope_of_its_potential() -> None:
    r = np.array([5e6, -3e6, 4e6])

    def potential(at: Any) -> float:
        distance = float(np.linalg.norm(at))
        return -MU * J2 * RADIUS**2 / (2 * distance**3) * (3 * at[2] ** 2 / distance**2 - 1)

    slope = [(potential(r + h) - potential(r - h)) / 200 for h in 100 * np.eye(3)]
    assert value(forces.oblateness(ca.DM(r), MU, RADIUS, J2)) == pytest.approx(np.array(slope), rel=1e-6)


def test_third_body_is_a_tide() -> None:
    # Far body along x: +2μ/d³ along it, −μ/d³ across, per metre.
    d, mu_sun = 1.5e11, 1.327e20
    body = ca.DM([d, 0, 0])
    along = value(forces.third_body(ca.DM([7e6, 0, 0]), body, mu_sun))
    across = value(forces.third_body(ca.DM([0, 7e6, 0]), body, mu_sun))
    assert along[0] == pytest.approx(2 * mu_sun / d**3 * 7e6, rel=1e-3)
    assert across[1] == pytest.approx(-mu_sun / d**3 * 7e6, rel=1e-3)


def test_drag_is_against_the_wind_and_falls_with_height() -> None:
    r, v = np.array([RADIUS + 400e3, 0, 0]), np.array([0.0, 7000.0, 3000.0])
    pull = value(forces.drag(ca.DM(r), ca.DM(v), RADIUS, EARTH_ROTATION_RATE_RAD_S, 0.02))
    wind = v - EARTH_ROTATION_RATE_RAD_S * np.array([0, r[0], 0])
    # Vallado's table 8-4 has 3.725e-12 kg/m³ at 400 km.
    assert pull == pytest.approx(-0.5 * 3.725e-12 * 0.02 * np.linalg.norm(wind) * wind, rel=1e-6)
    heights = np.linspace(120e3, 1000e3, 60)
    rho = [float(forces.density(ca.DM([RADIUS + h, 0, 0]), RADIUS)) for h in heights]
    assert np.all(np.diff(rho) < 0)


def test_solar_pressure_pushes_from_the_sun_and_stops_in_the_shadow() -> None:
    sun = ca.DM([CONSTANTS.au_m, 0, 0])
    pressure = CONSTANTS.solar_constant_w_m2 / 299792458.0

    def push(r: Any) -> Any:
        return value(
            forces.solar_pressure(
                ca.DM(r), sun, pressure, CONSTANTS.au_m, RADIUS, CONSTANTS.sun_radius_m, 0.02
            )
        )

    # The Sun stands 7e6/au = 5e-5 rad off the x axis.
    assert push([0, 7e6, 0]) == pytest.approx(np.array([-pressure * 0.02, 0, 0]), abs=1e-11)
    assert np.all(push([-7e6, 0, 0]) == 0)
    # The shadow's edge: half the light where the Sun's centre sets.
    angle = np.arcsin(RADIUS / 7e6)
    half = push([-7e6 * np.cos(angle), 7e6 * np.sin(angle), 0])
    assert np.linalg.norm(half) == pytest.approx(pressure * 0.02 / 2, rel=0.02)


def test_differential_drag_pulls_the_draggier_craft_ahead_and_down() -> None:
    r, v = elements.state_from_keplerian(np.array([RADIUS + 350e3, 0.0, 0.9, 0, 0, 0]), MU)
    t_s = np.array([2 * np.pi * np.sqrt((RADIUS + 350e3) ** 3 / MU)])
    _, v_end, dr, _ = integrate((r, v, ZERO, ZERO), t_s, ForceModel(drag_m2_kg=(0.01, 0.03)), CONSTANTS)
    along = dr[0] @ v_end[0] / np.linalg.norm(v_end[0])
    # Constant deceleration f on a circle: 3/2 f t² ahead, plus what oscillates at the orbit's rate.
    f = 0.5 * float(forces.density(ca.DM(r), RADIUS)) * 0.02 * 7690**2
    assert along == pytest.approx(1.5 * f * t_s[0] ** 2, rel=0.15)


def test_a_body_follows_its_series() -> None:
    x = np.polynomial.chebyshev.Chebyshev([1.0, 2.0, -0.5, 0.25], domain=[-100, 300])
    body = Body(np.stack([x.coef, 2 * x.coef, 0 * x.coef]), (-100.0, 300.0))
    for t in (-100.0, 7.0, 300.0):
        assert value(body.position(ca.DM(t))) == pytest.approx(np.array([x(t), 2 * x(t), 0]), abs=1e-13)


def test_the_equations_are_the_forces() -> None:
    rates = equations(ForceModel("j2"), CONSTANTS)
    r, v = np.array([7e6, 1e5, -2e6]), np.array([10.0, 7400.0, 300.0])
    apart, speed = np.array([100.0, -40.0, 20.0]), np.array([0.1, 0.2, 0.3])
    _, chief, _, relative = (np.array(x).ravel() for x in rates(r, v, apart, speed, 0.0))

    def pull(at: Any) -> Any:
        return value(forces.two_body(ca.DM(at), MU) + forces.oblateness(ca.DM(at), MU, RADIUS, J2))

    assert chief == pytest.approx(pull(r), rel=1e-14)
    assert relative == pytest.approx(pull(r + apart) - pull(r), abs=1e-14)
