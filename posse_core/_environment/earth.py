"""Orientation of the Earth, and of the TEME axes of TLEs, relative to GCRF axes.

Precession is IAU 2006 and nutation IAU 2000B (within 1 mas of 2000A for 1995–2050, which is 3 cm at
7000 km). Polar motion (below 0.6″) and the free core nutation are neglected. Times are those of
:class:`posse_core._environment.time.Epoch`.
"""

from __future__ import annotations

import erfa
import numpy as np

from posse_core._arrays import FloatArray


def earth_rotation_angle_rad(jd1_ut1: FloatArray, jd2_ut1: FloatArray) -> FloatArray:
    """Earth rotation angle, 0 … 2π, any shape (Capitaine et al. 2000; IERS Conventions 2010, 5.15)."""
    return np.asarray(erfa.era00(jd1_ut1, jd2_ut1))


def R_cirs_from_gcrf(jd1_tt: FloatArray, jd2_tt: FloatArray) -> FloatArray:
    """Rotation from GCRF axes to celestial intermediate axes: any shape → (..., 3, 3)."""
    nutation = erfa.nut00b(jd1_tt, jd2_tt)
    bias_precession_nutation = erfa.pn06(jd1_tt, jd2_tt, *nutation)[-1]
    x, y = erfa.bpn2xy(bias_precession_nutation)
    return np.asarray(erfa.c2ixys(x, y, erfa.s06(jd1_tt, jd2_tt, x, y)))


def R_itrf_from_gcrf(
    jd1_tt: FloatArray, jd2_tt: FloatArray, jd1_ut1: FloatArray, jd2_ut1: FloatArray
) -> FloatArray:
    """Rotation from GCRF axes to Earth-fixed axes, without polar motion: any shape → (..., 3, 3)."""
    era = earth_rotation_angle_rad(jd1_ut1, jd2_ut1)
    return np.asarray(erfa.rz(era, R_cirs_from_gcrf(jd1_tt, jd2_tt)))


def R_gcrf_from_teme(jd1_tt: FloatArray, jd2_tt: FloatArray) -> FloatArray:
    """Rotation from the true-equator mean-equinox axes of SGP4 to GCRF axes: any shape → (..., 3, 3).

    A rotation by GMST 1982 takes TEME axes to Earth-fixed axes (Vallado et al. 2006, AIAA 2006-6753,
    appendix C). TEME axes therefore differ from the celestial intermediate axes by a rotation of
    GMST − ERA. This angle changes by 0.1 mas in the 70 s between UT1 and TT, so TT is used for both.
    """
    gmst_minus_era = erfa.gmst82(jd1_tt, jd2_tt) - erfa.era00(jd1_tt, jd2_tt)
    R_teme_from_gcrf = erfa.rz(-gmst_minus_era, R_cirs_from_gcrf(jd1_tt, jd2_tt))
    return np.swapaxes(R_teme_from_gcrf, -1, -2)


R_GCRF_FROM_EME2000: FloatArray = np.array(erfa.bp06(erfa.DJ00, 0.0)[0].T)
"""(3, 3) rotation from axes of the mean equator and equinox of J2000 to GCRF axes.

Its angle is 23 mas, which is 0.8 m in a low orbit.
"""
R_GCRF_FROM_EME2000.setflags(write=False)
