"""Stars against published positions and magnitudes, and against ERFA's space motion."""

import erfa
import numpy as np
import pytest
from starlight import apparent

from posse_core._constants import SPEED_OF_LIGHT_M_S, Constants
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._scenario.sky import SkyConfig, StarsConfig
from posse_core._sky.sky import Sky
from posse_core._sky.stars import (
    aberrated,
    hipparcos,
    irradiance_rgb_w_m2,
    random_field,
    temperature_k,
    v_from_hp,
)

J2000 = 2451545.0
# Positions at J2000, ICRS, and V from SIMBAD (most after Ducati 2002, CDS II/237). The two stars of
# Acrux are one in Hipparcos; its V is that of the first catalogue (I/239, field H5).
KNOWN = {
    "Sirius": ("06:45:08.917", "-16:42:58.02", -1.46),
    "Canopus": ("06:23:57.110", "-52:41:44.38", -0.74),
    "Alpha Centauri A": ("14:39:36.494", "-60:50:02.37", 0.01),
    "Arcturus": ("14:15:39.672", "+19:10:56.67", -0.05),
    "Vega": ("18:36:56.336", "+38:47:01.28", 0.03),
    "Capella": ("05:16:41.359", "+45:59:52.77", 0.08),
    "Rigel": ("05:14:32.272", "-08:12:05.90", 0.13),
    "Procyon": ("07:39:18.119", "+05:13:29.96", 0.37),
    "Achernar": ("01:37:42.845", "-57:14:12.31", 0.46),
    "Betelgeuse": ("05:55:10.305", "+07:24:25.43", 0.42),
    "Hadar": ("14:03:49.405", "-60:22:22.93", 0.60),
    "Acrux": ("12:26:35.896", "-63:05:56.73", 0.77),
    "Altair": ("19:50:46.999", "+08:52:05.96", 0.76),
    "Aldebaran": ("04:35:55.239", "+16:30:33.49", 0.86),
    "Antares": ("16:29:24.460", "-26:25:55.21", 0.91),
    "Spica": ("13:25:11.579", "-11:09:40.75", 0.97),
    "Pollux": ("07:45:18.950", "+28:01:34.32", 1.14),
    "Fomalhaut": ("22:57:39.046", "-29:37:20.05", 1.16),
    "Mimosa": ("12:47:43.269", "-59:41:19.58", 1.25),
    "Deneb": ("20:41:25.915", "+45:16:49.22", 1.25),
    "Alpha Centauri B": ("14:39:35.063", "-60:50:15.10", 1.33),
    "Regulus": ("10:08:22.311", "+11:58:01.95", 1.40),
    "Adhara": ("06:58:37.549", "-28:58:19.51", 1.50),
}


def _direction(ra: str, dec: str) -> np.ndarray:
    h, m, s = map(float, ra.split(":"))
    d, am, asec = map(float, dec.lstrip("+-").split(":"))
    sign = -1 if dec[0] == "-" else 1
    return erfa.s2c(
        np.deg2rad(15 * (h + m / 60 + s / 3600)), sign * np.deg2rad(d + am / 60 + asec / 3600)
    )


@pytest.mark.parametrize("name", KNOWN)
def test_bright_stars_have_the_published_positions_and_magnitudes(name: str) -> None:
    ra, dec, v = KNOWN[name]
    field = hipparcos(6.5)
    separation = np.linalg.norm(field.directions_at(J2000) - _direction(ra, dec), axis=1)
    nearest = np.argmin(separation)
    assert separation[nearest] < np.deg2rad(0.5 / 3600)
    # The green band is at the centre of V, so its irradiance is converted back to a magnitude.
    at_zero = irradiance_rgb_w_m2(np.array([0.0]), np.array([10000.0]))[0, 1]
    assert -2.5 * np.log10(field.irradiance_rgb_w_m2[nearest, 1] / at_zero) == pytest.approx(v, abs=0.09)


def test_no_other_star_is_as_bright() -> None:
    assert len(hipparcos(1.505).directions) == len(KNOWN)


