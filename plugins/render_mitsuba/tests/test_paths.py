"""POSSE's path tracer for the compiled variants against Mitsuba's own, which the scalar variant uses."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from posse_core import AnyArray, CraftState, EnvironmentMap, Material, PixelBox, RenderRequest
from posse_core.testing import scenes
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.renderer import MitsubaRenderer

METAL = Material("metal", base_color=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.4)
GLOSS = Material("gloss", base_color=(0.3, 0.7, 0.5), metallic=0.0, roughness=0.3)
MATT = Material("matt", base_color=(0.8, 0.5, 0.2), specular=0.0)
SPP = 16
FRAME = scenes.frame(t_body_cam_m=(0, 0, 6), sun_direction_body=(1, 0.5, 1.5)).craft
BOX = PixelBox(0, 0, 96, 72)


def sky(share: float) -> EnvironmentMap:
    """A sky that is bright on one side. Its mean radiance gives a plate ``share`` of the Sun's
    irradiance."""
    radiance = share * FRAME.sun_irradiance_rgb_w_m2.mean() / np.pi
    rows = np.full((32, 64, 3), radiance, dtype=np.float32)
    rows[:, :32] *= 1.9
    rows[:, 32:] *= 0.1
    return EnvironmentMap(rows)


def rendered(
    variant: Literal["auto", "scalar"],
    frame: CraftState,
    environment: EnvironmentMap | None,
    depth: int,
    plate: Material = GLOSS,
) -> AnyArray:
    """(8, 72, 96, 3) images of a metal ball that touches a plate, with eight seeds."""
    options = MitsubaOptions(spp=SPP, max_depth=depth, variant=variant)
    ball = scenes.sphere("ball", "metal", rings=32)
    square = scenes.rectangle("plate", plate.name, u_m=(3, 0, 0), v_m=(0, 3, 0), centre_m=(0, 0, -1))
    renderer = MitsubaRenderer(options)
    renderer.open(scenes.scene(ball, square, materials=(METAL, plate), camera=scenes.camera()))
    if variant == "auto" and renderer.describe()["variant"] == "scalar_rgb":
        renderer.close()
        # Without a libLLVM there is nothing to compare: auto then uses Mitsuba's own path tracer.
        pytest.skip("no libLLVM works on this machine")
    requests = [RenderRequest(frame, BOX, environment, seed) for seed in range(8)]
    images = np.stack([renderer.render(request).radiance_rgb for request in requests])
    renderer.close()
    return images


@pytest.mark.parametrize("share", [None, 0.5], ids=["Sun alone", "Sun and sky"])
@pytest.mark.parametrize("depth", [2, 3, 12])
def test_radiance_is_that_of_mitsubas_own_path_tracer(share: float | None, depth: int) -> None:
    """In each of twelve parts of the image. Paths of up to twelve segments reach Russian roulette."""
    environment = None if share is None else sky(share)
    parts = []
    variants: tuple[Literal["auto", "scalar"], ...] = ("auto", "scalar")
    for variant in variants:
        mean = rendered(variant, FRAME, environment, depth).mean(axis=0, dtype=np.float64)
        parts.append(mean.reshape(3, 24, 4, 24, 3).mean(axis=(1, 3)))
    np.testing.assert_allclose(parts[0], parts[1], rtol=0.02, atol=0.002 * parts[1].max())


LIT = np.s_[:, 60:68, 8:88]
"""Pixels of the sunlit plate, from which the ball hides only a little of the sky."""


def test_the_sun_adds_no_noise() -> None:
    """Samples from a Lambertian plate reach the sky's bright or dark half, each 0.9 off its mean, and
    this is all the noise. If Sun or sky were chosen at random, the noise would exceed the Sun's own
    light."""
    image = rendered("auto", FRAME, sky(0.5), 2, plate=MATT)[LIT]
    sun_rgb, reflected = FRAME.sun_irradiance_rgb_w_m2, np.array(MATT.base_color) / np.pi
    sun_light = reflected * sun_rgb * FRAME.sun_direction_body[2]
    sky_light = reflected * sun_rgb.mean() * 0.5
    np.testing.assert_allclose(image.mean(axis=(0, 1, 2)), sun_light + sky_light, rtol=0.05)
    assert (image.std(axis=0).mean(axis=(0, 1)) < 0.9 * sky_light / np.sqrt(SPP)).all()


def test_in_shadow_the_noise_is_that_of_eclipse() -> None:
    """The sky is sampled wherever the Sun does not shine, which reduces the noise of metal and gloss."""
    behind = scenes.frame(t_body_cam_m=(0, 0, 6), sun_direction_body=(0, 0, -1)).craft
    eclipsed = replace(FRAME, sun_irradiance_rgb_w_m2=np.zeros(3))
    shadow, eclipse = (rendered("auto", frame, sky(0.5), 2)[LIT] for frame in (behind, eclipsed))
    np.testing.assert_allclose(shadow.std(axis=0).mean(), eclipse.std(axis=0).mean(), rtol=0.02)


def test_where_the_sun_is_half_hidden_the_light_is_still_that_of_sun_and_sky() -> None:
    """In each of 108 parts of the image, most of them in the penumbra of a Sun that is 23° wide. Which
    part of it is hidden says nothing of the sky."""
    wide = replace(FRAME, sun_angular_radius_rad=0.2)
    eclipsed = replace(wide, sun_irradiance_rgb_w_m2=np.zeros(3))
    both, sun_alone, sky_alone = (
        rendered("auto", frame, environment, 2, plate=MATT)
        .mean(axis=0, dtype=np.float64)
        .reshape(9, 8, 12, 8, 3)
        .mean(axis=(1, 3))
        for frame, environment in ((wide, sky(0.5)), (wide, None), (eclipsed, sky(0.5)))
    )
    expected = sun_alone + sky_alone
    np.testing.assert_allclose(both, expected, rtol=0.03, atol=0.002 * expected.max())
