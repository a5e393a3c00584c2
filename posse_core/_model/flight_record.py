"""The record of a flight: truth, estimate and commands at each frame."""

from __future__ import annotations

from dataclasses import dataclass, fields

from posse_core._arrays import AnyArray, FloatArray, IntArray


@dataclass(frozen=True)
class FlightRecord:
    """What happened over the F frames of a flight. RTN: the target's axes; NaN where there is no value.

    Truth, estimate and single-frame pose of a row are at the instant ``t_s`` of its frame, the estimate
    with this frame's readings as far as they had arrived when the impulse after the frame was decided.

    Attributes:
        t_s: (F,) seconds since the scenario's epoch.
        r_true_rtn_m, v_true_rtn_m_s: (F, 3) the chaser relative to the target.
        q_true_eci_from_body: (F, 4) the target's attitude, scalar first.
        omega_true_body_rad_s: (F, 3) its angular velocity relative to GCRF axes, body axes.
        r_rtn_m, v_rtn_m_s, q_eci_from_body, omega_body_rad_s: the same as estimated.
        covariance: (F, 12, 12) of the estimate's errors, as in :class:`posse_core.Estimate`.
        r_single_rtn_m: (F, 3) position by the frame's own pose alone.
        q_single_eci_from_body: (F, 4) attitude by the frame's own pose alone.
        burn_s: (F,) instant of the impulse after each frame.
        dv_commanded_rtn_m_s: (F, 3) the impulse that was commanded; zeros for none.
        dv_rtn_m_s: (F, 3) the impulse that was carried out.
        nis: (F,) normalised innovation squared of the readings.
        dof: (F,) int, number of scalar measurements.
        rejected: (F,) int, how many of them were rejected.
        t_waypoint_s, until_waypoint_s: (W,) when each waypoint is to be reached, and held until.
        r_waypoint_rtn_m, v_waypoint_rtn_m_s: (W, 3) the waypoints.
        keep_out_m: (3,) semi-axes of the keep-out ellipsoid along R, T, N; NaN where there is none.
        cone: (5,) axis in RTN, half angle (rad) and length (m) of the approach cone; NaN likewise.
        least_dv_m_s: () sum of the impulses of the best plan that knows everything.
    """

    t_s: FloatArray
    r_true_rtn_m: FloatArray
    v_true_rtn_m_s: FloatArray
    q_true_eci_from_body: FloatArray
    omega_true_body_rad_s: FloatArray
    r_rtn_m: FloatArray
    v_rtn_m_s: FloatArray
    q_eci_from_body: FloatArray
    omega_body_rad_s: FloatArray
    covariance: FloatArray
    r_single_rtn_m: FloatArray
    q_single_eci_from_body: FloatArray
    burn_s: FloatArray
    dv_commanded_rtn_m_s: FloatArray
    dv_rtn_m_s: FloatArray
    nis: FloatArray
    dof: IntArray
    rejected: IntArray
    t_waypoint_s: FloatArray
    until_waypoint_s: FloatArray
    r_waypoint_rtn_m: FloatArray
    v_waypoint_rtn_m_s: FloatArray
    keep_out_m: FloatArray
    cone: FloatArray
    least_dv_m_s: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)

    def arrays(self) -> dict[str, AnyArray]:
        """The arrays by name."""
        return {part.name: getattr(self, part.name) for part in fields(self)}
