"""Key figures of flights, against hand-computed cases, SciPy's χ² and SciPy's rotations."""

from dataclasses import fields, replace

import flights
import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from posse_core._evaluation.flight import (
    flight_errors,
    in_nees_band,
    inside_keep_out,
    lost,
    nees,
    nees_band,
    spent_m_s,
    summarise,
)


@pytest.fixture(scope="module")
def record():
    return flights.flight_record(flights.approach())


def scipy_of(q):
    return Rotation.from_quat(np.asarray(q)[..., [1, 2, 3, 0]])


def test_errors_are_truth_minus_estimate(record):
    errors = flight_errors(record)
    seen = slice(flights.FIRST_ESTIMATE, None)
    assert np.isnan(errors.r_rtn_m[0]).all()
    assert np.isnan(errors.attitude_rad[0]).all()
    assert (record.r_rtn_m + errors.r_rtn_m)[seen] == pytest.approx(record.r_true_rtn_m[seen])
    assert (record.v_rtn_m_s + errors.v_rtn_m_s)[seen] == pytest.approx(record.v_true_rtn_m_s[seen])
    turned = scipy_of(record.q_eci_from_body[seen]) * Rotation.from_rotvec(errors.attitude_rad[seen])
    away = turned.inv() * scipy_of(record.q_true_eci_from_body[seen])
    assert away.magnitude() == pytest.approx(0, abs=1e-12)
    apart = (record.omega_body_rad_s + errors.omega_body_rad_s)[seen]
    assert apart == pytest.approx(record.omega_true_body_rad_s[seen])
    single = scipy_of(record.q_single_eci_from_body[1]).inv() * scipy_of(record.q_true_eci_from_body[1])
    assert errors.single_rad[1] == pytest.approx(single.magnitude())
    assert np.isnan(errors.single_rad[0])


def test_nees_is_the_quadratic_form():
    random = np.random.default_rng(1)
    error = random.normal(size=(5, 4))
    half = random.normal(size=(5, 4, 4))
    covariance = half @ half.transpose(0, 2, 1) + np.eye(4)
    expected = [e @ np.linalg.inv(P) @ e for e, P in zip(error, covariance, strict=True)]
    assert nees(error, covariance) == pytest.approx(expected)


def test_nees_has_no_unit():
    """Units from kilometres to nanoradians in one covariance change nothing."""
    random = np.random.default_rng(2)
    error, covariance = random.normal(size=(6, 12)), np.tile(flights.correlation(), (6, 1, 1))
    units = 10.0 ** np.linspace(-9, 3, 12)
    scaled = nees(error * units, covariance * np.outer(units, units))
    assert scaled == pytest.approx(nees(error, covariance), rel=1e-9)


def test_a_singular_or_missing_covariance_has_no_nees():
    error, covariance = np.ones((4, 3)), np.tile(np.eye(3), (4, 1, 1))
    covariance[1] = 0
    covariance[2] = 1
    error[3, 0] = np.nan
    assert np.isnan(nees(error, covariance)).tolist() == [False, True, True, True]


def test_nees_of_a_consistent_navigator_is_chi_squared():
    """Kolmogorov and Smirnov's test over many flights, and over ones whose covariance is too small."""
    motion = flights.approach()
    for scale, consistent in ((1.0, True), (1.15, False)):
        records = [flights.flight_record(motion, seed, scale) for seed in range(20)]
        all_errors = [flight_errors(record) for record in records]
        for name, dof in (("nees_6", 6), ("nees_12", 12)):
            values = np.concatenate([getattr(errors, name) for errors in all_errors])
            values = values[np.isfinite(values)]
            assert len(values) == 20 * (len(motion.t_s) - flights.FIRST_ESTIMATE)
            assert (stats.kstest(values, "chi2", (dof,)).pvalue > 1e-3) == consistent


def test_the_band_holds_95_percent():
    for dof in (6, 12):
        low, high = nees_band(dof)
        assert stats.chi2.cdf(low, dof) == pytest.approx(0.025)
        assert stats.chi2.sf(high, dof) == pytest.approx(0.025)
        inside = in_nees_band(
            np.array([low * 0.999, low * 1.001, high * 0.999, high * 1.001, np.nan]), dof
        )
        assert inside.tolist() == [False, True, True, False, False]


