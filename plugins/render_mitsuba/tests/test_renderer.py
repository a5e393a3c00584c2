"""Behaviour of the renderer that the conformance kit does not cover."""

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
from posse_render_mitsuba.wavefront import _chunks

CLAY = Material("clay", base_color=(0.8, 0.5, 0.2), specular=0.0)


def test_importing_the_plugin_does_not_import_mitsuba() -> None:
    code = (
        "import sys, posse_render_mitsuba, posse_render_mitsuba.options; print('mitsuba' in sys.modules)"
    )
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert child.stdout.strip() == "False"


@given(x0=st.integers(0, 90), y0=st.integers(0, 90), w=st.integers(1, 40), size=st.integers(1, 99))
def test_chunks_cover_the_box_once_in_order(x0: int, y0: int, w: int, size: int) -> None:
    box = PixelBox(x0, y0, w, 7)
    chunks = list(_chunks(box.pixel_centres_px().reshape(-1, 2), size))
    assert max(len(chunk) for chunk in chunks) <= size
    np.testing.assert_array_equal(np.concatenate(chunks), box.pixel_centres_px().reshape(-1, 2))


@pytest.mark.parametrize("variant", ["auto", "scalar"])
@pytest.mark.parametrize("spp", [16, 40], ids=["one round", "several rounds"])
def test_a_box_of_several_parts_has_no_seam(
    monkeypatch: pytest.MonkeyPatch, variant: Literal["auto", "scalar"], spp: int
) -> None:
    """Lambert's law holds across the borders of kernel calls and tiles."""
    monkeypatch.setattr("posse_render_mitsuba.wavefront.SAMPLES_PER_CALL", 16 * 1875)
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
def test_tiles_contain_every_hit_pixel_and_a_margin(hit: BoolArray, x0: int, y0: int) -> None:
    height, width = hit.shape
    drawn = np.zeros((height, width), dtype=int)
    for tile in _tiles(hit, PixelBox(x0, y0, width, height)):
        part = drawn[tile.within(PixelBox(x0, y0, width, height))]
        assert part.shape == (tile.height, tile.width)
        part += 1
    assert drawn.max() <= 1
    for row, column in zip(*np.nonzero(hit), strict=True):
        near = np.s_[max(row - MARGIN_PX, 0) : row + MARGIN_PX + 1]
        assert drawn[near, max(column - MARGIN_PX, 0) : column + MARGIN_PX + 1].all()


@given(st.integers(8, 200), st.floats(0, 1), st.floats(0, 1))
def test_any_number_of_passes_fills_the_suns_disc_evenly(count: int, u: float, v: float) -> None:
    """Points that fill a disc of radius R evenly have their mean at the centre, and R²/2 as mean of r².

    200 random points would be off by 10 R/200 and 4 R²/200; these are off by at most 3.4 R/200 and
    2.7 R²/200.
    """
    frame = scenes.frame(t_body_cam_m=(0, 0, 9), sun_direction_body=(0.3, -0.5, 1))
    shift = np.array([u, v])
    directions = np.array([sun_direction_body(frame.craft, index, shift) for index in range(count)])
    along = directions @ frame.craft.sun_direction_body
    off = directions / along[:, None] - frame.craft.sun_direction_body
    radius = np.tan(frame.craft.sun_angular_radius_rad)
    assert np.linalg.norm(off, axis=1).max() <= radius * (1 + 1e-9)
    assert np.linalg.norm(off.mean(axis=0)) < 5 * radius / count
    assert (off**2).sum(axis=1).mean() / radius**2 == pytest.approx(0.5, abs=4 / count)


def test_threads_are_the_option_or_the_workers_share(monkeypatch: pytest.MonkeyPatch) -> None:
    import drjit

    plate = scenes.scene(scenes.rectangle("p", "clay"), materials=(CLAY,), camera=scenes.camera())
    for share, option, expected in (("3", 0, 3), ("3", 2, 2), ("", 0, len(os.sched_getaffinity(0)))):
        monkeypatch.setenv("POSSE_THREADS", share)
        renderer = MitsubaRenderer(MitsubaOptions(variant="scalar", threads=option))
        renderer.open(plate)
        assert drjit.thread_count() == expected
        renderer.close()


@pytest.mark.parametrize("variant", ["scalar", "auto"])
def test_the_number_of_threads_does_not_change_the_image(variant: Literal["auto", "scalar"]) -> None:
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
def test_earlier_frames_do_not_change_the_image(
    spp: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel is traced once and then replayed for other poses, Suns, skies and box sizes. With few
    samples, their number often equals the length of one of the scene's arrays, which needs a new
    trace."""
    monkeypatch.setattr("posse_render_mitsuba.wavefront.MAX_KERNELS", 3)
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

    def rendered(*those: RenderRequest) -> list[Float32Array]:
        renderer = MitsubaRenderer(MitsubaOptions(spp=spp))
        renderer.open(scene)
        images = [renderer.render(request).radiance_rgb for request in those]
        renderer.close()
        return images

    alone_images = [rendered(request)[0] for request in requests]
    for alone, after in zip(alone_images, rendered(*requests), strict=True):
        assert alone.any()
        np.testing.assert_array_equal(after, alone)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("variant", ["scalar", "auto"])
@pytest.mark.parametrize("level", [1e-44, 1e-38, 1e-21, 1e-19])
def test_an_almost_dark_sky_is_rendered(variant: Literal["auto", "scalar"], level: float) -> None:
    """Down to the smallest numbers of single precision."""
    sky = EnvironmentMap(np.full((8, 16, 3), level, dtype=np.float32))
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1), sun_fraction=0)
    renderer = MitsubaRenderer(MitsubaOptions(variant=variant, spp=16))
    renderer.open(scenes.scene(scenes.sphere("ball", "clay"), materials=(CLAY,), camera=scenes.camera()))
    image = renderer.render(RenderRequest(frame.craft, PixelBox(0, 0, 96, 72), sky, 0))
    renderer.close()
    assert image.radiance_rgb.max() <= 1.5 * level
    assert image.coverage.max() == 1.0


def test_a_camera_without_square_pixels_is_refused() -> None:
    plate = scenes.rectangle("plate", "clay")
    camera = replace(scenes.camera(), fy_px=100.0)
    with pytest.raises(ComponentError, match="square pixels only"):
        MitsubaRenderer(MitsubaOptions(variant="scalar")).open(
            scenes.scene(plate, materials=(CLAY,), camera=camera)
        )


def test_describe_reports_variant_and_version() -> None:
    import mitsuba

    renderer = MitsubaRenderer(MitsubaOptions(variant="scalar"))
    renderer.open(scenes.scene(scenes.rectangle("p", "clay"), materials=(CLAY,), camera=scenes.camera()))
    assert renderer.describe() == {"mitsuba": mitsuba.__version__, "variant": "scalar_rgb"}
    renderer.close()
