"""Motion and elements against quadruple precision and another library; see regenerate_dynamics.py."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posse_core._constants import Constants
from posse_core._dynamics import elements, j2, roe
from posse_core._dynamics.domain import DomainWarning
from posse_core._dynamics.linear import any_eccentricity_map
from posse_core._frames import rtn_from_eci
from posse_core._interfaces.propagator import PropagationProblem
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._trajectory.problem import resolve

FIGURES = json.loads(Path(__file__).with_name("dynamics.json").read_text())
CONSTANTS = Constants()
MU = CONSTANTS.mu_earth_m3_s2


def problem_of(case: dict[str, Any], relative: RelativeConfig | None = None) -> PropagationProblem:
    def two_vectors(state: list[float]) -> dict[str, list[float]]:
        return {"r_m": state[:3], "v_m_s": state[3:]}

    orbit = {"state_eci": {"epoch_utc": "2022-01-31T02:02:27.58", **two_vectors(case["chief"])}}
    deputy = RelativeConfig.model_validate({"state_eci": two_vectors(case["deputy"])})
    return resolve(
        OrbitConfig.model_validate(orbit), relative or deputy, np.array(case["t_s"]), CONSTANTS
    )


def positions(name: str, problem: PropagationProblem, **options: Any) -> Any:
    registry = load_plugins().registry
    propagator = registry.create("propagator", name, registry.options("propagator", name, options))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DomainWarning)
        return propagator.propagate(problem).r_chaser_rtn_m


def worst_m(positions_m: Any, truth_m: Any) -> float:
    return float(np.linalg.norm(positions_m - np.array(truth_m), axis=-1).max())


@pytest.mark.parametrize("case", FIGURES["motion"], ids=lambda case: case["name"])
def test_roe_is_exact_in_two_body_motion(case: dict[str, Any]) -> None:
    assert worst_m(positions("roe", problem_of(case)), case["two-body"]) < 1e-5


@pytest.mark.parametrize("gravity", ["two-body", "j2"])
@pytest.mark.parametrize("case", FIGURES["motion"], ids=lambda case: case["name"])
def test_nonlinear_holds_a_millimetre_over_ten_orbits(case: dict[str, Any], gravity: str) -> None:
    assert worst_m(positions("nonlinear", problem_of(case), gravity=gravity), case[gravity]) < 1e-3


@pytest.mark.parametrize(
    ("name", "gravity", "orbits", "known_m"),
    [
        # Measured by another implementation, at its own instants: so 5 % of tolerance.
        ("hcw", "two-body", 1, 0.104),
        ("hcw", "two-body", 10, 1.03),
        ("hcw", "j2", 1, 2.49),
        ("hcw", "j2", 10, 32.8),
        ("roe-near-circular", "two-body", 1, 0.026),
        ("roe-near-circular", "two-body", 10, 0.026),
        ("roe-near-circular", "j2", 1, 2.39),
        ("roe-near-circular", "j2", 10, 31.9),
        ("yamanaka-ankersen", "two-body", 1, 0.077),
        ("yamanaka-ankersen", "two-body", 10, 0.77),
        ("yamanaka-ankersen", "j2", 1, 2.32),
        ("yamanaka-ankersen", "j2", 10, 31.2),
        ("roe", "j2", 1, 2.39),
        ("roe", "j2", 10, 31.9),
    ],
)
def test_each_model_errs_by_what_is_known_of_it(
    name: str, gravity: str, orbits: int, known_m: float
) -> None:
    case = FIGURES["aqua"]
    count = 20 * orbits + 1
    got = positions(name, problem_of(case))
    assert worst_m(got[:count], case[gravity][:count]) == pytest.approx(known_m, rel=0.05)


def test_the_linear_map_for_any_eccentricity_errs_by_what_is_known_of_it() -> None:
    case = FIGURES["aqua"]
    (start,) = problem_of(case).starts
    linear = any_eccentricity_map(start.target.qns, MU, np.array(case["t_s"])) @ start.roe
    assert worst_m(linear[:, :3], case["two-body"]) == pytest.approx(0.0023, rel=0.05)


@pytest.mark.parametrize(("orbits", "known_m"), [(1, 0.063), (10, 0.063)])
def test_j2_roe_errs_by_what_is_known_of_it(orbits: int, known_m: float) -> None:
    case = FIGURES["aqua"]
    count = 20 * orbits + 1
    got = positions("j2-roe", problem_of(case))
    assert worst_m(got[:count], case["j2"][:count]) == pytest.approx(known_m, rel=0.05)


def test_canonical_mean_elements_are_more_exact() -> None:
    case = FIGURES["aqua"]
    # First-order theory: J2² of what J2 does in ten orbits, and the separation's own square.
    got = positions("j2-roe", problem_of(case), mean_elements="canonical")
    assert worst_m(got, case["j2"]) < 0.04


def test_relative_elements_are_those_that_the_state_was_made_of() -> None:
    case = FIGURES["aqua"]
    (start,) = problem_of(case).starts
    assert start.target.qns[0] * start.roe == pytest.approx(np.array(case["roe_m"]), abs=1e-6)


@pytest.mark.parametrize("case", FIGURES["conversions"])
def test_keplerian_elements_are_another_librarys(case: dict[str, Any]) -> None:
    r, v = elements.state_from_keplerian(np.array(case["elements"]), case["mu"])
    theirs = np.array(case["state"])
    assert r == pytest.approx(theirs[:3], abs=1e-12 * np.linalg.norm(theirs[:3]))
    assert v == pytest.approx(theirs[3:], abs=1e-12 * np.linalg.norm(theirs[3:]))


@pytest.mark.parametrize("case", FIGURES["relative_elements"])
def test_roe_and_rtn_are_another_librarys(case: dict[str, Any]) -> None:
    chief = elements.qns_from_keplerian(np.array(case["chief"]))
    deputy = elements.qns_from_keplerian(np.array(case["deputy"]))
    given = np.array(case["roe"])
    assert roe.roe_from_qns(chief, deputy) == pytest.approx(given, abs=1e-14)
    got = roe.rtn_from_roe(chief, given, case["mu"], 0.0)
    assert got[:3] == pytest.approx(np.array(case["rtn"])[:3], abs=1e-6)
    assert got[3:] == pytest.approx(np.array(case["rtn"])[3:], abs=1e-9)
    states = (*elements.state_from_qns(chief, case["mu"]), *elements.state_from_qns(deputy, case["mu"]))
    assert np.concatenate(rtn_from_eci(*states)) == pytest.approx(got, abs=1e-6)


@pytest.mark.parametrize("case", FIGURES["mean_elements"])
def test_mean_elements_are_those_of_brouwer_and_lyddane(case: dict[str, Any]) -> None:
    constants = Constants.model_validate(
        {"mu_earth_m3_s2": case["mu"], "earth_radius_m": case["radius"], "j2": case["j2"]}
    )
    mean = elements.qns_from_keplerian(np.array(case["mean"]))
    theirs = elements.qns_from_keplerian(np.array(case["osculating"]))
    got = j2.osculating_from_mean(mean, constants, "brouwer-lyddane")
    assert got[0] == pytest.approx(theirs[0], abs=1e-6)
    assert got[2:5] == pytest.approx(theirs[2:5], abs=1e-13)
    assert np.exp(1j * got[[1, 5]]) == pytest.approx(np.exp(1j * theirs[[1, 5]]), abs=1e-12)
    back = j2.mean_from_osculating(got, constants, "brouwer-lyddane")
    assert back[1:] == pytest.approx(mean[1:], abs=1e-9)
