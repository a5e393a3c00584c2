"""The motion of target and chaser over the frames of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from posse_core._arrays import AnyArray, FloatArray, IntArray

PLANE_TURN = "plane_turn_rad_s"
"""Name of the extra (F,) with the rate at which the orbit's plane turns about R under J2. Velocities in
RTN are in axes that turn at it too; without the extra it is 0."""


@dataclass(frozen=True)
class Motion:
    """The result of a propagator for F frames. ``posse_core._frames`` defines the RTN axes.

    Attributes:
        t_s: (F,) seconds since the scenario's epoch.
        r_target_eci_m, v_target_eci_m_s: (F, 3) geocentric position and velocity, GCRF axes.
        r_chaser_rtn_m: (F, 3) the chaser's position relative to the target, target's RTN axes.
        v_chaser_rtn_m_s: (F, 3) its derivative in the rotating RTN axes.
        sequence: (F,) int; frames of one continuous relative orbit have the same value.
        extras: further results of the propagator by name: (F, ...) finite numbers, such as
            ``{"drag_m_s2": (F, 3)}``. Names consist of lower-case letters, digits and underscores. In
            the trajectory's file a name has the prefix ``extra_``.
    """

    t_s: FloatArray
    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    r_chaser_rtn_m: FloatArray
    v_chaser_rtn_m_s: FloatArray
    sequence: IntArray
    extras: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def plane_turn_rad_s(self) -> FloatArray:
        """(F,) see :data:`PLANE_TURN`."""
        return self.extras.get(PLANE_TURN, np.zeros(len(self.t_s)))


@dataclass(frozen=True)
class Trajectory:
    """Motion, attitude and illumination for F frames: everything that a scene needs from the dynamics.

    Attributes:
        epoch_utc: the epoch t_s = 0, ISO 8601.
        t_s: (F,) seconds since the epoch.
        sequence: (F,) int, see :class:`Motion`.
        r_target_eci_m, v_target_eci_m_s, r_chaser_eci_m, v_chaser_eci_m_s: (F, 3) geocentric positions
            and velocities, GCRF axes.
        r_chaser_rtn_m, v_chaser_rtn_m_s: (F, 3) the chaser's position relative to the target, and its
            derivative in the rotating axes, target's RTN axes.
        q_eci_from_body, q_eci_from_camera: (F, 4) unit quaternions, scalar first, w ≥ 0.
        omega_body_rad_s, omega_camera_rad_s: (F, 3) angular velocities relative to GCRF axes, in body
            axes and in camera axes.
        r_sun_eci_m, r_moon_eci_m: (F, 3) geocentric positions, geometric, GCRF axes.
        sun_fraction_target, sun_fraction_camera: (F,) share of the Sun's disc in view, 0 … 1.
        solar_flux_w_m2: (F,) irradiance at the target by the whole disc.
        earth_albedo_w_m2, earth_infrared_w_m2: (F,) irradiance by sunlight that the Earth reflects, and
            by its infrared radiation, on a plate at the target that faces the Earth's centre.
        earth_rotation_rad: (F,) Earth rotation angle, 0 … 2π.
        extras: further results of the propagator, see :class:`Motion`.
    """

    epoch_utc: str
    t_s: FloatArray
    sequence: IntArray
    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    r_chaser_rtn_m: FloatArray
    v_chaser_rtn_m_s: FloatArray
    r_chaser_eci_m: FloatArray
    v_chaser_eci_m_s: FloatArray
    q_eci_from_body: FloatArray
    q_eci_from_camera: FloatArray
    omega_body_rad_s: FloatArray
    omega_camera_rad_s: FloatArray
    r_sun_eci_m: FloatArray
    r_moon_eci_m: FloatArray
    sun_fraction_target: FloatArray
    sun_fraction_camera: FloatArray
    solar_flux_w_m2: FloatArray
    earth_albedo_w_m2: FloatArray
    earth_infrared_w_m2: FloatArray
    earth_rotation_rad: FloatArray
    extras: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def plane_turn_rad_s(self) -> FloatArray:
        """(F,) see :data:`PLANE_TURN`."""
        return self.extras.get(PLANE_TURN, np.zeros(len(self.t_s)))

    def __len__(self) -> int:
        return len(self.t_s)

    def arrays(self) -> dict[str, AnyArray]:
        """The arrays (F, ...) by name, without :attr:`extras`."""
        return {name: getattr(self, name) for name in TRAJECTORY_ARRAYS}

    def rows(self, indices: AnyArray | slice) -> Trajectory:
        """The trajectory of the frames with these indices, in their order.

        Args:
            indices: (K,) int, 0 … F − 1, or a slice.
        """
        arrays = {name: array[indices] for name, array in self.arrays().items()}
        extras = {name: array[indices] for name, array in self.extras.items()}
        return Trajectory(epoch_utc=self.epoch_utc, **arrays, extras=extras)


TRAJECTORY_ARRAYS = tuple(
    part.name for part in fields(Trajectory) if part.name not in ("epoch_utc", "extras")
)
"""Names of the arrays that every trajectory has."""
