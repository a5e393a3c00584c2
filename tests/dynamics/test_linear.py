"""Linear models: group properties, limits, and the exact map that each approximates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._constants import Constants
from posse_core._dynamics import elements, j2, linear, roe
from posse_core._dynamics.elements import later
from posse_core._dynamics.rows import Rows

CONSTANTS = Constants()
MU = CONSTANTS.mu_earth_m3_s2
angles = st.floats(-np.pi, np.pi)
times = st.floats(-2e4, 2e4)


@st.composite
def chiefs(draw: Any, eccentricities: Any = (0.0, 1e-12, 1e-4, 0.1, 0.52, 0.9)) -> Any:
    """qns elements."""
    e = draw(st.sampled_from(eccentricities))
    a = draw(st.floats(6.6e6, 50e6)) / (1 - e)
    i = draw(st.sampled_from((0.02, 0.9, np.pi / 2, 2.3)))
    return elements.qns_from_keplerian(np.array([a, e, i, *(draw(angles) for _ in range(3))]))


def scaled(phi: Any, chief: Any) -> Any:
    """The matrix for velocities in units of n times metres."""
    n = np.sqrt(MU / chief[0] ** 3)
    units = np.array([1, 1, 1, n, n, n])
    return phi / units[:, None] * units


def off_by(got: Any, wanted: Any) -> float:
    return float(np.max(np.abs(got - wanted)) / np.max(np.abs(wanted)))


@given(chiefs(), times, times)
def test_yamanaka_ankersen_in_two_steps_is_one(chief: Any, t_1: float, t_2: float) -> None:
    first = scaled(linear.yamanaka_ankersen_stm(chief, MU, t_1), chief)
    then = scaled(linear.yamanaka_ankersen_stm(later(chief, MU, np.asarray(t_1)), MU, t_2 - t_1), chief)
    whole = scaled(linear.yamanaka_ankersen_stm(chief, MU, t_2), chief)
    size = np.max(np.abs(first)) * np.max(np.abs(then))
    assert np.max(np.abs(then @ first - whole)) < 1e-11 * max(size, 1)


@given(chiefs(), times, times)
def test_hcw_in_two_steps_is_one(chief: Any, t_1: float, t_2: float) -> None:
    one, two, both = (scaled(linear.hcw_stm(chief, MU, t), chief) for t in (t_1, t_2, t_1 + t_2))
    size = np.max(np.abs(one)) * np.max(np.abs(two))
    assert np.max(np.abs(two @ one - both)) < 1e-11 * size


@given(chiefs((0.0, 1e-12, 1e-8, 1e-6)), times)
def test_yamanaka_ankersen_becomes_hcw_on_a_circle(chief: Any, t: float) -> None:
    ya = scaled(linear.yamanaka_ankersen_stm(chief, MU, t), chief)
    hcw = scaled(linear.hcw_stm(chief, MU, t), chief)
    e = float(np.hypot(*chief[2:4]))
    assert off_by(ya, hcw) < 1e-10 + 500 * e


@given(chiefs(), times)
def test_hcw_is_the_near_circular_map_at_both_ends(chief: Any, t: float) -> None:
    before = scaled(linear.near_circular_map(chief, MU, 0.0), chief) / chief[0]
    after = scaled(linear.near_circular_map(chief, MU, t), chief) / chief[0]
    hcw = scaled(linear.hcw_stm(chief, MU, t), chief)
    # Columns of the maps are lengths, so only their rows have the velocity's unit.
    n = np.sqrt(MU / chief[0] ** 3)
    columns = np.array([1, 1, 1, n, n, n])
    assert off_by((after / columns) @ np.linalg.inv(before / columns), hcw) < 1e-9


@given(chiefs())
def test_the_determinant_of_the_near_circular_map(chief: Any) -> None:
    n = np.sqrt(MU / chief[0] ** 3)
    rows = np.array([1, 1, 1, n, n, n])[:, None]
    matrix = linear.near_circular_map(chief, MU, 0.0) / chief[0] / rows
    assert abs(np.linalg.det(matrix)) == pytest.approx(0.5, rel=1e-12)


@given(chiefs((1e-4, 0.1, 0.52, 0.9)), st.floats(0, 2e4))
def test_yamanaka_ankersen_is_the_linear_part_of_exact_motion(chief: Any, t: float) -> None:
    to_rtn = linear.any_eccentricity_map(chief, MU, np.array([0.0, t]))
    exact = scaled(to_rtn[1] @ np.linalg.inv(to_rtn[0]), chief)
    # The inverse loses digits as 1/(1 − e)² and, of the node, as 1/sin i.
    assert off_by(scaled(linear.yamanaka_ankersen_stm(chief, MU, t), chief), exact) < 1e-7


@given(chiefs((0.0, 1e-4, 0.1, 0.52)), st.floats(0, 2e4))
def test_the_linear_map_is_the_slope_of_the_exact_one(chief: Any, t: float) -> None:
    step = 1e-6
    sides = [roe.rtn_from_roe(chief, sign * step * np.eye(6), MU, t) for sign in (1, -1)]
    slope = (sides[0] - sides[1]).T / (2 * step)
    rows = np.repeat([chief[0], chief[0] * np.sqrt(MU / chief[0] ** 3)], 3)[:, None]
    matrix = linear.any_eccentricity_map(chief, MU, t)
    size = np.max(np.abs(matrix / rows))
    assert np.max(np.abs(matrix - slope) / rows) < 1e-7 * size + 1e-7 / np.sin(chief[4]) ** 2


@given(chiefs((0.0, 1e-4, 0.1, 0.52)), times, times)
def test_the_j2_matrix_in_two_steps_is_one(chief: Any, t_1: float, t_2: float) -> None:
    first = j2.j2_stm(chief, CONSTANTS, t_1)
    then = j2.j2_stm(j2.j2_secular(chief, CONSTANTS, t_1), CONSTANTS, t_2)
    assert off_by(then @ first, j2.j2_stm(chief, CONSTANTS, t_1 + t_2)) < 1e-12


@given(chiefs((1e-4, 0.1, 0.52)), st.floats(0, 5e4))
def test_the_j2_matrix_is_the_slope_of_the_secular_flow(chief: Any, t: float) -> None:
    step = 1e-6
    end = j2.j2_secular(chief, CONSTANTS, t)
    columns = []
    for k in range(6):
        unit = step * np.eye(6)[k]
        sides = [
            roe.roe_from_qns(end, j2.j2_secular(roe.qns_from_roe(chief, sign * unit), CONSTANTS, t))
            for sign in (1, -1)
        ]
        columns.append((sides[0] - sides[1]) / (2 * step))
    matrix = j2.j2_stm(chief, CONSTANTS, t)
    # Published as the derivative at zero; δλ's own definition adds δi δΩ, of second order.
    assert np.stack(columns, axis=1) == pytest.approx(matrix, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(
    "rows",
    [linear.HCW, linear.YAMANAKA_ANKERSEN, roe.RTN_FROM_ROE, roe.RTN_FROM_EQUINOCTIAL_ROE, j2.J2_STM],
    ids=lambda rows: str(rows.function.name()),
)
def test_functions_are_named_and_survive_a_file(rows: Rows, tmp_path: Path) -> None:
    function = rows.function
    path = tmp_path / "f.casadi"
    function.save(str(path))
    again = ca.Function.load(str(path))
    assert again.name_in() == function.name_in()
    rng = np.random.default_rng(0)
    values = [rng.uniform(0.1, 0.3, function.size_in(k)) for k in range(function.n_in())]
    assert np.array(again(*values)) == pytest.approx(np.array(function(*values)), rel=1e-15)
