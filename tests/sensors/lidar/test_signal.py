"""The strength of what returns, by the lidar equation and by closed forms of optics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.constants import c, h
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from posse_core._geometry.surface import SurfaceMaterial
from posse_core._model.spacecraft import Material
from posse_core._sensors.lidar.reflection import reflectance_at, reflected_sr
from posse_core.testing import scenes

EXACT = {"shot": False, "receiver_e": 0.0, "range_m": 0.0}
ENERGY_J, WAVELENGTH_M, APERTURE_M, EFFICIENCY, QUANTUM = 3e-6, 1.064e-6, 0.05, 0.6, 0.3
E_PER_J = EFFICIENCY * QUANTUM * WAVELENGTH_M / (h * c)


def keys(rays=1, divergence_rad=5e-4, **noise):
    return {
        "pattern": {
            "shape": "raster",
            "rays": rays,
            "columns": 1,
            "rows": 1,
            "pulse_energy_j": ENERGY_J,
            "divergence_rad": divergence_rad,
        },
        "wavelength_m": WAVELENGTH_M,
        "receiver": {
            "aperture_m": APERTURE_M,
            "efficiency": EFFICIENCY,
            "quantum_efficiency": QUANTUM,
            "saturation_e": None,
        },
        "noise": {**EXACT, **noise},
    }


def signal_e(sense, distance_m, tilt_deg=0.0, material=None, rays=1, divergence_rad=5e-4):
    material = material or Material("m", (0.4, 0.3, 0.2), specular=0.0)
    wall = scenes.rectangle("wall", "m", u_m=(distance_m, 0, 0), v_m=(0, distance_m, 0))
    R = Rotation.from_euler("y", tilt_deg, degrees=True).as_matrix() @ scenes.FACING
    options = keys(rays, divergence_rad)
    reading = sense([wall], options, t_m=(0, 0, distance_m), R_cam_from_body=R, materials=(material,))
    return float(reading.arrays["intensity_e"][0])


@pytest.mark.parametrize("distance_m", [3.0, 40.0, 700.0])
@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 60.0, 80.0])
def test_a_lambertian_plate_by_the_lidar_equation(sense, distance_m, tilt_deg):
    """P_r = P_t ρ cos θ D² η / (4 R²), in photons; ρ is the red band's, nearest to the infrared."""
    cosine = math.cos(math.radians(tilt_deg))
    share = 0.4 * cosine * APERTURE_M**2 / (4 * distance_m**2)
    assert signal_e(sense, distance_m, tilt_deg) == pytest.approx(ENERGY_J * share * E_PER_J, rel=1e-9)
    # A real beam has the same signal, but for the wavefront's curvature over its cross-section.
    many = signal_e(sense, distance_m, tilt_deg, rays=19)
    assert many == pytest.approx(ENERGY_J * share * E_PER_J, rel=1e-5)


def test_a_flash_divides_its_energy_among_the_pixels(sense):
    wall = scenes.rectangle("wall", "matt", u_m=(30, 0, 0), v_m=(0, 30, 0))
    options = keys()
    options["pattern"] = {
        "shape": "flash",
        "width_px": 8,
        "height_px": 4,
        "pulse_energy_j": 5e-3,
        "hfov_deg": 1,
    }
    reading = sense([wall], options, t_m=(0, 0, 20))
    per_pixel = 5e-3 / 32 * 0.4 * APERTURE_M**2 / (4 * 20**2) * E_PER_J
    np.testing.assert_allclose(reading.arrays["intensity_e"], per_pixel, rtol=5e-4)


@pytest.mark.parametrize("distance_m", [10.0, 200.0])
def test_a_mirror_returns_the_beam_of_its_image(sense, distance_m):
    """A beam with the full angle θ comes from the sensor's image at 2 R: a Gaussian spot whose
    irradiance on the axis is 2 P / (π (θ R)²), if the aperture is small in it."""
    mirror = Material("m", (1, 1, 1), metallic=1.0, roughness=0.0)
    theta = 0.02
    irradiance = 2 * ENERGY_J / (math.pi * (theta * distance_m) ** 2)
    expected = irradiance * math.pi / 4 * APERTURE_M**2 * E_PER_J
    found = signal_e(sense, distance_m, 0, mirror, divergence_rad=theta)
    assert found == pytest.approx(expected, rel=(APERTURE_M / (theta * distance_m)) ** 2)


@pytest.mark.parametrize("rays", [19, 37, 200])
@pytest.mark.parametrize("share", [0.0, 0.25])
def test_the_rays_of_a_beam_together_return_what_the_beam_does(sense, rays, share):
    """A mirror that is turned by a share of θ displaces the spot by twice as much. Rays are few for a
    lobe as narrow as this; a metal of roughness 0.1 is 30 times wider than a beam of 0.5 mrad."""
    mirror = Material("m", (1, 1, 1), metallic=1.0, roughness=0.0)
    theta, distance_m = 0.02, 100.0
    irradiance = 2 * ENERGY_J / (math.pi * (theta * distance_m) ** 2)
    displaced = math.exp(-2 * (2 * share * theta * distance_m) ** 2 / (theta * distance_m) ** 2)
    expected = irradiance * displaced * math.pi / 4 * APERTURE_M**2 * E_PER_J
    tilt_deg = math.degrees(share * theta)
    found = signal_e(sense, distance_m, tilt_deg, mirror, rays=rays, divergence_rad=theta)
    assert found == pytest.approx(expected, rel=0.15)
    metal = Material("m", (1, 1, 1), metallic=1.0, roughness=0.1)
    alone, together = (signal_e(sense, distance_m, 0, metal, rays=n) for n in (1, rays))
    assert together == pytest.approx(alone, rel=1e-3)


