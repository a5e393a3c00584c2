"""Orientation of the Earth and of the frame that TLEs live in, against GCRF axes.

Precession IAU 2006, nutation IAU 2000B (within 1 mas of 2000A, 1995–2050: 3 cm at 7000 km). Polar
motion (below 0.6″) and the free core nutation are left out. Times: see
:class:`posse_core._environment.time.Epoch`.
"""

from __future__ import annotations

import erfa
import numpy as np

from posse_core._arrays import FloatArray


def earth_rotation_angle_rad(jd1_ut1: FloatArray, jd2_ut1: FloatArray) -> FloatArray:
    """Earth rotation angle, 0 … 2π, any shape (Capitaine et al. 2000; IERS Conventions 2010 5.15)."""
    return np.asarray(erfa.era00(jd1_ut1, jd2_ut1))


def R_cirs_from_gcrf(jd1_tt: FloatArray, jd2_tt: FloatArray) -> FloatArray:
    """Celestial intermediate axes from GCRF axes: any shape → (..., 3, 3)."""
    nutation = erfa.nut00b(jd1_tt, jd2_tt)
    bias_precession_nutation = erfa.pn06(jd1_tt, jd2_tt, *nutation)[-1]
    x, y = erfa.bpn2xy(bias_precession_nutation)
    return np.asarray(erfa.c2ixys(x, y, erfa.s06(jd1_tt, jd2_tt, x, y)))


def R_itrf_from_gcrf(
    jd1_tt: FloatArray, jd2_tt: FloatArray, jd1_ut1: FloatArray, jd2_ut1: FloatArray
) -> FloatArray:
    """Earth-fixed axes from GCRF axes, without polar motion: any shape → (..., 3, 3)."""
    era = earth_rotation_angle_rad(jd1_ut1, jd2_ut1)
    return np.asarray(erfa.rz(era, R_cirs_from_gcrf(jd1_tt, jd2_tt)))


def R_gcrf_from_teme(jd1_tt: FloatArray, jd2_tt: FloatArray) -> FloatArray:
    """GCRF axes from the true-equator mean-equinox axes of SGP4: any shape → (..., 3, 3).

    TEME is the frame that GMST 1982 turns into the Earth-fixed one (Vallado et al. 2006, AIAA
    2006-6753, appendix C). Against the celestial intermediate axes it is turned by GMST − ERA,
    which moves by 0.1 mas in the 70 s between UT1 and TT, so TT serves for both.
    """
    gmst_minus_era = erfa.gmst82(jd1_tt, jd2_tt) - erfa.era00(jd1_tt, jd2_tt)
    R_teme_from_gcrf = erfa.rz(-gmst_minus_era, R_cirs_from_gcrf(jd1_tt, jd2_tt))
    return np.swapaxes(R_teme_from_gcrf, -1, -2)


R_GCRF_FROM_EME2000: FloatArray = np.array(erfa.bp06(erfa.DJ00, 0.0)[0].T)
"""(3, 3) GCRF axes from the mean equator and equinox of J2000: 23 mas, 0.8 m in a low orbit."""
R_GCRF_FROM_EME2000.setflags(write=False)
