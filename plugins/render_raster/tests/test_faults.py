"""Without OpenGL the message says what to install; several renderers work at the same time."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest

from posse_core import ComponentError, Material, PixelBox, RenderRequest, Scene
from posse_core.testing import scenes
from posse_render_raster.options import RasterOptions
from posse_render_raster.renderer import RasterRenderer

BOX = PixelBox(0, 0, 32, 24)
REQUEST = RenderRequest(
    scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1)).craft, BOX, None, seed=1
)
DOCTOR = """
from posse_core import ComponentError
from posse_render_raster.options import RasterOptions
from posse_render_raster.renderer import RasterRenderer
import test_faults
(what, ok, detail), = RasterRenderer.doctor(RasterOptions())
try:
    RasterRenderer(RasterOptions()).open(test_faults.plate(1.0))
except ComponentError as error:
    assert (what, ok, detail) == ("opengl", False, str(error))
    print(error)
"""


def plate(level: float) -> Scene:
    camera = scenes.camera(32, 24)
    paint = Material("paint", base_color=(level, level, level), specular=0.0)
    return scenes.scene(scenes.rectangle("plate", "paint"), materials=(paint,), camera=camera)


def message_of(code: str, **environ: str) -> str:
    """What a new process prints; a new one is needed because drivers are looked for once per process."""
    folder = __file__.rsplit("/", 1)[0]
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {folder!r})\n{code}"],
        env={**os.environ, **environ},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def test_egl_without_a_driver() -> None:
    message = message_of(
        DOCTOR, __EGL_VENDOR_LIBRARY_DIRS="/nonexistent", LIBGL_DRIVERS_PATH="/nonexistent"
    )
    assert message.startswith("raster: no OpenGL 3.3 through EGL: ")
    assert "apt-get install libegl1 libgl1 libgl1-mesa-dri" in message
    assert message.count("\n") == 1


def test_no_libegl() -> None:
    message = message_of(DOCTOR, GLCONTEXT_LINUX_LIBEGL="libEGL-nowhere.so")
    assert message.startswith("raster: no OpenGL 3.3 through EGL: ")
    assert "apt-get install" in message


def test_doctor_reports_what_works(opengl: None) -> None:
    ((what, ok, detail),) = RasterRenderer.doctor(RasterOptions())
    assert (what, ok) == ("opengl", True)
    assert detail.startswith("OpenGL ")


def test_two_renderers_at_once_and_one_closed(opened: Callable[..., RasterRenderer]) -> None:
    bright, dark = opened(plate(0.8)), opened(plate(0.2))
    first, second = bright.render(REQUEST), dark.render(REQUEST)
    np.testing.assert_allclose(first.radiance_rgb, 4 * second.radiance_rgb, rtol=1e-4)
    bright.close()
    np.testing.assert_array_equal(dark.render(REQUEST).radiance_rgb, second.radiance_rgb)


def test_a_renderer_closed_twice_can_be_opened_again(opened: Callable[..., RasterRenderer]) -> None:
    renderer = opened(plate(0.5))
    first = renderer.render(REQUEST)
    renderer.close()
    renderer.close()
    with pytest.raises(ComponentError, match="not open"):
        renderer.render(REQUEST)
    renderer.open(plate(0.5))
    np.testing.assert_array_equal(renderer.render(REQUEST).radiance_rgb, first.radiance_rgb)
    assert "device" in renderer.describe()
