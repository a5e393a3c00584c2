"""The real map with its clouds, water and air, and the Moon."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._environment.earthlight import earthlight_on_plate
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._scenario.sky import SkyConfig
from posse_core._sky import moon
from posse_core._sky.clouds import drifted, make_clouds
from posse_core._sky.earth import Earth
from posse_core._sky.environment import environment_map
from posse_core._sky.ground import WIND_M_S, Ground, blue_marble, glint_radiance, longitude_turns
from posse_core._sky.pyramid import Pyramid
from posse_core._sky.sky import Sky

SITES = {
    # latitude, longitude, share of water, red reflectance from … to (MODIS white-sky albedo)
    "Sahara": (22.0, 10.0, 0.0, (0.3, 0.55)),
    "Amazonia": (-5.0, -65.0, 0.0, (0.01, 0.06)),
    "Greenland": (72.0, -40.0, 0.0, (0.65, 1.0)),
    "Australia": (-25.0, 135.0, 0.0, (0.12, 0.4)),
    "Pacific": (0.0, -140.0, 1.0, None),
    "Indian Ocean": (-30.0, 80.0, 1.0, None),
    "Caspian Sea": (42.0, 50.5, 1.0, None),
    "Lake Victoria": (-1.0, 33.0, 1.0, None),
    "Strait of Sicily": (36.4, 12.9, 1.0, None),
}


def _normal(lat_deg, lon_deg) -> np.ndarray:
    lat, lon = np.deg2rad(lat_deg), np.deg2rad(lon_deg)
    position = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat) + 0 * lon]
    return np.stack(np.broadcast_arrays(*position)).astype(np.float32)


def _on_map(normal) -> tuple[np.ndarray, np.ndarray]:
    """Positions on a plate carrée map, 0 … 1."""
    return longitude_turns(normal), 0.5 - np.arcsin(normal[2]) / np.float32(np.pi)


def _log(footprint_m: float, like) -> np.ndarray:
    return np.full(np.shape(like), np.log2(footprint_m), np.float32)


@pytest.mark.parametrize("name", SITES)
def test_land_and_water_have_the_right_positions(name: str) -> None:
    lat, lon, wet, red = SITES[name]
    normal = _normal([lat], [lon])
    land, water = blue_marble().at(normal, *_on_map(normal), _log(5000.0, [lat]))
    assert water[0] == pytest.approx(wet, abs=0.05)
    if red is not None:
        assert red[0] < land[0, 0] < red[1]


def test_no_seam_at_the_date_line() -> None:
    """Values a kilometre apart differ no more across the meridian of 180° than elsewhere."""
    lat = np.linspace(-75, 75, 400)
    clouds = make_clouds(3)
    steps = []
    for lon in (179.9999, 37.0):
        normals = [_normal(lat, lon + step) for step in (0.0, 0.01)]
        a, b = (clouds.at(normal, *_on_map(normal), _log(40e3, lat))[0] for normal in normals)
        steps.append(np.abs(a - b).max())
    assert steps[0] < 2 * steps[1] + 0.05


def test_clouds_depend_on_the_seed_and_drift_with_the_wind() -> None:
    lat = np.zeros(500, np.float32)
    lon = np.linspace(-60, 60, 500)

    def row(clouds, t_s: float, shift_deg: float = 0.0) -> np.ndarray:
        normal = drifted(_normal(0.0, lon + shift_deg), lat, t_s)
        return clouds.at(normal, *_on_map(normal), _log(2000.0, lat))[0]

    one, other = make_clouds(0), make_clouds(3)
    make_clouds.cache_clear()
    np.testing.assert_array_equal(row(one, 0.0), row(make_clouds(0), 0.0))
    assert np.corrcoef(row(one, 0.0), row(other, 0.0))[0, 1] < 0.5
    # Trade winds blow to the west at 8 m/s, which is 0.26° per hour.
    hour_deg = -np.rad2deg(8.0 * 3600 / 6.378e6)
    np.testing.assert_allclose(row(one, 3600.0, hour_deg), row(one, 0.0), atol=0.05)


def test_glint_at_the_specular_point_agrees_with_cox_and_munk() -> None:
    """With Sun and camera in the zenith it is R₀ / (4 π σ²), where R₀ = ((n − 1)/(n + 1))²."""
    one = np.ones(1, np.float32)
    r0 = (0.34 / 2.34) ** 2
    expected = r0 / (4 * np.pi * (0.003 + 0.00512 * WIND_M_S))
    assert glint_radiance(one, one, one)[0] == pytest.approx(expected, rel=1e-4)
    # Both are 40° from the zenith: bright if the Sun is opposite, dark if it is behind the camera.
    forty, eighty = np.float32([np.cos(np.deg2rad(40))]), np.float32([np.cos(np.deg2rad(80))])
    assert glint_radiance(forty, forty, eighty)[0] > expected
    assert glint_radiance(forty, forty, one)[0] < 1e-4 * expected


def test_the_planetary_albedo_is_three_tenths(make_state) -> None:
    """From the mean over all directions of the irradiance far away; the earthshine on the Moon, which is
    visible light, gives 0.297 (Goode et al. 2001, Geophys. Res. Lett. 28, 1671)."""
    earth = Earth(blue_marble(), make_clouds(0))
    count, r = 40, 20 * 6.378137e6
    k = np.arange(count) + 0.5
    polar, around = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    positions = np.stack(
        [np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar), np.cos(polar)], -1
    )
    half = np.tan(np.arcsin(1.03 / 20))
    u = half * ((np.arange(40) + 0.5) / 20 - 1)
    rays = np.stack([*np.meshgrid(u, u), np.ones((40, 40))], axis=-1)
    solid = (half / 20) ** 2 / np.linalg.norm(rays, axis=-1) ** 4
    total = np.zeros(3)
    for position in positions:
        frame = make_state(
            r_camera_m=r * position, forward=-position, up=(0.1, 0.2, 1.0), sun=(1.0, 0.0, 0.0)
        )
        frame = make_state(
            r_camera_m=r * position,
            forward=-position,
            up=(0.1, 0.2, 1.0),
            r_sun_eci_m=np.array([1.5e11, 0, 0]),
        )
        total += np.einsum("ij,ijk->k", solid, earth.seen(frame).light(rays, half / 20).astype(float))
    reflected = total / count * 4 * np.pi * r**2
    received = np.pi * 6.371e6**2 * 1361.0 * SOLAR_BAND_FRACTIONS
    assert reflected.sum() / received.sum() == pytest.approx(0.297, abs=0.015)


def test_earthshine_agrees_with_the_albedo_model_of_the_dynamics(make_state) -> None:
    """For a plate that faces the Earth, around a polar orbit. The albedo model has zonal means only,
    without the weather of a day."""
    earth, angles = Earth(blue_marble(), make_clouds(0)), np.linspace(0, 2 * np.pi, 16, endpoint=False)
    positions = 7.08e6 * np.stack([np.cos(angles), 0.2 * np.cos(angles), np.sin(angles)], axis=-1)
    sun_m = np.array([1.4e11, 0.5e11, -0.3e11])
    shine = []
    for position in positions:
        frame = make_state(r_camera_m=position, forward=-position, up=(0.1, 1.0, 0.1), r_sun_eci_m=sun_m)
        light = environment_map(earth.seen(frame)).radiance_rgb.astype(float).sum(axis=2)
        h, w = light.shape
        edges = np.cos(np.pi * np.arange(h + 1) / h)
        theta, phi = np.pi * (np.arange(h) + 0.5) / h, 2 * np.pi * (np.arange(w) + 0.5) / w - np.pi
        forward = np.maximum(0, np.sin(theta)[:, None] * np.cos(phi))
        shine.append(np.sum(light * forward * (edges[:-1] - edges[1:])[:, None] * 2 * np.pi / w))
    model = earthlight_on_plate(
        r_eci_m=positions,
        normal_eci=-positions,
        r_sun_eci_m=np.broadcast_to(sun_m, (16, 3)),
        earth_pole_eci=np.broadcast_to([0.0, 0.0, 1.0], (16, 3)),
        jd_tt=np.full(16, frame.epoch_jd_tt),
        solar_flux_w_m2=np.full(16, 1361.0),
        earth_radius_m=6378137.0,
    )
    share = SOLAR_BAND_FRACTIONS.sum()
    expected = share * model.albedo_w_m2
    assert np.corrcoef(shine, expected)[0, 1] > 0.8
    assert np.mean(shine) == pytest.approx(expected.mean(), rel=0.2)


def test_the_low_sun_is_red_and_attenuated(make_camera, make_state) -> None:
    """Seen 15 km above the limb the Sun has lost its blue light; 60 km above it has lost almost
    nothing."""
    sky = Sky(SkyConfig(stars=None), make_camera(320, 240, hfov_deg=4), seed=0)
    r = 7.08e6
    blue = []
    for height_m in (15e3, 60e3):
        angle = np.pi - np.arcsin((6.378137e6 + height_m) / r)
        sun = (np.cos(angle), np.sin(angle), 0.0)
        frame = make_state(r_camera_m=(r, 0.0, 0.0), forward=sun, sun=sun, sun_angular_radius_rad=3e-4)
        rgb = sky.look(frame).radiance_rgb[115:125, 155:165].max(axis=(0, 1)) / SOLAR_BAND_FRACTIONS
        blue.append(rgb[2] / rgb[0])
    assert blue[0] < 0.6
    assert blue[1] > 0.9 * blue[0] + 0.3


def test_the_sky_over_the_day_side(make_camera, make_state) -> None:
    """The nadir is bright everywhere, the limb has a blue rim, and the zenith is black."""
    camera = make_camera(160, 120)
    sky = Sky(SkyConfig(stars=None), camera, seed=0)
    down = sky.look(make_state(forward=(-1.0, 0.0, 0.0))).radiance_rgb
    assert down.min() > 1.0  # W m⁻² sr⁻¹; a white plate in sunlight has 50
    assert down.max() < 70
    assert sky.look(make_state(forward=(1.0, 0.3, 0.0), sun=(-1.0, 0.0, 0.0))).radiance_rgb is None
    limb = sky.look(make_state(forward=(-0.45, 0.9, 0.0), up=(1.0, 0.0, 0.0))).radiance_rgb
    column = limb[:, 80]
    top = np.flatnonzero(column[:, 2] > 0.05)[0]
    assert column[top, 2] > 1.5 * column[top, 0]
    assert (limb[: top - 8, 75:85] < 0.02).all()


def test_the_night_side_is_dark_and_the_environment_map_contains_the_earth(
    make_camera, make_state
) -> None:
    sky = Sky(SkyConfig(stars=None), make_camera(160, 120), seed=0)
    night = make_state(forward=(-1.0, 0.0, 0.0), sun=(-1.0, 0.0, 0.0), sun_fraction_camera=0.0)
    rgb = sky.look(night).radiance_rgb
    assert rgb is None or rgb.max() < 1e-3
    environment = sky.environment(make_state(forward=(0.0, 1.0, 0.0), up=(1.0, 0.0, 0.0))).radiance_rgb
    assert environment[:28].max() < 0.5 < environment[40:].mean()  # the top row is up
    assert Sky(SkyConfig(earth=False), make_camera(160, 120), 0).environment(night) is None


@given(
    zenith=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    sun=st.one_of(
        st.none(), st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
    ),
    altitude_m=st.sampled_from([2e5, 7e5, 3.6e7, 3e8]),
    t_s=st.floats(0, 1e6),
)
def test_radiance_is_finite_and_never_negative(make_state, zenith, sun, altitude_m, t_s) -> None:
    """From any position and with any direction of the Sun, also in the zenith (``None``)."""
    zenith = np.array(zenith) / np.linalg.norm(zenith)
    sun = zenith if sun is None else np.array(sun) / np.linalg.norm(sun)
    position = (6.378137e6 + altitude_m) * zenith
    earth = Earth(blue_marble(), make_clouds(0)).seen(
        make_state(r_camera_m=position, forward=-zenith, up=(0.11, 0.23, 0.97), sun=sun, t_s=t_s)
    )
    half = 1.5 * np.arcsin(6.378e6 / (6.378e6 + altitude_m))
    u = np.tan(min(half, 1.4)) * np.linspace(-1, 1, 24)
    rays = np.stack([*np.meshgrid(u, u), np.ones((24, 24))], axis=-1)
    light, passed = earth.light(rays, 0.01), earth.passed(rays, 0.01)
    assert np.isfinite(light).all()
    assert light.min() >= 0
    assert light.max() < 3000  # not even the Sun's reflection at grazing incidence exceeds this
    assert passed.min() >= 0
    assert passed.max() <= 1
    assert (passed[12, 12] == 0).all()


@pytest.mark.parametrize(("phase_deg", "magnitudes"), [(0.0, 0.0), (45.0, 1.1864), (90.0, 2.6024)])
def test_the_moon_follows_its_phase_law(make_camera, make_state, phase_deg, magnitudes) -> None:
    """The irradiance is p E_sun (R/d)² · 10^(−0.4 Δm), with Δm of Allen's law computed by hand."""
    camera = make_camera(200, 200, hfov_deg=1)
    d = 3.844e8
    phase = np.deg2rad(phase_deg)
    frame = make_state(
        forward=(0.0, 1.0, 0.0),
        r_moon_eci_m=np.array([7.08e6, d, 0.0]),
        r_sun_eci_m=np.array([7.08e6, d, 0.0]) + 1.5e11 * np.array([np.sin(phase), -np.cos(phase), 0.0]),
    )
    rgb = Sky(SkyConfig(earth=False, stars=None, sun_disc=False), camera, 0).look(frame).radiance_rgb
    v, u = np.mgrid[:200, :200]
    solid = 1 / (camera.fx_px**2 * np.linalg.norm(camera.rays(np.stack([u, v], -1)), axis=-1) ** 3)
    total = np.einsum("ij,ijk->k", solid, rgb.astype(float))
    full = moon.GEOMETRIC_ALBEDO_RGB * 1361.0 * SOLAR_BAND_FRACTIONS * (1.7374e6 / d) ** 2
    assert total == pytest.approx(full * 10 ** (-0.4 * magnitudes), rel=0.02)
    lit = rgb[100, :, 1] > 0
    assert lit.sum() == pytest.approx(camera.fx_px * 1.7374e6 / d * (1 + np.cos(phase)), abs=3)


