"""Readings in a simulator: stars are where almanac and image have them, errors as large as said, and the
tracker is blinded by what it should be."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import posse_core as posse
from posse_star_tracker.catalogue import catalogue

J2000_JD_TT = 2451545.0
SMALL = {
    "camera.width_px": 64,
    "camera.height_px": 64,
    "camera.hfov_deg": 18,
    "sky.earth": False,
    "sky.stars.max_magnitude": 8,
    "renderer": {"name": "mitsuba", "spp": 1},
}
NO_LIMITS = {"sun_exclusion_deg": 0, "earth_exclusion_deg": 0}
AHEAD = {"type": "star-tracker", "max_magnitude": 7, **NO_LIMITS}
UP = {"type": "star-tracker", "mount": {"rotation_vector_deg": [90, 0, 0]}}


@pytest.fixture(scope="module")
def sim() -> Iterator[posse.Simulator]:
    """Aqua, with a tracker that looks ahead, past it, and one that looks up."""
    scenario = Path(__file__).parents[1] / "scenario.yaml"
    with posse.open(scenario, overrides={**SMALL, "sensors": {"ahead": AHEAD, "up": UP}}) as sim:
        yield sim


def shot(sim: posse.Simulator, to_eci: Rotation, index: int = 0, ahead_m: float = -40.0) -> posse.Frame:
    """A frame of a camera with this attitude, with the target so far ahead on its axis."""
    r, v = (sim.trajectory.r_target_eci_m[0], sim.trajectory.v_target_eci_m_s[0])
    normal = np.cross(r, v)
    R_rtn_from_eci = np.stack([each / np.linalg.norm(each) for each in (r, np.cross(normal, r), normal)])
    r_rtn_m = -ahead_m * R_rtn_from_eci @ to_eci.apply([0, 0, 1])
    q = to_eci.as_quat(scalar_first=True)
    return sim.frame(sim.state(index, t_s=0.0, r_rtn_m=r_rtn_m, q_eci_from_camera=q))


def looking_at(direction_eci: posse.FloatArray) -> Rotation:
    return Rotation.from_matrix(posse.R_with_z(direction_eci / np.linalg.norm(direction_eci)))


def at_dark_sky(sim: posse.Simulator) -> Rotation:
    """At right angles to Sun and Earth."""
    return looking_at(np.cross(sim.trajectory.r_sun_eci_m[0], sim.trajectory.r_target_eci_m[0]))


@pytest.mark.parametrize(
    ("hip", "ra_hours", "dec_deg"),
    [
        (32349, (6, 45, 8.917), (-16, 42, 58.02)),  # Sirius
        (91262, (18, 36, 56.336), (38, 47, 1.28)),  # Vega
        (71683, (14, 39, 36.494), (-60, 50, 2.37)),  # α Centauri A
        (11767, (2, 31, 49.095), (89, 15, 50.79)),  # Polaris
    ],
)
def test_stars_are_where_the_almanac_has_them(
    hip: int, ra_hours: tuple[float, float, float], dec_deg: tuple[float, float, float]
) -> None:
    """ICRS at J2000, by SIMBAD."""
    stars = catalogue(5.5)
    (row,) = np.flatnonzero(stars.hip == hip)
    sign = np.sign(dec_deg[0])
    ra = np.radians(15 * (ra_hours[0] + ra_hours[1] / 60 + ra_hours[2] / 3600))
    dec = np.radians(dec_deg[0] + sign * (dec_deg[1] / 60 + dec_deg[2] / 3600))
    expected = [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
    error_rad = np.linalg.norm(stars.directions_at(J2000_JD_TT)[row] - expected)
    assert np.degrees(error_rad) * 3600 < 0.2


def test_stars_are_where_the_image_has_them(sim: posse.Simulator) -> None:
    """The sky of the camera's image, which the core computes, has a star at each direction measured.
    Aberration, for which a tracker corrects, displaces it by up to 26″."""
    frame = shot(sim, at_dark_sky(sim))
    (reading,) = frame.readings["ahead"]
    measured_px = sim.camera.project(reading.arrays["direction_sensor"])
    inside = ((measured_px > 0) & (measured_px < 63)).all(axis=1)
    assert inside.sum() > 20
    apart_px = np.linalg.norm(measured_px[inside, None] - frame.light.sky.points_px, axis=-1)
    assert np.degrees(apart_px.min(axis=1).max() / sim.camera.fx_px) * 3600 < 60


def test_the_spacecraft_hides_stars(sim: posse.Simulator) -> None:
    """From two places with the same attitude, the stars that are seen from one of them alone are those
    that the spacecraft covers in the other's image."""
    to_eci = at_dark_sky(sim)
    free, blocked = shot(sim, to_eci), shot(sim, to_eci, ahead_m=60)
    (there,), (here,) = free.readings["ahead"], blocked.readings["ahead"]
    missing = ~np.isin(there.arrays["hip"], here.arrays["hip"])
    assert np.isin(here.arrays["hip"], there.arrays["hip"]).all()
    pixels = np.rint(sim.camera.project(there.arrays["direction_sensor"])).astype(int)
    assert 3 < missing.sum() < len(missing)
    coverage = np.pad(blocked.coverage, 1)
    for (u, v), hidden in zip(pixels, missing, strict=True):
        if 0 <= u < 64 and 0 <= v < 64:
            around = coverage[v : v + 3, u : u + 3]
            assert around.max() > 0 if hidden else around.min() < 1


