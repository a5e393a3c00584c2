"""The conformance kit on pyrender."""

from __future__ import annotations

from posse_core.testing import RendererConformance
from posse_render_pyrender import posse_renderers
from posse_render_pyrender.options import PyrenderOptions
from posse_render_pyrender.renderer import PyrenderRenderer

(RECORD,) = posse_renderers()


class TestPyrender(RendererConformance):
    capabilities = RECORD.capabilities
    radiance_tolerance = 0.03
    edge_tolerance_px = 0.5
    glossy_sky_tolerance = 0.1  # the split sum has lobes as round as that of a view along the normal

    def renderer(self) -> PyrenderRenderer:
        return PyrenderRenderer(PyrenderOptions())
