"""The commands of the dynamics, as a program reads them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from posse_core._cli.manoeuvres import command as manoeuvres
from posse_core._cli.model_errors import command as model_errors
from posse_core._errors import InputError

SCENARIO = """
target: {name: aqua}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7.1e6, e: 1.0e-4, i_deg: 98.2, raan_deg: 10,
             argp_deg: 20, mean_anomaly_deg: 30}
relative: {roe_m: [0, 0, 100, 0, 0, 0]PLAN}
"""


def test_model_errors_are_the_known_ones() -> None:
    result = CliRunner().invoke(model_errors, ["--json"], catch_exceptions=False)
    columns = json.loads(result.stdout)
    # Measured by another implementation, which has one digit of Cluster's errors under J2.
    known = {
        "Aqua, two-body, 1 orbit": {"hcw": 0.104, "thesis, T(nt)": 41, "yamanaka-ankersen": 0.077},
        "Aqua, two-body, 10 orbits": {"hcw": 1.03, "linear ROE map, any e": 0.0023},
        "Aqua, j2, 1 orbit": {"hcw": 2.49, "roe (exact)": 2.39, "j2-roe, mean elements only": 0.108},
        "Aqua, j2, 10 orbits": {"hcw": 32.8, "thesis, T(nt)": 72, "j2-roe": 0.063},
        "Cluster from perigee, two-body, 1 orbit": {
            "hcw": 4004,
            "thesis, T(nt)": 479,
            "roe-near-circular, T(u)": 159,
            "yamanaka-ankersen": 0.218,
            "linear ROE map, any e": 0.0006,
        },
        "Cluster from apogee, two-body, 1 orbit": {
            "hcw": 816,
            "thesis, T(nt)": 182,
            "roe-near-circular, T(u)": 159,
            "yamanaka-ankersen": 0.0017,
            "linear ROE map, any e": 0.0006,
        },
    }
    for case, errors in known.items():
        for model, error_m in errors.items():
            assert columns[case][model] == pytest.approx(error_m, rel=0.05)
    for case, mean_only_mm, osculating_mm in (("perigee", 10, 10), ("apogee", 7, 4)):
        column = columns[f"Cluster from {case}, j2, 1 orbit"]
        assert column["j2-roe, mean elements only"] * 1e3 == pytest.approx(mean_only_mm, abs=1)
        assert column["j2-roe"] * 1e3 == pytest.approx(osculating_mm, abs=0.5)


def test_a_plans_impulses_and_cost_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    plan = ", plan: {burns: [{t_s: 9, dv_rtn_m_s: [0, 0.3, 0.4]}, {t_s: 3, dv_rtn_m_s: [1, 0, 0]}]}"
    path.write_text(SCENARIO.replace("PLAN", plan))
    result = CliRunner().invoke(manoeuvres, [str(path), "--json"], catch_exceptions=False)
    listed = json.loads(result.stdout)
    assert [burn["t_s"] for burn in listed["burns"]] == [3, 9]
    assert listed["dv_m_s"] == pytest.approx(1.5)
    text = CliRunner().invoke(manoeuvres, [str(path)], catch_exceptions=False).stdout
    assert "total 1.500000 m/s" in text


def test_a_scenario_without_a_plan_has_nothing_to_list(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(SCENARIO.replace("PLAN", ""))
    with pytest.raises(InputError, match=r"no relative\.plan; add"):
        CliRunner().invoke(manoeuvres, [str(path)], catch_exceptions=False)
