"""A rasteriser as a POSSE renderer."""

from __future__ import annotations

from collections.abc import Sequence

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers() -> Sequence[ComponentSpec]:
    """The renderer ``raster``."""
    return [
        ComponentSpec(
            name="raster",
            summary="real-time OpenGL, no display needed: linear float radiance, hard shadows",
            factory="posse_render_raster.renderer:RasterRenderer",
            options="posse_render_raster.options:RasterOptions",
            capabilities=frozenset({"deterministic", "environment", "depth", "gpu"}),
        )
    ]
