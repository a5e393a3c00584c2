"""The conformance kit on the rasteriser."""

from __future__ import annotations

import pytest

from posse_core.testing import RendererConformance
from posse_render_raster.options import RasterOptions
from posse_render_raster.renderer import RasterRenderer


@pytest.mark.usefixtures("opengl")
class TestRaster(RendererConformance):
    capabilities = frozenset({"deterministic", "environment"})
    radiance_tolerance = 0.03
    edge_tolerance_px = 0.5
    glossy_sky_tolerance = 0.1  # the split sum has lobes as round as that of a view along the normal

    def renderer(self) -> RasterRenderer:
        return RasterRenderer(RasterOptions())