def test_errors_are_as_large_as_said(sim: posse.Simulator) -> None:
    """Errors of attitude and directions over their standard deviations have unit variance."""
    camera_from_up = Rotation.from_rotvec([np.pi / 2, 0, 0])
    squares, directions = [], []
    for index in range(40):
        turn = Rotation.from_rotvec([0, 0, 0.15 * index])
        to_eci = at_dark_sky(sim) * turn * camera_from_up.inv()
        (reading,) = shot(sim, to_eci, index).readings["up"]
        labels, arrays = reading.labels, reading.arrays
        true = to_eci * camera_from_up
        found = Rotation.from_quat(labels["q_eci_from_sensor"], scalar_first=True)
        squares.append(((true.inv() * found).as_rotvec() / labels["sigma_rad"]) ** 2)
        expected = true.apply(arrays["direction_eci"], inverse=True)
        off = np.linalg.norm(arrays["direction_sensor"] - expected, axis=1)
        directions += list((off / arrays["sigma_rad"]) ** 2)
    for axis in np.transpose(squares):
        assert 1e-4 < chi2.cdf(axis.sum(), len(axis)) < 1 - 1e-4
    assert 1e-4 < chi2.cdf(np.sum(directions), 2 * len(directions)) < 1 - 1e-4


@pytest.mark.parametrize(("margin_deg", "expected"), [(-1.0, True), (1.0, False)])
def test_what_blinds_it(sim: posse.Simulator, margin_deg: float, expected: bool) -> None:
    """By default 35° from the Sun, 15° from the Earth's limb, and 2° per second."""
    camera_from_up = Rotation.from_rotvec([np.pi / 2, 0, 0])
    sun = sim.trajectory.r_sun_eci_m[0]
    r_m = sim.trajectory.r_target_eci_m[0]
    limb_deg = np.degrees(np.arcsin(6378.137e3 / np.linalg.norm(r_m)))
    for direction, least_deg, name in ((sun, 35.0, "sun"), (-r_m, limb_deg + 15.0, "earth")):
        for axis in ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]):
            aside = Rotation.from_rotvec(np.radians(least_deg + margin_deg) * np.array(axis))
            to_eci = looking_at(direction) * aside * camera_from_up.inv()
            (reading,) = shot(sim, to_eci).readings["up"]
            if reading.labels["blinded_by"] in (None, name):  # the other one may be near as well
                break
        assert (reading.labels["blinded_by"] == name) == expected
        assert (len(reading.arrays["hip"]) == 0) == expected
    to_eci = at_dark_sky(sim) * camera_from_up.inv()
    state = sim.state(
        t_s=0.0,
        q_eci_from_camera=to_eci.as_quat(scalar_first=True),
        omega_camera_rad_s=[0, np.radians(2 - 0.1 * margin_deg), 0],
    )
    (reading,) = sim.frame(state).readings["up"]
    assert (reading.labels["blinded_by"] == "rate") == expected
