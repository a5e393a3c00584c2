"""Heat from Sun and Earth: against closed forms and random rays."""

from dataclasses import replace

import numpy as np
import pytest
from thermal_bodies import SUN_W_M2, box, model, plate, sunshine

from posse_core._environment import earthlight
from posse_core._frames import R_about
from posse_core._sensors.thermal.heating import (
    Surroundings,
    heat_about,
    heat_at,
    history,
)
from posse_core._sensors.thermal.heating import (
    earthlight as earth_on,
)
from posse_core.testing import scenes

EARTH_M = 6378137.0


def earth_view_factor(tilt_rad: float, distance: float) -> float:
    """From a small plate to a sphere of radius 1, its normal at an angle from the sphere's centre
    (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-43; Modest, appendix D)."""
    horizon = np.arccos(1 / distance)
    if tilt_rad <= horizon:
        return np.cos(tilt_rad) / distance**2
    if tilt_rad >= np.pi - horizon:
        return 0.0
    root = np.sqrt(distance**2 - 1)
    return float(
        0.5
        - np.arcsin(root / (distance * np.sin(tilt_rad))) / np.pi
        + (
            np.cos(tilt_rad) * np.arccos(-root / np.tan(tilt_rad))
            - root * np.sqrt(1 - (distance * np.cos(tilt_rad)) ** 2)
        )
        / (np.pi * distance**2)
    )


def by_random_rays(tilt_rad: float, distance: float) -> float:
    """The same: the share of rays, spread by Lambert's law, that meet the sphere."""
    rng = np.random.default_rng(11)
    azimuth, square = rng.uniform(0, 2 * np.pi, 400_000), rng.uniform(0, 1, 400_000)
    sine = np.sqrt(square)
    rays = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.sqrt(1 - square)])
    to_centre = np.array([np.sin(tilt_rad), 0.0, np.cos(tilt_rad)])
    return float(np.mean(to_centre @ rays > np.sqrt(1 - 1 / distance**2)))


def above(distance: float, tilt_rad: float) -> Surroundings:
    """A plate with the body normal +z, tilted from the Earth's centre, at so many radii."""
    state = scenes.frame(t_body_cam_m=(0.0, 0.0, 10.0), sun_direction_body=(0.0, 1.0, 0.0))
    turn = R_about((0.0, 1.0, 0.0), -np.pi / 2 + tilt_rad)  # +z to the Earth at −x, and on
    craft = replace(state.craft, R_cam_from_body=state.R_cam_from_eci @ turn)
    return Surroundings.of(
        replace(state, craft=craft, r_target_eci_m=np.array([distance * EARTH_M, 0.0, 0.0]))
    )


TILTS_DEG = [0, 20, 45, 64, 70, 90, 110, 115, 120, 150]


@pytest.mark.parametrize("tilt_deg", TILTS_DEG)
def test_infrared_on_a_tilted_plate_is_its_view_factor(tilt_deg: float, monkeypatch):
    """At 705 km, where the horizon is 64.2° from nadir and cuts plates tilted by 25.8° to 154.2°."""
    monkeypatch.setattr(earthlight, "emissivity", lambda latitude, jd: np.full(latitude.shape, 0.7))
    distance, tilt = 1 + 705e3 / EARTH_M, np.radians(tilt_deg)
    facets = model(plate(0.001)).facets
    _, infrared = earth_on(facets, above(distance, tilt))
    exitance = 0.7 * SUN_W_M2 / 4
    exact = earth_view_factor(tilt, distance)
    assert infrared[0] / exitance == pytest.approx(exact, abs=1e-3)
    assert infrared[2] / exitance == pytest.approx(earth_view_factor(np.pi - tilt, distance), abs=1e-3)


@pytest.mark.parametrize("tilt_deg", [45, 64, 90, 120])
def test_the_closed_form_is_what_random_rays_count(tilt_deg: float):
    distance, tilt = 1 + 705e3 / EARTH_M, np.radians(tilt_deg)
    assert earth_view_factor(tilt, distance) == pytest.approx(by_random_rays(tilt, distance), abs=0.004)


def test_a_roof_hides_its_share_of_the_earth():
    """A plate under a roof of the same size, close by, gets almost nothing from there."""
    roof = scenes.rectangle(
        "roof", "plain", centre_m=(0.0, 0.0, 0.01), u_m=(1.0, 0.0, 0.0), v_m=(0.0, 1.0, 0.0)
    )
    facets = model(plate(0.1), roof).facets
    _, infrared = earth_on(facets, above(1.1, 0.0))
    assert infrared[:2].max() < 0.02 * infrared[2:4].max()


def test_sunlight_falls_by_the_cosine_on_the_side_that_faces_it():
    facets = model(plate()).facets
    for tilt_rad in (0.0, 0.7, 1.5, 2.0, 3.0):
        heat = heat_at(facets, sunshine((np.sin(tilt_rad), 0.0, np.cos(tilt_rad))))
        cosine = np.cos(tilt_rad)
        np.testing.assert_allclose(heat.sun_w_m2[:2], SUN_W_M2 * max(cosine, 0.0), atol=1e-9)
        np.testing.assert_allclose(heat.sun_w_m2[2:], SUN_W_M2 * max(-cosine, 0.0), atol=1e-9)


def test_a_spinning_plate_gets_the_mean_of_a_revolution():
    """Max(cos, 0) over a revolution is 1/π on each side."""
    facets = model(plate()).facets
    around = sunshine((0.3, 0.0, 1.0), omega_rad_s=(0.0, 1.6, 0.0))
    heat = heat_about(facets, around, span_s=60.0)
    np.testing.assert_allclose(heat.sun_w_m2, SUN_W_M2 / np.pi, rtol=0.005)


def test_a_slow_turn_is_the_mean_of_its_span():
    """A turn by 0.5 rad about the instant: the cosine's mean is its value times sin(¼)/¼."""
    facets = model(plate()).facets
    around = sunshine((np.sin(0.4), 0.0, np.cos(0.4)), omega_rad_s=(0.0, 0.01, 0.0))
    heat = heat_about(facets, around, span_s=50.0)
    exact = SUN_W_M2 * np.cos(0.4) * np.sin(0.25) / 0.25
    np.testing.assert_allclose(heat.sun_w_m2[:2], exact, rtol=0.002)


def test_a_body_at_rest_gets_the_heat_of_the_instant():
    """Shadows apart, which may be of a direction nearby: a box has none on itself."""
    facets = model(box("box", (1.0, 1.0, 1.0))).facets
    around = sunshine((1.0, 2.0, 2.0))
    np.testing.assert_allclose(
        heat_about(facets, around, 60.0).sun_w_m2, heat_at(facets, around).sun_w_m2
    )


def test_a_history_finds_the_sunset():
    sunset_s = -1234.5

    def at(after_s: float) -> Surroundings:
        return sunshine((1.0, 0.0, 0.0), t_s=500 + after_s, sun_w_m2=SUN_W_M2 * (after_s < sunset_s))

    past = history(at, 6000.0, 60)
    times_s = np.array([around.t_s for around in past])
    assert times_s[0] == 500 - 6000
    assert times_s[-1] == 500
    assert np.all(np.diff(times_s) > 0)
    assert len(times_s) < 61 + 8
    before = times_s[times_s < 500 + sunset_s].max()
    after = times_s[times_s >= 500 + sunset_s].min()
    assert after - before <= 4.0
