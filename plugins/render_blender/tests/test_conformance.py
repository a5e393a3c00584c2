"""The conformance kit on Cycles."""

from __future__ import annotations

import pytest

from posse_core.testing import RendererConformance
from posse_render_blender.options import BlenderOptions
from posse_render_blender.renderer import BlenderRenderer


@pytest.mark.usefixtures("blender")
class TestBlender(RendererConformance):
    capabilities = frozenset({"path-traced", "deterministic", "environment"})

    def renderer(self) -> BlenderRenderer:
        return BlenderRenderer(BlenderOptions(threads=1))
