"""Temperatures of bodies with closed forms, and the radiance of their surfaces."""

import numpy as np
import pytest
import trimesh
from thermal_bodies import SIGMA, SUN_W_M2, box, equilibrium_k, model, plate, sunshine

from posse_core import InputError, Material, Part, create
from posse_core._sensors.thermal.model import Temperatures
from posse_core._sensors.thermal.options import SurfaceOptions
from posse_core._sensors.thermal.planck import Band
from posse_core._sensors.thermal.surfaces import surface_of, surfaces_of

LWIR = Band(8e-6, 14e-6)


def ball(subdivisions: int = 3) -> Part:
    mesh = trimesh.creation.icosphere(subdivisions)
    none = np.zeros((len(mesh.vertices), 3), dtype=np.float32)
    faces = np.array(mesh.faces, dtype=np.int32)
    return Part("ball", np.array(mesh.vertices), faces, none, none[:, :2], "plain")


def test_a_plate_that_faces_the_sun_radiates_from_both_sides():
    """At 1 au: T = (αS/2εσ)^¼, for a sheet and for a thin panel."""
    exact_k = equilibrium_k(0.6 * SUN_W_M2 / 2, 0.8)
    sheet = model(plate()).steady(sunshine((0.0, 0.0, 1.0))).temperature_k
    np.testing.assert_allclose(sheet, exact_k, rtol=1e-6)
    panel = model(box("panel", (1.0, 1.0, 0.01)), facet_m=0.3)
    broad = np.abs(panel.facets.normal[2]) > 0.5
    both = panel.steady(sunshine((0.0, 0.0, 1.0))).temperature_k[broad]
    np.testing.assert_allclose(both, exact_k, rtol=1e-6)


def test_a_plate_with_an_insulated_back_is_hotter():
    """T = (αS/εσ)^¼: the sunlit side of a thick box."""
    body = model(box("bus", (1.0, 1.0, 1.0)))
    sunlit = body.facets.normal[2] > 0.5
    temperature_k = body.steady(sunshine((0.0, 0.0, 1.0))).temperature_k
    np.testing.assert_allclose(temperature_k[sunlit], equilibrium_k(0.6 * SUN_W_M2, 0.8), rtol=1e-6)
    np.testing.assert_allclose(temperature_k[~sunlit], 2.725)


def test_a_box_in_the_suns_sight_from_a_corner():
    body = model(box("bus", (1.0, 2.0, 0.5)), absorptance=0.3, emissivity=0.7)
    temperature_k = body.steady(sunshine((1.0, 2.0, 2.0))).temperature_k
    cosine = np.clip(np.array([1.0, 2.0, 2.0]) / 3 @ body.facets.normal, 0, None)
    exact_k = np.maximum(equilibrium_k(0.3 * SUN_W_M2 * cosine, 0.7), 2.725)
    np.testing.assert_allclose(temperature_k, exact_k, rtol=1e-6)


def test_a_sphere_that_does_not_conduct_is_hottest_under_the_sun():
    """T = (αS cos θ/εσ)^¼; the mean of the fourth powers is that of an isothermal sphere, αS/4εσ."""
    body = model(ball())
    temperature_k = body.steady(sunshine((0.2, -0.5, 1.0))).temperature_k
    sun = np.array([0.2, -0.5, 1.0]) / np.linalg.norm([0.2, -0.5, 1.0])
    cosine = np.clip(sun @ body.facets.normal, 0, None)
    exact_k = np.maximum(equilibrium_k(0.6 * SUN_W_M2 * cosine, 0.8), 2.725)
    np.testing.assert_allclose(temperature_k, exact_k, rtol=1e-5)
    mean4 = np.average(temperature_k**4, weights=body.facets.area_m2)
    # The facets' area across the sunlight is 0.6 % below the sphere's, and their surface too.
    assert mean4**0.25 == pytest.approx(float(equilibrium_k(0.6 * SUN_W_M2 / 4, 0.8)), rel=2e-3)


def test_a_heater_inside_keeps_the_dark_side_warm():
    body = model(box("bus", (1.0, 1.0, 1.0)), internal_power_w_m2=100.0)
    dark = body.facets.normal[2] < 0.5
    temperature_k = body.steady(sunshine((0.0, 0.0, 1.0))).temperature_k
    np.testing.assert_allclose(temperature_k[dark], equilibrium_k(100.0, 0.8), rtol=1e-6)


def test_faces_that_see_only_each_other_come_to_one_temperature():
    """In a gap far narrower than wide, without heat of their own: that of the common wall."""
    lower = box("lower", (1.0, 1.0, 0.5), centre_m=(0.0, 0.0, -0.51))
    upper = box("upper", (1.0, 1.0, 0.5), centre_m=(0.0, 0.0, 0.51))
    body = model(lower, upper, facet_m=0.5)
    gap = body.facets.openness[: body.facets.count] < 0.05
    temperature_k = body.steady(sunshine((1.0, 0.0, 0.0))).temperature_k
    assert gap.sum() >= 8
    np.testing.assert_allclose(temperature_k[gap], body.balance.wall_k(temperature_k), rtol=0.02)


