"""What the conformance kit does not ask: several renderers, sheets, a machine without OpenGL."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np

import posse_core as posse
from posse_core.testing import scenes
from posse_render_pyrender.options import PyrenderOptions
from posse_render_pyrender.renderer import PyrenderRenderer

WHITE = posse.Material("white", specular=0.0)
BOX = posse.PixelBox(0, 0, 48, 36)


def wall_and_plate(v_m: float) -> posse.Scene:
    """A small plate before a wall; its front faces away from the camera if ``v_m`` is negative."""
    wall = scenes.rectangle("wall", "white", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))
    plate = scenes.rectangle("plate", "white", centre_m=(0, 0, 0.5), u_m=(0.3, 0, 0), v_m=(0, v_m, 0))
    return scenes.scene(wall, plate, materials=(WHITE,), camera=scenes.camera(48, 36))


def image(renderer: PyrenderRenderer) -> posse.Float32Array:
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(1, 0.5, 1))
    return renderer.render(posse.RenderRequest(frame.craft, BOX, None, seed=1)).radiance_rgb


def opened(scene: posse.Scene) -> PyrenderRenderer:
    renderer = PyrenderRenderer(PyrenderOptions())
    renderer.open(scene)
    return renderer


def test_a_sheet_casts_a_shadow_whichever_side_is_lit() -> None:
    front, back = opened(wall_and_plate(0.3)), opened(wall_and_plate(-0.3))
    shaded = image(front)
    assert np.count_nonzero(shaded.sum(axis=-1) == 0) > 20
    np.testing.assert_allclose(image(back), shaded, atol=1e-3 * shaded.max())
    front.close()
    back.close()


def test_a_renderer_that_is_closed_leaves_others_alone() -> None:
    one, other = opened(wall_and_plate(0.3)), opened(wall_and_plate(0.1))
    before = image(one)
    image(other)
    other.close()
    np.testing.assert_array_equal(image(one), before)
    one.close()


def test_a_frame_of_a_scenario() -> None:
    """By its name, as installed: the image covers what geometry says, sunlit."""
    small = {"camera.width_px": 160, "camera.height_px": 120, "sky.earth": False}
    with posse.open("aqua", renderer="pyrender", overrides=small) as sim:
        frame = sim.frame(sim.state(0))
    truth = frame.arrays["part_id"] >= 0
    covered = frame.coverage > 0.5
    assert truth.sum() > 100
    assert (truth & covered).sum() > 0.97 * (truth | covered).sum()
    assert frame.craft_radiance_rgb[truth].mean() > 1


def test_a_machine_without_opengl_is_told_what_to_install() -> None:
    code = """
from posse_render_pyrender.options import PyrenderOptions
from posse_render_pyrender.renderer import PyrenderRenderer
print(*PyrenderRenderer.doctor(PyrenderOptions()))
"""
    nowhere = {"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent", "LIBGL_DRIVERS_PATH": "/nonexistent"}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **nowhere}, capture_output=True, text=True
    )
    assert "False" in done.stdout, done.stderr
    assert "apt-get install libegl1 libgl1 libgl1-mesa-dri" in done.stdout
