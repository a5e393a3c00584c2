"""The key figures of a flight or of a tracked sequence, as the page's heading shows them."""

from __future__ import annotations

import math

from posse_core._evaluation.flight import FlightSummary
from posse_core._evaluation.track import TrackSummary
from posse_core._model.flight_record import FlightRecord

_NOTHING = "–"


def key_figures(
    record: FlightRecord, summary: FlightSummary, tracked: TrackSummary
) -> list[tuple[str, str]]:
    """What a figure is, and the figure with its unit; a dash where there is nothing to measure.

    Figures of a goal, of a keep-out ellipsoid and of impulses are left out where there are none.
    """
    start_m = float((record.r_true_rtn_m[0] ** 2).sum() ** 0.5)
    figures = [
        ("Duration", f"{record.t_s[-1] - record.t_s[0]:.0f} s"),
        ("Range, start to end", f"{_length(start_m)} → {_length(summary.final_range_m)}"),
        ("Closest approach", _length(summary.closest_m)),
    ]
    if math.isfinite(float(record.keep_out_m.sum())):
        figures += [("Keep-out ellipsoid", "entered" if summary.entered_keep_out else "not entered")]
    if len(record.t_waypoint_s):
        figures += [
            ("Final distance from the waypoint", _length(summary.final_position_error_m)),
            ("Final velocity error", _speed(summary.final_velocity_error_m_s)),
            ("95 % of the time held, position within", _length(summary.position_error_95_m)),
            ("95 % of the time held, velocity within", _speed(summary.velocity_error_95_m_s)),
        ]
    if summary.dv_m_s > 0:
        figures += [
            ("Δv", _speed(summary.dv_m_s)),
            ("Δv over the least possible", _ratio(summary.dv_m_s, summary.least_dv_m_s)),
        ]
    return [
        *figures,
        ("Estimate's position error, median", _length(summary.median_position_error_m)),
        ("Single frames' position error, median", _length(summary.median_single_position_error_m)),
        ("Estimate's at the same frames", _length(summary.median_paired_position_error_m)),
        ("Estimate's position error at the end", _length(summary.final_estimate_position_error_m)),
        ("Estimate's velocity error at the end", _speed(summary.final_estimate_velocity_error_m_s)),
        ("Estimate's attitude error, median", _degrees(tracked.attitude_rad.median)),
        ("Single frames' attitude error, median", _degrees(tracked.single_attitude_rad.median)),
        ("Attitude error at the end", _degrees(summary.attitude_error_rad)),
        ("Rate error at the end", _number(100 * summary.rate_error, " %")),
        ("NEES in its 95 % band", _number(100 * summary.nees_share, " % of frames")),
        ("NEES at the end", _number(summary.nees_final, "")),
        ("Longest time lost", f"{summary.lost_s:.0f} s"),
    ]


def _degrees(value_rad: float) -> str:
    return _number(math.degrees(value_rad), "°")


def _length(value_m: float) -> str:
    return _number(value_m, " m") if not value_m < 1 else _number(1e3 * value_m, " mm")


def _speed(value_m_s: float) -> str:
    return _number(value_m_s, " m/s") if not value_m_s < 1 else _number(1e3 * value_m_s, " mm/s")


def _ratio(value: float, least: float) -> str:
    return _number(value / least, " ×") if least > 0 else _NOTHING


def _number(value: float, unit: str) -> str:
    """Three significant digits, without an exponent."""
    if not math.isfinite(value):
        return _NOTHING
    digits = 2 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{min(max(digits, 0), 6)}f}{unit}"