def _cells(at) -> np.ndarray:
    """(m, n) at the points of a grid → ((m − 1) (n − 1), 4) at those around each of its cells."""
    return np.lib.stride_tricks.sliding_window_view(at, (2, 2)).reshape(-1, 4)


@pytest.mark.parametrize("apart_deg", [0.02, 0.1, 0.3])
def test_open_sea_has_no_land_in_any_pixel(apart_deg: float) -> None:
    """Cells all over the globe, against the map in every pixel between their points."""
    random = np.random.default_rng(1)
    sea, ground = 0, blue_marble()
    for _ in range(150):
        lat, lon = np.rad2deg(np.arcsin(random.uniform(-0.95, 0.95))), random.uniform(-180, 180)
        fine = np.meshgrid(*(at + apart_deg / 8 * np.arange(-32, 33) for at in (lon, lat)))
        normal = _normal(fine[1], fine[0])
        place = _on_map(normal)
        _, water = ground.at(normal, *place, _log(apart_deg / 8 * 111e3, fine[0]))
        known = ground.is_open_sea(*(_cells(at[::8, ::8]) for at in place))
        within = np.lib.stride_tricks.sliding_window_view(water, (9, 9))[::8, ::8]
        assert (within.reshape(64, -1)[known] == 1).all()
        sea += np.count_nonzero(known)
    assert sea > 50 * 64


