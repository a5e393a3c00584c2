"""Fixtures that open the renderer with a real OpenGL driver."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

import pytest

from posse_core import ComponentError, Scene
from posse_render_raster.context import create_context
from posse_render_raster.options import RasterOptions
from posse_render_raster.renderer import RasterRenderer


@pytest.fixture(scope="session")
def opengl() -> None:
    """Requested by tests that need OpenGL; skips them, or fails with POSSE_REQUIRE_RASTER=1, if there is
    none."""
    try:
        create_context().release()
    except ComponentError as error:
        if os.environ.get("POSSE_REQUIRE_RASTER") == "1":
            pytest.fail(f"{error} (POSSE_REQUIRE_RASTER=1)")
        pytest.skip(str(error))


@pytest.fixture
def opened(opengl: None) -> Iterator[Callable[..., RasterRenderer]]:
    """Returns a function that opens a renderer on a scene with options; it is closed after the test."""
    renderers: list[RasterRenderer] = []

    def open_renderer(scene: Scene, **options: object) -> RasterRenderer:
        renderer = RasterRenderer(RasterOptions.model_validate(options))
        renderers.append(renderer)
        renderer.open(scene)
        return renderer

    yield open_renderer
    for renderer in renderers:
        renderer.close()