def test_figures_of_a_flight_computed_by_hand():
    """Four frames on the V-bar, 100 s apart; the last two are to be held at 10 m with 0.1 m/s."""
    record = flights.rows(flights.flight_record(flights.approach()), slice(10, 14))
    along_y, unturned = np.array([[0.0, 1.0, 0.0]] * 4), np.array([[1.0, 0.0, 0.0, 0.0]] * 4)
    covariance = np.tile(np.diag(np.r_[np.full(3, 0.01), np.full(3, 1e-6), np.full(6, 1e-4)]), (4, 1, 1))
    record = replace(
        record,
        t_s=np.array([0.0, 100.0, 200.0, 300.0]),
        r_true_rtn_m=np.array([[0, 40.0, 0], [0, 20.0, 0], [0, 9.0, 0], [0, 10.5, 0]]),
        v_true_rtn_m_s=np.array([[0, -0.2, 0], [0, -0.11, 0], [0, 0.2, 0], [0, 0.1, 0.3]]),
        r_rtn_m=np.array([[0, 40.0, 0], [0, 20.3, 0], [0, 9.1, 0], [0, 10.5, 0.2]]),
        v_rtn_m_s=np.array([[0, -0.2, 0], [0, -0.11, 0], [0, 0.2, 0], [0, 0.103, 0.3]]),
        q_true_eci_from_body=unturned,
        q_eci_from_body=np.vstack([unturned[:3], [np.cos(0.01), 0, np.sin(0.01), 0]]),
        omega_true_body_rad_s=0.05 * along_y,
        omega_body_rad_s=0.049 * along_y,
        covariance=covariance,
        r_single_rtn_m=np.array([[np.nan] * 3, [0, 20.5, 0], [0, 8.0, 0], [0, 10.5, 0.7]]),
        dv_rtn_m_s=np.array([[0.03, 0.04, 0], [0, 0, 0], [0, 0, -0.1], [0, 0, 0]]),
        least_dv_m_s=np.array(0.12),
        t_waypoint_s=np.array([50.0, 200.0]),
        until_waypoint_s=np.array([50.0, 300.0]),
        r_waypoint_rtn_m=np.array([[0, 30.0, 0], [0, 10.0, 0]]),
        v_waypoint_rtn_m_s=np.array([[0, 0, 0], [0, 0.1, 0]]),
        keep_out_m=np.array([5.0, 9.5, 5.0]),
    )
    summary = summarise(record)
    assert summary.final_position_error_m == pytest.approx(0.5)
    assert summary.final_velocity_error_m_s == pytest.approx(0.3)
    assert summary.final_range_m == pytest.approx(10.5)
    # Of two values, NumPy's percentile is between them: 0.5 and 1 m, 0.1 and 0.3 m/s.
    assert summary.position_error_95_m == pytest.approx(0.5 + 0.95 * 0.5)
    assert summary.velocity_error_95_m_s == pytest.approx(0.1 + 0.95 * 0.2)
    assert summary.dv_m_s == pytest.approx(0.15)
    assert spent_m_s(record) == pytest.approx([0.05, 0.05, 0.15, 0.15])
    assert summary.least_dv_m_s == pytest.approx(0.12)
    assert summary.closest_m == pytest.approx(9)
    assert inside_keep_out(record).tolist() == [False, False, True, False]
    assert summary.entered_keep_out
    assert summary.median_position_error_m == pytest.approx(0.15)
    assert summary.median_single_position_error_m == pytest.approx(0.7)
    assert summary.median_paired_position_error_m == pytest.approx(0.2)
    assert summary.final_estimate_position_error_m == pytest.approx(0.2)
    assert summary.final_estimate_velocity_error_m_s == pytest.approx(0.003)
    assert summary.attitude_error_rad == pytest.approx(0.02)
    assert summary.rate_error == pytest.approx(0.02)
    assert summary.nees_final == pytest.approx(0.2**2 / 0.01 + 0.003**2 / 1e-6)
    assert summary.nees_in_band
    # NEES 0, 9, 1 and 13; the band of six degrees of freedom is 1.24 … 14.45.
    assert summary.nees_share == pytest.approx(0.5)
    # The second frame's position is off by 3σ along one axis, which is within the ellipsoid.
    assert summary.lost_s == 0


def test_lost_is_the_longest_time_outside_the_ellipsoid_or_without_estimate(record):
    limit = np.sqrt(stats.chi2.ppf(stats.chi2.cdf(9, 1), 3))
    away = flights.SIGMAS[0] * np.linalg.norm(record.r_true_rtn_m, axis=1)
    covariance = np.tile(np.eye(12), (len(record), 1, 1))
    covariance[:, 0, 0] = away**2
    exact = replace(record, r_rtn_m=record.r_true_rtn_m, covariance=covariance)
    for share, count in ((0.99, 0), (1.01, 3)):
        r = exact.r_true_rtn_m.copy()
        r[20:23, 0] += share * limit * away[20:23]
        off = replace(exact, r_rtn_m=r)
        assert lost(off, flight_errors(off)).sum() == count
        assert summarise(off).lost_s == pytest.approx(count * flights.STEP_S)
    gone = flights.without_estimate(flights.without_estimate(exact, slice(30, 35)), slice(5, 7))
    assert summarise(gone).lost_s == pytest.approx(5 * flights.STEP_S)
    ends = flights.without_estimate(exact, slice(len(exact) - 7, None))
    assert summarise(ends).lost_s == pytest.approx(7 * flights.STEP_S)


