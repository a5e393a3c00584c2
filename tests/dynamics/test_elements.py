"""Elements, states and relative elements: what must hold for every orbit, singular ones included."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._constants import Constants
from posse_core._dynamics import elements, roe
from posse_core._dynamics.kepler import ECCENTRIC_LONGITUDE, eccentric_longitude_rad

MU = Constants().mu_earth_m3_s2
ECCENTRICITIES = (0.0, 1e-12, 1e-8, 1e-4, 0.1, 0.52, 0.9, 0.99)
INCLINATIONS = (0.0, 1e-10, 0.9, np.pi / 2, 2.3, np.pi - 1e-8, np.pi)
angles = st.floats(-np.pi, np.pi)


@st.composite
def orbits(draw: Any, eccentricities: Any = ECCENTRICITIES, inclinations: Any = INCLINATIONS) -> Any:
    e = draw(st.sampled_from(eccentricities))
    a = draw(st.floats(6.6e6, 50e6)) / (1 - e)
    return np.array([a, e, draw(st.sampled_from(inclinations)), *(draw(angles) for _ in range(3))])


def relative(got: Any, wanted: Any) -> float:
    return float(np.linalg.norm(got - wanted) / np.linalg.norm(wanted))


@given(orbits())
def test_a_state_survives_the_way_through_the_elements(orbit: Any) -> None:
    r, v = elements.state_from_keplerian(orbit, MU)
    again = elements.keplerian_from_state(r, v, MU)
    assert np.all(np.isfinite(again))
    r_2, v_2 = elements.state_from_keplerian(again, MU)
    assert relative(r_2, r) < 1e-12
    assert relative(v_2, v) < 1e-12


@given(orbits())
def test_energy_and_momentum_are_those_of_the_elements(orbit: Any) -> None:
    r, v = elements.state_from_keplerian(orbit, MU)
    a, e, i = orbit[:3]
    h = np.cross(r, v)
    # Vis-viva and h² = μ a (1 − e²); the energy is a difference of numbers 1/(1 − e) times larger.
    assert v @ v / 2 - MU / np.linalg.norm(r) == pytest.approx(-MU / (2 * a), rel=1e-12 / (1 - e))
    assert np.linalg.norm(h) == pytest.approx(np.sqrt(MU * a * (1 - e**2)), rel=1e-12)
    assert h[2] / np.linalg.norm(h) == pytest.approx(np.cos(i), abs=1e-12)


@given(orbits(inclinations=(0.02, 0.9, np.pi / 2, 2.3, np.pi - 0.02)), st.sampled_from([-1.0, 1.0]))
def test_both_equinoctial_sets_stand_for_the_same_orbit(orbit: Any, sign: float) -> None:
    qns = elements.qns_from_keplerian(orbit)
    equinoctial = elements.equinoctial_from_qns(qns, sign)
    r, v = elements.state_from_equinoctial(equinoctial, sign, MU)
    wanted_r, wanted_v = elements.state_from_qns(qns, MU)
    assert relative(r, wanted_r) < 1e-11
    assert relative(v, wanted_v) < 1e-11
    back = elements.qns_from_equinoctial(equinoctial, sign)
    assert np.exp(1j * back[[1, 5]]) == pytest.approx(np.exp(1j * qns[[1, 5]]), abs=1e-12)
    assert back[2:5] == pytest.approx(qns[2:5], abs=1e-13)


@given(st.floats(-20, 20), st.floats(0, 0.9999))
def test_keplers_equation_is_solved_to_rounding(mean_anomaly: float, e: float) -> None:
    E = float(eccentric_longitude_rad(mean_anomaly, e, 0.0))
    assert abs(E - e * np.sin(E) - mean_anomaly) < 1e-13


@given(st.floats(-7, 7), st.floats(0, 0.95), angles)
def test_the_general_equation_is_keplers_turned(l: float, e: float, turn: float) -> None:
    F = eccentric_longitude_rad(l + turn, e * np.cos(turn), e * np.sin(turn))
    # An error of the argument of 1e-15 grows by 1/(1 − e).
    assert F - turn == pytest.approx(eccentric_longitude_rad(l, e, 0.0), abs=2e-13)


def test_keplers_equation_has_a_finite_jacobian_on_a_circle() -> None:
    jacobian = ECCENTRIC_LONGITUDE.function.jacobian()
    by_l, by_ex, by_ey = (float(part) for part in jacobian(0.7, 0.0, 0.0, 0.0))
    # F = l + ex sin l − ey cos l + O(e²)
    assert (by_l, by_ex, by_ey) == pytest.approx((1.0, np.sin(0.7), -np.cos(0.7)), abs=1e-14)


@st.composite
def relative_elements(draw: Any) -> Any:
    return np.array([draw(st.floats(-1e-3, 1e-3)) for _ in range(6)])


near_any_inclination = (0.02, 0.9, np.pi / 2, 2.3, np.pi - 0.02)


@given(orbits((0.0, 1e-12, 1e-4, 0.1, 0.52, 0.9), near_any_inclination), relative_elements())
def test_relative_elements_survive_the_way_through_two_orbits(orbit: Any, wanted: Any) -> None:
    chief = elements.qns_from_keplerian(orbit)
    assert roe.roe_from_qns(chief, roe.qns_from_roe(chief, wanted)) == pytest.approx(wanted, abs=1e-13)


@given(orbits((0.0, 1e-4, 0.1, 0.52), near_any_inclination), relative_elements())
def test_swapping_the_spacecraft_negates_relative_elements_to_first_order(
    orbit: Any, wanted: Any
) -> None:
    chief = elements.qns_from_keplerian(orbit)
    deputy = roe.qns_from_roe(chief, wanted)
    # Second order has a node difference times a difference of cos i, over sin i at worst.
    second = 4 * float(np.max(np.abs(wanted))) ** 2 / np.sin(orbit[2])
    assert roe.roe_from_qns(deputy, chief) == pytest.approx(-wanted, abs=second + 1e-13)


@given(orbits((0.0, 1e-8, 0.1, 0.52, 0.9), near_any_inclination), relative_elements(), st.floats(0, 1e5))
def test_both_sets_of_relative_elements_and_the_states_agree(
    orbit: Any, given_roe: Any, t_s: float
) -> None:
    given_roe = given_roe * 1e-2
    chief = elements.qns_from_keplerian(orbit)
    sign = elements.qns_sign(chief)
    equinoctial = elements.equinoctial_from_qns(chief, sign)
    wanted = roe.rtn_from_roe(chief, given_roe, MU, t_s)
    by_difference = roe.equinoctial_roe_from_roe(chief, given_roe, sign)
    got = roe.rtn_from_equinoctial_roe(equinoctial, sign, by_difference, MU, t_s)
    # Rounding of the planetary positions, 1e-15 of up to 5e8 m, and its growth near perigee.
    assert got == pytest.approx(wanted, abs=1e-12 * orbit[0])
    r, v = elements.state_from_qns(chief, MU)
    r_2, v_2 = elements.state_from_qns(roe.qns_from_roe(chief, given_roe), MU)
    by_states = roe.equinoctial_roe_from_states(r, v, r_2 - r, v_2 - v, sign, MU)
    got = roe.rtn_from_equinoctial_roe(equinoctial, sign, by_states, MU, t_s)
    assert got == pytest.approx(wanted, abs=1e-10 * orbit[0])


@given(orbits((0.0, 1e-8, 0.1, 0.52), near_any_inclination), relative_elements())
def test_without_difference_in_size_the_relative_orbit_closes(orbit: Any, given_roe: Any) -> None:
    given_roe = given_roe * 1e-2 * [0, 1, 1, 1, 1, 1]
    chief = elements.qns_from_keplerian(orbit)
    period_s = 2 * np.pi * np.sqrt(orbit[0] ** 3 / MU)
    start, end = roe.rtn_from_roe(chief, given_roe, MU, np.array([0.0, period_s]))
    assert end[:3] == pytest.approx(start[:3], abs=1e-5)


def test_the_angles_of_published_elements() -> None:
    # Vallado (2013), example 2-5; μ is his.
    r = np.array([6524.834, 6862.875, 6448.296]) * 1e3
    v = np.array([4.901327, 5.533756, -1.976341]) * 1e3
    a, e, i, raan, argp, _ = elements.keplerian_from_state(r, v, 3.986004418e14)
    assert a == pytest.approx(36127.343e3, rel=1e-6)
    assert e == pytest.approx(0.832853, abs=1e-6)
    assert np.degrees([i, raan, argp]) % 360 == pytest.approx([87.870, 227.898, 53.38], abs=5e-3)
