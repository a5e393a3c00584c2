"""All physical constants, in SI units.

A scenario may override those in :class:`Constants` with its key ``constants``.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

SPEED_OF_LIGHT_M_S = 299_792_458.0
PLANCK_J_S = 6.626_070_15e-34
BOLTZMANN_J_K = 1.380_649e-23
EARTH_ROTATION_RATE_RAD_S = 7.292_115_146_706_979e-5
"""Rate of the Earth rotation angle (IERS Conventions 2010, eq. 5.15)."""
THESIS_SOLAR_CONSTANT_W_M2 = 1367.0
"""Total solar irradiance at 1 au in the POSSE thesis (eq. 3.6)."""
WGS84_FLATTENING = 1.0 / 298.257_223_563


class Constants(BaseModel):
    """Constants that the motion and the illumination depend on."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    mu_earth_m3_s2: float = Field(
        3.986004418e14, gt=0, description="Earth's gravitational parameter (WGS 84)."
    )
    earth_radius_m: float = Field(6378137.0, gt=0, description="Earth's equatorial radius (WGS 84).")
    j2: float = Field(1.08262668e-3, description="Earth's second zonal harmonic, unnormalised.")
    sun_radius_m: float = Field(695.7e6, gt=0, description="Nominal solar radius (IAU 2015 B3).")
    au_m: float = Field(149_597_870_700.0, gt=0, description="Astronomical unit (IAU 2012 B2).")
    solar_constant_w_m2: float = Field(
        1361.0,
        gt=0,
        description="Total solar irradiance at 1 au (IAU 2015 B3); 1367 with propagator thesis.",
    )
    eclipse_flattening: float = Field(
        0.0,
        ge=0,
        lt=0.1,
        description="Flattening of the Earth for its shadow: 0 is a sphere, WGS 84 has"
        " 0.0033528106647474805.",
    )
