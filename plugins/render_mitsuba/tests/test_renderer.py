"""What the conformance kit leaves to this plugin."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from posse_core import (
    BoolArray,
    ComponentError,
    EnvironmentMap,
    Float32Array,
    Material,
    PixelBox,
    RenderRequest,
)
from posse_core.testing import scenes
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.passes import MARGIN_PX, _tiles, sun_direction_body
from posse_render_mitsuba.renderer import MitsubaRenderer
from posse_render_mitsuba.wavefront import _runs

CLAY = Material("clay", base_color=(0.8, 0.5, 0.2), specular=0.0)


def test_the_plugin_imports_no_mitsuba() -> None:
    code = (
        "import sys, posse_render_mitsuba, posse_render_mitsuba.options; print('mitsuba' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "False"


@given(x0=st.integers(0, 90), y0=st.integers(0, 90), w=st.integers(1, 40), largest=st.integers(1, 99))
def test_calls_cover_the_box_once_in_order(x0: int, y0: int, w: int, largest: int) -> None:
    box = PixelBox(x0, y0, w, 7)
    calls = list(_runs(box.pixel_centres_px().reshape(-1, 2), largest))
    assert max(len(call) for call in calls) <= largest
    np.testing.assert_array_equal(np.concatenate(calls), box.pixel_centres_px().reshape(-1, 2))


@pytest.mark.parametrize("variant", ["auto", "scalar"])
@pytest.mark.parametrize("spp", [9, 40], ids=["one round", "several rounds"])
def test_a_box_of_several_parts_has_no_seam(
    monkeypatch: pytest.MonkeyPatch, variant: Literal["auto", "scalar"], spp: int
) -> None:
    """Lambert's law across the borders of calls and tiles."""
    monkeypatch.setattr("posse_render_mitsuba.wavefront.SAMPLES_PER_CALL", 9 * 3333)
    plate = scenes.rectangle("plate", "clay", u_m=(50, 0, 0), v_m=(0, 9, 0))
    camera = scenes.camera(600, 20, 1.0)
    renderer = MitsubaRenderer(MitsubaOptions(spp=spp, variant=variant))
    renderer.open(scenes.scene(plate, materials=(CLAY,), camera=camera))
    frame = scenes.frame(t_body_cam_m=(0, 0, 9), sun_direction_body=(0.2, 0.1, 1))
    box = PixelBox(5, 3, 590, 12)
    image = renderer.render(RenderRequest(frame.craft, box, None, 0))
    renderer.close()
    expected = (
        frame.craft.sun_irradiance_rgb_w_m2 * CLAY.base_color / np.pi * frame.craft.sun_direction_body[2]
    )
    assert image.coverage.min() == 1.0
    np.testing.assert_allclose(image.radiance_rgb, np.broadcast_to(expected, (12, 590, 3)), rtol=5e-3)


@given(
    arrays(bool, st.tuples(st.integers(1, 70), st.integers(1, 70))), st.integers(0, 9), st.integers(0, 9)
)
def test_tiles_hold_all_that_was_met_and_a_margin(met: BoolArray, x0: int, y0: int) -> None:
    height, width = met.shape
    drawn = np.zeros((height, width), dtype=int)
    for tile in _tiles(met, PixelBox(x0, y0, width, height)):
        part = drawn[tile.within(PixelBox(x0, y0, width, height))]
        assert part.shape == (tile.height, tile.width)
        part += 1
    assert drawn.max() <= 1
    for row, column in zip(*np.nonzero(met), strict=True):
        near = np.s_[max(row - MARGIN_PX, 0) : row + MARGIN_PX + 1]
        assert drawn[near, max(column - MARGIN_PX, 0) : column + MARGIN_PX + 1].all()


@given(st.integers(8, 200), st.floats(0, 1), st.floats(0, 1))
def test_any_number_of_passes_fills_the_sun_evenly(count: int, u: float, v: float) -> None:
    """Of an even disc of radius R the mean is the middle, and the mean of r² is R²/2.

    200 directions by chance would be off by 10 R/200 and 4 R²/200; these are by 3.4 and 2.7 at worst.
    """
    frame = scenes.frame(t_body_cam_m=(0, 0, 9), sun_direction_body=(0.3, -0.5, 1))
    shift = np.array([u, v])
    places = np.array([sun_direction_body(frame.craft, number, shift) for number in range(count)])
    along = places @ frame.craft.sun_direction_body
    off = places / along[:, None] - frame.craft.sun_direction_body
    radius = np.tan(frame.craft.sun_angular_radius_rad)
    assert np.linalg.norm(off, axis=1).max() <= radius * (1 + 1e-9)
    assert np.linalg.norm(off.mean(axis=0)) < 5 * radius / count
    assert (off**2).sum(axis=1).mean() / radius**2 == pytest.approx(0.5, abs=4 / count)