def test_no_mirror_returns_more_than_was_sent(sense):
    mirror = Material("m", (1, 1, 1), metallic=1.0, roughness=0.0)
    for distance_m in (0.5, 10.0, 1000.0):
        found = signal_e(sense, distance_m, 0, mirror, divergence_rad=0.0)
        assert found == pytest.approx(ENERGY_J * E_PER_J, rel=1e-6)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.7])
def test_a_rough_metal_has_the_lobe_of_its_facets(sense, roughness):
    """D(θ) / (4 ...) with Smith's masking at equal angles; D itself is normalised over the facets."""
    metal = Material("m", (0.9, 0.9, 0.9), metallic=1.0, roughness=roughness)
    alpha2 = roughness**4

    def facets(theta):
        return alpha2 / (math.pi * (math.cos(theta) ** 2 * (alpha2 - 1) + 1) ** 2)

    whole, _ = quad(
        lambda t: facets(t) * math.cos(t) * 2 * math.pi * math.sin(t), 0, math.pi / 2, limit=200
    )
    assert whole == pytest.approx(1, rel=1e-6)
    for tilt_deg in (0.0, 5.0, 25.0, 60.0):
        theta = math.radians(tilt_deg)
        # Height-correlated masking of both directions (Heitz 2014): 1 / (1 + 2 Λ).
        masking = 1 / math.sqrt(1 + alpha2 * math.tan(theta) ** 2)
        brdf = 0.9 * facets(theta) * masking / (4 * math.cos(theta) ** 2)
        share = brdf * math.cos(theta) * math.pi / 4 * APERTURE_M**2 / 20**2
        found = signal_e(sense, 20.0, tilt_deg, metal, divergence_rad=1e-6)
        assert found == pytest.approx(ENERGY_J * share * E_PER_J, rel=2e-2 if roughness < 0.2 else 1e-3)


def test_the_two_sides_of_a_part_reflect_alike(sense):
    found = [signal_e(sense, 20.0, tilt) for tilt in (20.0, 200.0)]
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_metal_foil_and_paint_differ(sense):
    """Facing the beam a metal is brightest; off its lobe paint is."""
    metal = Material("m", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.35)
    paint = Material("m", (0.8, 0.8, 0.8), roughness=0.9)
    assert signal_e(sense, 20.0, 0, metal) > 5 * signal_e(sense, 20.0, 0, paint)
    assert signal_e(sense, 20.0, 45, metal) < 0.2 * signal_e(sense, 20.0, 45, paint)


def test_wrinkles_of_a_normal_map_widen_the_lobe(sense):
    """A map that tilts all facets by 20° moves the lobe by as much."""
    code = np.rint((np.array([math.sin(math.radians(20)), 0, math.cos(math.radians(20))]) + 1) / 2 * 255)
    texture = code.astype(np.uint8)[None, None]
    metal = Material("m", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.3, normal_texture=texture)
    found = [signal_e(sense, 20.0, tilt, metal) for tilt in (-20.0, 0.0, 20.0)]
    assert found[1] < 0.2 * max(found)
    assert max(found[0], found[2]) > 100 * min(found[0], found[2])


def test_the_colour_at_a_wavelength():
    """Between the bands' centres it is interpolated, and beyond them it is the nearest band's."""
    color = np.array([[0.9, 0.5, 0.1]])
    at = {400e-9: 0.1, 450e-9: 0.1, 500e-9: 0.3, 550e-9: 0.5, 620e-9: 0.78, 650e-9: 0.9, 1550e-9: 0.9}
    for wavelength_m, expected in at.items():
        assert reflectance_at(color, wavelength_m)[0] == pytest.approx(expected, rel=1e-9)


def test_reflection_is_reciprocal_and_loses_light():
    """f(l, v) = f(v, l), and no more is reflected into all directions than arrives, but for the light
    that glTF's layers count twice at grazing angles."""
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(20_000, 3))
    directions[:, 2] = np.abs(directions[:, 2])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[directions[:, 2] > 1e-3]
    normal = np.broadcast_to([0.0, 0.0, 1.0], directions.shape)
    for metallic, roughness, specular in [(0, 0.8, 0), (0, 0.5, 1), (1, 0.4, 1), (0.5, 0.6, 1)]:
        count = len(directions)
        material = SurfaceMaterial(
            np.ones((count, 3)), *(np.full(count, float(x)) for x in (metallic, roughness, specular))
        )
        light = np.broadcast_to([math.sin(0.6), 0.0, math.cos(0.6)], directions.shape)
        white = np.ones(count)
        there = reflected_sr(material, white, normal, light, directions, 0.0)
        back = reflected_sr(material, white, normal, directions, light, 0.0)
        np.testing.assert_allclose(there * directions[:, 2], back * math.cos(0.6), rtol=1e-9)
        # Uniform directions: the mean over the hemisphere, times 2π.
        total = 2 * math.pi * np.mean(there * directions[:, 2]) / math.cos(0.6)
        assert 0.5 < total < 1.02
