"""How well a sequence was tracked: errors of the estimate beside those of single-frame poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._evaluation.flight import (
    MOTION_DOF,
    flight_errors,
    in_nees_band,
    longest_s,
    lost,
    percentile,
)
from posse_core._model.flight_record import FlightRecord


@dataclass(frozen=True)
class Spread:
    """Median and 95th percentile of errors; NaN where there are none."""

    median: float
    percentile_95: float

    @classmethod
    def of(cls, values: FloatArray) -> Spread:
        """Of the values (F,) that are numbers."""
        return cls(percentile(values, 50), percentile(values, 95))


@dataclass(frozen=True)
class TrackSummary:
    """The key figures of a tracked sequence.

    Errors of the estimate are over the frames that have a pose of their own as well, so that they can be
    compared with those of the poses; those of velocity and rate over all frames with an estimate.

    Attributes:
        frames: number of frames.
        compared: number of frames whose readings the navigator compared with what it expected.
        posed: number of frames with a pose of their own.
        position_m, single_position_m: errors of the position, by the estimate and by single frames.
        attitude_rad, single_attitude_rad: the same of the attitude.
        velocity_m_s: error of the estimate's velocity.
        rate_rad_s: error of its angular velocity of the target.
        nees_share: share of the frames whose NEES of position and velocity is in its 95 % band.
        lost_s: the longest time for which the navigator was lost, as in
            :class:`posse_core._evaluation.flight.FlightSummary`.
    """

    frames: int
    compared: int
    posed: int
    position_m: Spread
    single_position_m: Spread
    attitude_rad: Spread
    single_attitude_rad: Spread
    velocity_m_s: Spread
    rate_rad_s: Spread
    nees_share: float
    lost_s: float


def summarise_track(record: FlightRecord, symmetries: Sequence[FloatArray] = ()) -> TrackSummary:
    """The key figures of a tracked sequence of at least one frame.

    Args:
        symmetries: as in :func:`posse_core._evaluation.flight.flight_errors`.
    """
    errors = flight_errors(record, symmetries)
    position, attitude, velocity, rate, single = (
        np.linalg.norm(part, axis=-1)
        for part in (
            errors.r_rtn_m,
            errors.attitude_rad,
            errors.v_rtn_m_s,
            errors.omega_body_rad_s,
            errors.r_single_rtn_m,
        )
    )
    posed = np.isfinite(single)
    known = np.isfinite(errors.nees_6)
    in_band = in_nees_band(errors.nees_6, MOTION_DOF)
    return TrackSummary(
        frames=len(record),
        compared=int((record.dof > 0).sum()),
        posed=int(posed.sum()),
        position_m=Spread.of(position[posed]),
        single_position_m=Spread.of(single),
        attitude_rad=Spread.of(attitude[posed]),
        single_attitude_rad=Spread.of(errors.single_rad),
        velocity_m_s=Spread.of(velocity),
        rate_rad_s=Spread.of(rate),
        nees_share=float(in_band[known].mean()) if known.any() else np.nan,
        lost_s=longest_s(lost(record, errors), record.t_s),
    )