def test_a_single_island_is_found() -> None:
    """Land in one pixel of the map, wherever it is among the points of a grid."""
    land = np.zeros((2048, 4096, 4), np.uint8)
    land[..., 3] = 255
    place = _on_map(_normal(*np.meshgrid(np.linspace(-2.0, 2.0, 33), np.linspace(9.0, 13.0, 33))))
    grid = [_cells(at) for at in place]
    assert Ground(Pyramid(land)).is_open_sea(*grid).all()
    for column, row in ((2170, 1024), (2153, 1010), (2191, 1039), (2167, 1033)):
        island = land.copy()
        island[row, column, 3] = 0
        known = Ground(Pyramid(island)).is_open_sea(*grid)
        x, y = (column + 0.5) / 4096, (row + 0.5) / 2048
        around = (grid[0].min(axis=1) <= x) & (x <= grid[0].max(axis=1))
        around &= (grid[1].min(axis=1) <= y) & (y <= grid[1].max(axis=1))
        assert around.any()
        assert not known[around].any()
        assert known.mean() > 0.9


def test_a_kept_sheet_gives_the_samples_of_its_image() -> None:
    """At every level, and not for an image of another shape."""
    random = np.random.default_rng(5)
    image = random.random((75, 150, 3), dtype=np.float32)
    made = Pyramid(image)
    kept = Pyramid.kept(made.sheet, image.shape)
    x, y = random.random((2, 500), dtype=np.float32)
    level = (4 * random.random(500)).astype(np.float32)
    np.testing.assert_array_equal(kept.between(x, y, level), made.between(x, y, level))
    at = (np.array([[10, 149], [0, 74]]) + 0.5) / np.array([[150], [75]])
    np.testing.assert_allclose(
        kept.at(*at.astype(np.float32), np.zeros(2, np.float32)).T, image[[0, 74], [10, 149]], rtol=1e-4
    )
    with pytest.raises(ValueError, match="instead of"):
        Pyramid.kept(made.sheet, (64, 128, 3))
