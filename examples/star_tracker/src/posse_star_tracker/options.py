"""Options of the sensor ``star-tracker``."""

from __future__ import annotations

from pydantic import Field

import posse_core as posse


class StarTrackerOptions(posse.Options):
    """Optics, detector and limits; the defaults are those of a small tracker for a CubeSat."""

    fov_deg: float = Field(20.0, gt=0, le=90, description="full angle of the round field of view")
    max_magnitude: float = Field(5.5, le=9, description="magnitude of the faintest star that is found")
    aperture_mm: float = Field(20.0, gt=0, description="diameter of the lens")
    exposure_s: float = Field(0.1, gt=0, description="exposure time, seconds")
    blur_arcsec: float = Field(
        60.0, gt=0, description="standard deviation of the light of a star about its centre"
    )
    floor_arcsec: float = Field(
        2.0, ge=0, description="standard deviation of a direction however bright the star is"
    )
    sun_exclusion_deg: float = Field(
        35.0, ge=0, le=180, description="least angle between the axis and a Sun that is not eclipsed"
    )
    earth_exclusion_deg: float = Field(
        15.0, ge=0, le=90, description="least angle between the axis and the limb of the Earth"
    )
    max_rate_deg_s: float = Field(2.0, gt=0, description="fastest turn at which stars are found")