def test_threads_are_the_share_of_the_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    import drjit

    plate = scenes.scene(scenes.rectangle("p", "clay"), materials=(CLAY,), camera=scenes.camera())
    for share, option, expected in (("3", 0, 3), ("3", 2, 2), ("", 0, len(os.sched_getaffinity(0)))):
        monkeypatch.setenv("POSSE_THREADS", share)
        renderer = MitsubaRenderer(MitsubaOptions(variant="scalar", threads=option))
        renderer.open(plate)
        assert drjit.thread_count() == expected
        renderer.close()


@pytest.mark.parametrize("variant", ["scalar", "auto"])
def test_the_number_of_threads_changes_no_bit(variant: Literal["auto", "scalar"]) -> None:
    ball = scenes.sphere("ball", "clay", rings=24)
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(1, 0, 1))
    images = []
    for threads in (1, 2, 5):
        options = MitsubaOptions(variant=variant, threads=threads, spp=40)
        renderer = MitsubaRenderer(options)
        renderer.open(scenes.scene(ball, materials=(CLAY,), camera=scenes.camera()))
        images.append(renderer.render(RenderRequest(frame.craft, PixelBox(0, 0, 96, 72), None, 0)))
        renderer.close()
    for image in images[1:]:
        np.testing.assert_array_equal(image.radiance_rgb, images[0].radiance_rgb)


@pytest.mark.parametrize("spp", [1, 40])
def test_what_was_drawn_before_changes_no_bit(
    spp: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A path is traced once and then replayed for other poses, Suns, skies and sizes of box; few samples
    are often as many as an array of the scene's has entries."""
    monkeypatch.setattr("posse_render_mitsuba.wavefront.MOST_TRACES", 3)
    ball = scenes.sphere("ball", "clay", rings=24)
    scene = scenes.scene(ball, materials=(CLAY,), camera=scenes.camera())
    sky = EnvironmentMap(np.random.default_rng(0).random((16, 32, 3), dtype=np.float32))
    boxes = [
        (40, 30, 1, 1),
        (40, 30, 2, 1),
        (20, 20, 30, 26),
        (0, 0, 96, 72),
        (40, 30, 1, 1),
        (30, 25, 9, 4),
    ]
    requests = [
        RenderRequest(
            scenes.frame(t_body_cam_m=(0, 0, 4 + 0.3 * i), sun_direction_body=(1, i - 3, 1)).craft,
            PixelBox(*box),
            (None, sky)[i // 2 % 2],
            seed=i,
        )
        for i, box in enumerate(boxes)
    ]

    def drawn(*those: RenderRequest) -> list[Float32Array]:
        renderer = MitsubaRenderer(MitsubaOptions(spp=spp))
        renderer.open(scene)
        images = [renderer.render(request).radiance_rgb for request in those]
        renderer.close()
        return images

    for alone, after in zip([drawn(each)[0] for each in requests], drawn(*requests), strict=True):
        assert alone.any()
        np.testing.assert_array_equal(after, alone)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("variant", ["scalar", "auto"])
@pytest.mark.parametrize("level", [1e-44, 1e-38, 1e-21, 1e-19])
def test_an_all_but_dark_sky_is_no_fault(variant: Literal["auto", "scalar"], level: float) -> None:
    """Down to the least numbers that a float holds."""
    sky = EnvironmentMap(np.full((8, 16, 3), level, dtype=np.float32))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), sun_fraction=0)
    renderer = MitsubaRenderer(MitsubaOptions(variant=variant, spp=16))
    renderer.open(scenes.scene(scenes.sphere("ball", "clay"), materials=(CLAY,), camera=scenes.camera()))
    image = renderer.render(RenderRequest(frame.craft, PixelBox(0, 0, 96, 72), sky, 0))
    renderer.close()
    assert image.radiance_rgb.max() <= 1.5 * level
    assert image.coverage.max() == 1.0


def test_pixels_that_are_not_square_are_refused() -> None:
    plate = scenes.rectangle("plate", "clay")
    camera = replace(scenes.camera(), fy_px=100.0)
    with pytest.raises(ComponentError, match="square pixels only"):
        MitsubaRenderer(MitsubaOptions(variant="scalar")).open(
            scenes.scene(plate, materials=(CLAY,), camera=camera)
        )


def test_it_says_which_variant_and_version() -> None:
    import mitsuba

    renderer = MitsubaRenderer(MitsubaOptions(variant="scalar"))
    renderer.open(scenes.scene(scenes.rectangle("p", "clay"), materials=(CLAY,), camera=scenes.camera()))
    assert renderer.describe() == {"mitsuba": mitsuba.__version__, "variant": "scalar_rgb"}
    renderer.close()