def test_a_spacecraft_at_rest_comes_to_its_steady_state():
    body = model(box("bus", (1.0, 1.0, 1.0)), internal_power_w_m2=50.0)
    past = [sunshine((1.0, 2.0, 2.0), t_s=60.0 * k) for k in range(40)]
    steady = body.steady(past[-1])
    transient = body.transient(past)
    np.testing.assert_allclose(transient.temperature_k, steady.temperature_k, atol=0.02)
    np.testing.assert_array_equal(transient.heat.sun_w_m2, steady.heat.sun_w_m2)


def test_in_eclipse_a_sheet_cools_by_the_closed_form():
    """Sunlit for so long that it is in equilibrium, and then 20 minutes in the dark; both sides radiate
    and
    share one heat capacity: T = (T₀⁻³ + 6εσt/C)^(−1/3)."""
    body = model(plate(), heat_capacity_j_m2_k=5000.0)
    lit_s, dark_s = np.arange(0.0, 40000.0, 50.0), np.arange(40000.0, 41201.0, 20.0)
    past = [sunshine((0.0, 0.0, 1.0), t_s=t) for t in lit_s]
    past += [sunshine((0.0, 0.0, 1.0), t_s=t, sun_w_m2=0.0) for t in dark_s]
    start_k = equilibrium_k(0.6 * SUN_W_M2 / 2, 0.8)
    # The light falls off evenly in the last sunlit step: half of its 50 s count as dark.
    exact_k = (start_k**-3 + 6 * 0.8 * SIGMA * 1225.0 / 5000.0) ** (-1 / 3)
    np.testing.assert_allclose(body.transient(past).temperature_k, exact_k, atol=0.3)


def test_a_black_surface_has_plancks_radiance_and_a_grey_one_reflects_the_rest():
    for emissivity in (1.0, 0.4):
        body = model(box("bus", (1.0, 1.0, 1.0)), emissivity=emissivity)
        heat = body.steady(sunshine((0.0, 0.0, 1.0))).heat
        at = Temperatures(np.full(body.facets.count, 300.0), heat)
        front = body.radiance_w_m2_sr(at, LWIR)[: body.facets.count]
        dark = body.facets.normal[2] < 0.5
        own = emissivity * float(LWIR.radiance_w_m2_sr(np.array(300.0)))
        np.testing.assert_allclose(front[dark], own, rtol=1e-12)
        # Sunlight in the band: the solid angle of the Sun times the radiance of 5772 K, 1.72 W/m².
        in_band = np.pi * (695.7e6 / 149597870700.0) ** 2 * LWIR.radiance_w_m2_sr(np.array(5772.0))
        reflected = (1 - emissivity) * in_band / np.pi
        np.testing.assert_allclose(front[~dark] - own, reflected, rtol=2e-3, atol=1e-12)


def test_a_hollow_of_one_temperature_is_black():
    """Kirchhoff: where all around has its temperature, a surface of any emissivity shines as a black
    one."""
    outer = box("outer", (1.0, 1.0, 1.0))
    inner = box("inner", (0.2, 0.2, 0.2))
    body = model(outer, inner, emissivity=0.3)
    heat = body.steady(sunshine((0.0, 0.0, 1.0))).heat
    at = Temperatures(np.full(body.facets.count, 280.0), heat)
    radiance = body.radiance_w_m2_sr(at, LWIR)[: body.facets.count]
    inside = body.facets.part_id == 1
    np.testing.assert_allclose(radiance[inside], LWIR.radiance_w_m2_sr(np.array(280.0)), rtol=1e-9)


def test_surfaces_follow_the_material():
    white = surface_of(Material("white", base_color=(0.8, 0.8, 0.8)))
    assert (white.solar_absorptance, white.emissivity) == (pytest.approx(0.2), pytest.approx(0.85))
    bright = surface_of(Material("bright", base_color=(1.0, 1.0, 1.0), metallic=1.0))
    assert (bright.solar_absorptance, bright.emissivity) == (pytest.approx(0.0), pytest.approx(0.05))
    dark = surface_of(Material("dark", base_color=(0.0, 0.0, 0.0), metallic=1.0))
    assert (dark.solar_absorptance, dark.emissivity) == (pytest.approx(1.0), pytest.approx(0.85))
    texture = np.full((2, 2, 3), 188, dtype=np.uint8)  # half of white, in linear light
    half = surface_of(Material("half", base_color_texture=texture))
    assert half.solar_absorptance == pytest.approx(0.5, abs=0.005)


def test_what_a_user_gives_replaces_the_material():
    aqua = create("scene", "aqua").build()
    given = {"panel_3": SurfaceOptions(emissivity=0.5)}
    paint = {"solar_panel": SurfaceOptions(solar_absorptance=0.6, emissivity=0.9)}
    surfaces = dict(
        zip((part.name for part in aqua.parts), surfaces_of(aqua, paint, given), strict=True)
    )
    assert (surfaces["panel_2"].solar_absorptance, surfaces["panel_2"].emissivity) == (0.6, 0.9)
    assert (surfaces["panel_3"].solar_absorptance, surfaces["panel_3"].emissivity) == (0.6, 0.5)
    assert surfaces["bus"].emissivity == 0.63
    with pytest.raises(InputError, match=r"parts: .*'panel_33'; did you mean 'panel_3'\?"):
        surfaces_of(aqua, {}, {"panel_33": SurfaceOptions(emissivity=0.5)})
