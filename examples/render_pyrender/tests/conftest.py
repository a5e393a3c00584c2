"""Without OpenGL the tests say that they were skipped; in CI that is a failure."""

from __future__ import annotations

import os

import pytest

from posse_render_pyrender.options import PyrenderOptions
from posse_render_pyrender.renderer import PyrenderRenderer


@pytest.fixture(scope="session", autouse=True)
def _opengl() -> None:
    ((_, works, detail),) = PyrenderRenderer.doctor(PyrenderOptions())
    if not works:
        (pytest.fail if "CI" in os.environ else pytest.skip)(detail)
