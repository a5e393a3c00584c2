"""Limb, terminator and reflected light of a grey Earth without clouds and air, against closed forms."""

import erfa
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._sky.earth import Earth
from posse_core._sky.environment import environment_map
from posse_core._sky.ground import Ground
from posse_core._sky.pyramid import Pyramid

A_M, B_M = 6378137.0, 6356752.314245
ALBEDO = (140 / 255) ** 2  # exactly representable in the map's 8 bits


@pytest.fixture(scope="module")
def grey() -> Earth:
    """Grey land everywhere, no clouds, no air."""
    land = np.full((64, 128, 3), np.rint(255 * np.sqrt(ALBEDO)), np.uint8)  # the map stores square roots
    water = np.zeros((64, 128, 1), np.uint8)
    return Earth(Ground(Pyramid(np.dstack([land, water]))), clouds=None, air=False)


def _spin(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])


def _level(point: np.ndarray) -> float:
    """Below 1 inside the ellipsoid, above 1 outside."""
    return (point[0] ** 2 + point[1] ** 2) / A_M**2 + point[2] ** 2 / B_M**2


@pytest.fixture(scope="module")
def over_europe(make_state):
    """A camera 700 km above 50° N that looks at the northern horizon; the Earth is rotated by 0.7
    rad."""
    r = 7.07e6 * np.array([np.cos(0.87), 0.0, np.sin(0.87)])
    up = r / np.linalg.norm(r)
    forward = -0.42 * up + 0.9 * np.array([-np.sin(0.87), 0.3, np.cos(0.87)])
    return make_state(
        r_camera_m=r, forward=forward, up=up, sun=(-0.1, 1.0, 0.1), R_ecef_from_eci=_spin(0.7)
    )


def _ray_ecef(frame, camera, u: float, v: float) -> tuple[np.ndarray, np.ndarray]:
    R = frame.R_ecef_from_eci
    ray = R @ frame.R_cam_from_eci.T @ camera.rays(np.array([u, v]))
    return R @ frame.r_camera_eci_m, ray / np.linalg.norm(ray)


@pytest.mark.parametrize("column", [3, 100, 250])
def test_the_limb_is_that_of_the_ellipsoid(grey, over_europe, make_camera, column: int) -> None:
    camera = make_camera(320, 240)
    rows = np.arange(240.0)
    rays = camera.rays(np.stack([np.full(240, float(column)), rows], axis=-1))
    open_sky = grey.seen(over_europe).passed(rays, 1 / camera.fx_px)[:, 0]
    edge = open_sky.sum() - 0.5  # pixels above the limb; row 0 begins at −0.5

    def lowest(v: float) -> float:
        o, d = _ray_ecef(over_europe, camera, column, v)
        return (
            minimize_scalar(lambda t: _level(o + 1e6 * t * d), bounds=(0, 12), method="bounded").fun - 1
        )

    assert edge == pytest.approx(brentq(lowest, 0, 200), abs=0.2)


@pytest.mark.parametrize("row", [175, 200, 235])
def test_at_the_terminator_the_sun_is_on_the_horizon(grey, over_europe, make_camera, row: int) -> None:
    """ERFA's geodetic latitude gives the vertical; the lit side rises linearly from zero."""
    camera = make_camera(320, 240)
    columns = np.arange(320.0)
    rays = camera.rays(np.stack([columns, np.full(320, float(row))], axis=-1))
    light = grey.seen(over_europe).light(rays, 1 / camera.fx_px)[:, 1].astype(float)
    sun = over_europe.R_ecef_from_eci @ over_europe.r_sun_eci_m
    sun /= np.linalg.norm(sun)

    def elevation_sine(u: float) -> float:
        o, d = _ray_ecef(over_europe, camera, u, row)
        way = brentq(lambda t: _level(o + t * d) - 1, 0, -o @ d, xtol=1e-3)
        lon, lat, _ = erfa.gc2gd(1, o + way * d)
        return float(erfa.s2c(lon, lat) @ sun)

    expected = brentq(elevation_sine, 5, 314)
    lit = np.flatnonzero(light > 0)
    assert 0 < len(lit) < 320
    # A straight line through four pixels near the edge, but not the outermost, extrapolated to zero.
    first = lit[2:6] if lit[-1] == 319 else lit[-6:-2]
    slope, offset = np.polyfit(columns[first], light[first], 1)
    assert -offset / slope == pytest.approx(expected, abs=0.2)