def test_space_motion_agrees_with_erfa() -> None:
    """Barnard's star, 10.4″ per year, against the rigorous model with its published catalogue row."""
    jd = 2459610.58
    ra, dec = np.deg2rad(269.45402305), np.deg2rad(4.66828815)
    mas = np.deg2rad(1 / 3600e3)
    row = erfa.starpm(
        ra, dec, -797.84 * mas / np.cos(dec), 10326.93 * mas, 0.5494, 0.0, 2448349.0625, 0.0, jd, 0.0
    )
    truth = erfa.s2c(row[0], row[1])
    separation = np.linalg.norm(hipparcos(9.8).directions_at(jd) - truth, axis=1)
    assert separation.min() < np.deg2rad(0.3 / 3600)


def test_a_fainter_limit_includes_every_brighter_star() -> None:
    few, many = hipparcos(4.0), hipparcos(6.5)
    shared = (few.directions[:, None] == many.directions[None]).all(axis=2).any(axis=1)
    assert shared.all()
    assert 450 < len(few.directions) < 560  # the Bright Star Catalogue has some 500 to V 4.0
    assert 7500 < len(many.directions) < 9100


def test_the_suns_colour_and_magnitude_give_the_solar_irradiance() -> None:
    """V = −26.76 (Willmer 2018); at 545 nm the Sun is 5 % brighter than its black body."""
    rgb = irradiance_rgb_w_m2(np.array([-26.76]), np.array([5772.0]))[0]
    assert rgb == pytest.approx(Constants().solar_constant_w_m2 * SOLAR_BAND_FRACTIONS, rel=0.06)
    assert temperature_k(np.array([0.653]))[0] == pytest.approx(5772, abs=60)


def test_hp_equals_v_for_white_stars_and_is_fainter_for_red_ones() -> None:
    assert v_from_hp(np.array([5.0]), np.array([0.0]))[0] == 5.0
    # HIP 2: Hp 9.4017, B−V 0.999, V 9.27 (Hipparcos main catalogue).
    assert v_from_hp(np.array([9.4017]), np.array([0.999]))[0] == pytest.approx(9.27, abs=0.04)


def test_stars_are_projected_by_the_camera_matrix(make_camera, make_state) -> None:
    """Against ERFA's spherical astronomy: standard coordinates about the optical axis."""
    camera = make_camera(640, 480)
    frame = make_state(forward=erfa.s2c(1.2, 0.3), r_camera_m=(3e6, 6e6, 2e6))
    view = Sky(SkyConfig(earth=False), camera, seed=0).look(frame)
    field = hipparcos(6.5)
    stars = apparent(field.directions_at(frame.epoch_jd_tt), frame.epoch_jd_tt)
    ra, dec = erfa.c2s(stars)
    near = stars @ erfa.s2c(1.2, 0.3) > 0.5
    xi, eta = erfa.tpxes(ra[near], dec[near], 1.2, 0.3)
    u = camera.cx_px - camera.fx_px * xi  # right ascension grows to the left when north is up
    v = camera.cy_px - camera.fy_px * eta
    expected = np.stack([u, v], axis=-1)[(u >= -0.5) & (u <= 639.5) & (v >= -0.5) & (v <= 479.5)]
    assert len(expected) > 300
    distance = np.linalg.norm(expected[:, None] - view.points_px[None], axis=2).min(axis=1)
    assert distance.max() < 1e-6
    inside = np.all((view.points_px >= -0.5) & (view.points_px <= [639.5, 479.5]), axis=1)
    assert inside.sum() == len(expected)


