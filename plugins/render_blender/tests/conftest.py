"""Fixtures that open the renderer with a real Blender."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator

import pytest

from posse_core import Scene
from posse_render_blender.options import BlenderOptions
from posse_render_blender.renderer import BlenderRenderer


def _missing() -> str | None:
    if os.environ.get("POSSE_BLENDER_PYTHON") or os.environ.get("POSSE_BLENDER"):
        return None
    if importlib.util.find_spec("bpy") is not None:
        return None
    return "no Blender: set POSSE_BLENDER_PYTHON to a Python that has bpy, or POSSE_BLENDER"


@pytest.fixture(scope="session")
def blender() -> None:
    """Requested by tests that need Blender; skips them, or fails with POSSE_REQUIRE_BLENDER=1, if there
    is none."""
    reason = _missing()
    if reason is None:
        return
    if os.environ.get("POSSE_REQUIRE_BLENDER") == "1":
        pytest.fail(f"{reason} (POSSE_REQUIRE_BLENDER=1)")
    pytest.skip(reason)


@pytest.fixture
def opened(blender: None) -> Iterator[Callable[..., BlenderRenderer]]:
    """Returns a function that opens a renderer on a scene with options; it is closed after the test."""
    renderers: list[BlenderRenderer] = []

    def open_renderer(scene: Scene, **options: object) -> BlenderRenderer:
        values = {"spp": 16, "threads": 1, **options}
        renderer = BlenderRenderer(BlenderOptions.model_validate(values))
        renderers.append(renderer)
        renderer.open(scene)
        return renderer

    yield open_renderer
    for renderer in renderers:
        renderer.close()