def _shine_w_m2(r_m: np.ndarray, facing: np.ndarray, sun: np.ndarray) -> float:
    """Irradiance of a plate by a Lambertian ellipsoid in sunlight of 1 W/m², as a sum over its area."""
    lat, lon = np.meshgrid(
        (np.arange(400) + 0.5) / 400 * np.pi - np.pi / 2,
        (np.arange(800) + 0.5) / 400 * np.pi,
        indexing="ij",
    )
    # lat is the parametric latitude.
    point = np.stack(
        [A_M * np.cos(lat) * np.cos(lon), A_M * np.cos(lat) * np.sin(lon), B_M * np.sin(lat)], -1
    )
    area = A_M * np.cos(lat) * np.hypot(A_M * np.sin(lat), B_M * np.cos(lat)) * (np.pi / 400) ** 2
    normal = point / np.array([A_M**2, A_M**2, B_M**2])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    way = r_m - point
    distance = np.linalg.norm(way, axis=-1)
    way /= distance[..., None]
    cosines = [np.maximum(0, c) for c in (normal @ sun, np.sum(normal * way, -1), -(way @ facing))]
    return float(np.sum(ALBEDO / np.pi * cosines[0] * cosines[1] * cosines[2] / distance**2 * area))


def _plate_w_m2(environment, facing_cam: np.ndarray) -> np.ndarray:
    """(3,) irradiance of a plate by an environment map."""
    h, w = environment.radiance_rgb.shape[:2]
    theta, phi = np.pi * (np.arange(h) + 0.5) / h, 2 * np.pi * (np.arange(w) + 0.5) / w - np.pi
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    direction = np.stack(
        [np.sin(theta) * np.sin(phi), -np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    )
    edges = np.cos(np.pi * np.arange(h + 1) / h)
    solid = (edges[:-1] - edges[1:])[:, None] * 2 * np.pi / w
    weight = solid * np.maximum(0, direction @ facing_cam)
    return np.einsum("ij,ijk->k", weight, environment.radiance_rgb.astype(float))


@pytest.mark.parametrize("altitude_m", [400e3, 700e3, 2e7])
@pytest.mark.parametrize("sun_angle", [0.0, 0.8, 1.7])
def test_earthshine_on_a_plate_agrees_with_a_sum_over_the_ground(
    grey, make_state, altitude_m: float, sun_angle: float
) -> None:
    zenith = np.array([0.6, 0.0, 0.8])
    sun = np.cos(sun_angle) * zenith + np.sin(sun_angle) * np.array([0.0, 1.0, 0.0])
    r = (A_M + altitude_m) * zenith
    # The Sun is 1 au away, so its directions from the camera and the ground differ by 0.01 degrees.
    frame = make_state(r_camera_m=r, forward=(0.3, 0.7, -0.2), sun=sun)
    environment = environment_map(grey.seen(frame))
    for facing in (-zenith, np.array([0.0, 0.8, -0.6])):
        expected = 1361.0 * SOLAR_BAND_FRACTIONS * _shine_w_m2(r, facing, sun)
        got = _plate_w_m2(environment, frame.R_cam_from_eci @ facing)
        assert got == pytest.approx(expected, rel=0.01)


def test_a_far_full_earth_has_the_geometric_albedo_of_a_lambert_sphere(
    grey, make_camera, make_state
) -> None:
    """E = ⅔ ρ E_sun (R/r)² (Lambert 1760)."""
    camera = make_camera(241, 241, hfov_deg=0.3)
    r = 4e9
    frame = make_state(r_camera_m=(r, 0.0, 0.0), forward=(-1.0, 0.0, 0.0), sun=(1.0, 0.0, 0.0))
    v, u = np.mgrid[:241, :241]
    rays = camera.rays(np.stack([u, v], axis=-1))
    solid = 1 / (camera.fx_px**2 * np.linalg.norm(rays, axis=-1) ** 3)
    light = grey.seen(frame).light(rays, 1 / camera.fx_px)
    total = np.einsum("ij,ijk->k", solid, light.astype(float))
    expected = 2 / 3 * ALBEDO * 1361.0 * SOLAR_BAND_FRACTIONS * A_M * B_M / r**2
    assert total == pytest.approx(expected, rel=0.005)