@pytest.mark.parametrize("speed_m_s", [0.0, 7500.0])
def test_stars_are_displaced_by_the_motion_of_earth_and_camera(
    make_camera, make_state, speed_m_s: float
) -> None:
    """Against Skyfield's aberration and ERFA's velocity of the Earth, in a star tracker's image."""
    camera = make_camera(1024, 1024, hfov_deg=12)
    velocity = speed_m_s * np.array([0.0, 0.6, 0.8])
    frame = make_state(forward=(1.0, 0.0, 0.1), r_camera_m=(7e6, 0, 0), v_camera_eci_m_s=velocity)
    found = Sky(SkyConfig(earth=False), camera, seed=0).look(frame).points_px
    still = hipparcos(6.5).directions_at(frame.epoch_jd_tt)
    seen, unmoved = (
        camera.project(stars[stars @ frame.R_cam_from_eci[2] > 0.99] @ frame.R_cam_from_eci.T)
        for stars in (apparent(still, frame.epoch_jd_tt, velocity), still)
    )
    inside = np.all((seen > 0) & (seen < 1023), axis=1)
    assert inside.sum() > 20
    off = np.linalg.norm(seen[inside][:, None] - found[None], axis=2).min(axis=1)
    assert off.max() < 1e-5
    assert np.linalg.norm(seen - unmoved, axis=1)[inside].max() > 0.15


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0, 150.0, 180.0])
def test_aberration_follows_its_closed_form(angle_deg: float) -> None:
    """tan θ'/2 = tan θ/2 √((1 − β)/(1 + β)) (Einstein 1905, § 7), here at a tenth of the speed of
    light."""
    angle = np.deg2rad(angle_deg)
    star = np.array([[np.sin(angle), 0.0, np.cos(angle)]])
    seen = aberrated(star, np.array([0.0, 0.0, 0.1 * SPEED_OF_LIGHT_M_S]))[0]
    expected = 2 * np.arctan(np.tan(angle / 2) * np.sqrt(0.9 / 1.1))
    assert np.arctan2(seen[0], seen[2]) == pytest.approx(expected, abs=1e-8)


def test_the_earth_hides_stars_below_its_limb(make_camera, make_state) -> None:
    """From 700 km the limb is asin(Rₑ / r) away from the nadir; ellipsoid and sphere differ by 0.3°."""
    camera = make_camera()
    frame = make_state(r_camera_m=(0.0, 7.08e6, 0.0), forward=(1.0, 0.0, 0.0))
    view = Sky(SkyConfig(earth=False), camera, seed=0).look(frame)
    rays = camera.rays(view.points_px) @ frame.R_cam_from_eci
    from_nadir = np.arccos(-rays[:, 1] / np.linalg.norm(rays, axis=1))
    limb = np.arcsin(6.378137e6 / 7.08e6)
    assert len(from_nadir) > 100
    assert from_nadir.min() > limb - np.deg2rad(0.4)
    above = Sky(SkyConfig(earth=False), camera, seed=0).look(
        make_state(r_camera_m=(0.0, 7.08e6, 0.0), forward=(0.0, 1.0, 0.0))
    )
    assert len(above.points_px) > len(view.points_px)


def test_gain_scales_stars_and_null_removes_them(make_camera, make_state) -> None:
    frame, camera = make_state(), make_camera()
    one = Sky(SkyConfig(earth=False), camera, seed=0).look(frame)
    ten = Sky(SkyConfig(earth=False, stars=StarsConfig(gain=10)), camera, seed=0).look(frame)
    none = Sky(SkyConfig(earth=False, stars=None), camera, seed=0).look(frame)
    np.testing.assert_allclose(
        ten.points_irradiance_rgb_w_m2, 10 * one.points_irradiance_rgb_w_m2, rtol=1e-12
    )
    assert none.points_px.shape == (0, 2)
    assert none.radiance_rgb is None


def test_the_thesis_stars_have_three_sizes_and_colours_and_depend_on_the_seed(
    make_camera, make_state
) -> None:
    field = random_field(7, 40.0)
    assert len(field.directions) == round(4 * np.pi * 400) + round(4 * np.pi * 225) + round(
        4 * np.pi * 100
    )
    colours = np.round(field.irradiance_rgb_w_m2[:, 2] / field.irradiance_rgb_w_m2[:, 0], 6)
    assert len(np.unique(colours)) == 3
    assert np.linalg.norm(field.directions.mean(axis=0)) < 0.05  # all over the sky
    # Strengths are uniform in 0 … 4, so the brightest of the medium stars has V = 3 − 2.5 lg 4.
    assert len(random_field(7, 1.49).directions) == 0
    assert len(random_field(7, 2.25).directions) == pytest.approx(0.5 * 4 * np.pi * 100, rel=0.1)
    config = SkyConfig(earth=False, stars=StarsConfig(catalogue="thesis"))
    views = [Sky(config, make_camera(), seed).look(make_state()).points_px for seed in (1, 1, 2)]
    np.testing.assert_array_equal(views[0], views[1])
    assert views[0].shape != views[2].shape or (views[0] != views[2]).any()