def test_the_truth_as_estimate_is_never_lost(record):
    exact = replace(
        record,
        r_rtn_m=record.r_true_rtn_m,
        v_rtn_m_s=record.v_true_rtn_m_s,
        covariance=np.zeros_like(record.covariance),
    )
    summary = summarise(exact)
    assert summary.lost_s == 0
    assert np.isnan(summary.nees_final)
    assert not summary.nees_in_band
    assert np.isnan(summary.nees_share)


def test_without_attitude_position_and_velocity_are_still_judged(record):
    covariance = np.full_like(record.covariance, np.nan)
    covariance[:, :6, :6] = record.covariance[:, :6, :6]
    nothing = {
        name: np.full_like(getattr(record, name), np.nan)
        for name in ("q_eci_from_body", "omega_body_rad_s")
    }
    bare = replace(record, covariance=covariance, **nothing)
    errors, summary = flight_errors(bare), summarise(bare)
    assert errors.nees_6 == pytest.approx(flight_errors(record).nees_6, nan_ok=True)
    assert np.isnan(errors.nees_12).all()
    assert np.isnan(errors.sigma[:, 6:]).all()
    assert np.isnan([summary.attitude_error_rad, summary.rate_error]).all()
    assert summary.nees_share == summarise(record).nees_share


def test_without_goal_keep_out_and_single_poses_there_is_nothing_to_measure(record):
    none, frames = np.empty((0, 3)), slice(None)
    bare = flights.without_readings(flights.without_estimate(record, frames), frames)
    bare = replace(
        bare,
        t_waypoint_s=np.empty(0),
        until_waypoint_s=np.empty(0),
        r_waypoint_rtn_m=none,
        v_waypoint_rtn_m_s=none,
        keep_out_m=np.full(3, np.nan),
        least_dv_m_s=np.array(np.nan),
        omega_true_body_rad_s=np.zeros_like(record.r_true_rtn_m),
    )
    summary = summarise(bare)
    known = {part.name for part in fields(summary) if not np.isnan(getattr(summary, part.name))}
    assert known == {
        "final_range_m",
        "dv_m_s",
        "closest_m",
        "entered_keep_out",
        "lost_s",
        "nees_in_band",
    }
    assert not summary.entered_keep_out
    assert not summary.nees_in_band
    assert summary.lost_s == pytest.approx(len(record) * flights.STEP_S)


def test_a_turn_that_leaves_the_looks_is_no_error(record):
    """The estimate is about axes that are turned by half a turn about z: NEES and errors stay."""
    half_turn = Rotation.from_euler("z", 180, degrees=True)
    turned = scipy_of(np.nan_to_num(record.q_eci_from_body, nan=0.5)) * half_turn
    q = turned.as_quat()[:, [3, 0, 1, 2]]
    q[: flights.FIRST_ESTIMATE] = np.nan
    J = half_turn.as_matrix().T
    whole = np.eye(12)
    whole[6:9, 6:9] = whole[9:, 9:] = J
    covariance = whole @ record.covariance @ whole.T
    other = replace(
        record, q_eci_from_body=q, omega_body_rad_s=record.omega_body_rad_s @ J.T, covariance=covariance
    )
    asked = flight_errors(other, [half_turn.as_matrix()])
    plain = flight_errors(record)
    assert asked.nees_12 == pytest.approx(plain.nees_12, nan_ok=True)
    assert asked.attitude_rad == pytest.approx(plain.attitude_rad @ J.T, nan_ok=True)
    assert np.linalg.norm(flight_errors(other).attitude_rad[5]) > 3
    assert summarise(record, [half_turn.as_matrix()]) == summarise(record)


def test_a_target_that_hardly_turns_has_no_relative_rate_error():
    record = flights.flight_record(flights.approach(), seed=3)
    still = replace(record, omega_true_body_rad_s=np.full_like(record.omega_true_body_rad_s, 1e-6))
    assert np.isnan(summarise(still).rate_error)
    assert summarise(record).rate_error > 0
