"""Directions of stars as a moving camera sees them, by other libraries than POSSE."""

from __future__ import annotations

import erfa
import numpy as np
from skyfield.relativity import add_aberration

AU_M = 149_597_870_700.0


def apparent(directions: np.ndarray, jd_tt: float, v_camera_m_s=(0.0, 0.0, 0.0)) -> np.ndarray:
    """(S, 3) unit vectors of stars, with Skyfield's aberration and the Earth's velocity by ERFA's
    ``epv00`` → (S, 3) unit vectors."""
    _, barycentric = erfa.epv00(jd_tt, 0.0)
    velocity_au_day = barycentric["v"] + np.asarray(v_camera_m_s) / AU_M * 86400
    light_days = 1e9  # far away
    positions = directions.T * (light_days * 173.14463267424034)
    velocities = np.repeat(velocity_au_day[:, None], len(directions), axis=1)
    add_aberration(positions, velocities, np.full(len(directions), light_days))
    return positions.T / np.linalg.norm(positions.T, axis=1, keepdims=True)
