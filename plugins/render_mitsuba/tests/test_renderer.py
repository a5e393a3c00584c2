"""What the conformance kit leaves to this plugin."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core.errors import ComponentError
from posse_core.model.camera import PixelBox
from posse_core.model.scene import RenderRequest
from posse_core.model.spacecraft import Material
from posse_core.testing import scenes
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.renderer import FILM_SIZES_PX, MitsubaRenderer, _tiles

CLAY = Material("clay", base_color=(0.8, 0.5, 0.2), specular=0.0)


def test_the_plugin_imports_no_mitsuba() -> None:
    code = (
        "import sys, posse_render_mitsuba, posse_render_mitsuba.options; print('mitsuba' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "False"


@given(x0=st.integers(0, 900), y0=st.integers(0, 900), w=st.integers(1, 1300), h=st.integers(1, 1300))
def test_tiles_cover_the_box_once(x0: int, y0: int, w: int, h: int) -> None:
    box = PixelBox(x0, y0, w, h)
    tiles = list(_tiles(box, exact=False))
    count = np.zeros((y0 + h + 448, x0 + w + 448), dtype=int)
    for tile in tiles:
        assert tile.width == tile.height == tiles[0].width in FILM_SIZES_PX
        count[tile.slices] += 1
    assert (count[box.slices] == 1).all()
    assert list(_tiles(box, exact=True)) == [box]


def test_a_box_larger_than_a_film_has_no_seam() -> None:
    """Lambert's law across the border of two films."""
    plate = scenes.rectangle("plate", "clay", u_m=(50, 0, 0), v_m=(0, 9, 0))
    camera = scenes.camera(600, 20, 1.0)
    renderer = MitsubaRenderer(MitsubaOptions(spp=8))
    renderer.open(scenes.scene(plate, materials=(CLAY,), camera=camera))
    frame = scenes.frame(t_body_cam_m=(0, 0, 9), sun_direction_body=(0.2, 0.1, 1))
    box = PixelBox(5, 3, 590, 12)
    image = renderer.render(RenderRequest(frame, box, None, 0))
    renderer.close()
    expected = frame.sun_irradiance_rgb_w_m2 * CLAY.base_color / np.pi * frame.sun_direction_body[2]
    assert image.coverage.min() == 1.0
    np.testing.assert_allclose(image.radiance_rgb, np.broadcast_to(expected, (12, 590, 3)), rtol=5e-3)


@pytest.mark.parametrize("variant", ["scalar", "auto"])
def test_the_number_of_threads_changes_no_bit(variant: str) -> None:
    ball = scenes.sphere("ball", "clay", rings=24)
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(1, 0, 1))
    images = []
    for threads in (1, 2, 3):
        options = MitsubaOptions(variant=variant, threads=threads, spp=8)  # type: ignore[arg-type]
        renderer = MitsubaRenderer(options)
        renderer.open(scenes.scene(ball, materials=(CLAY,), camera=scenes.camera()))
        images.append(renderer.render(RenderRequest(frame, PixelBox(0, 0, 96, 72), None, 0)))
        renderer.close()
    for image in images[1:]:
        np.testing.assert_array_equal(image.radiance_rgb, images[0].radiance_rgb)


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
