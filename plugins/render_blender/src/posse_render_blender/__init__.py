"""Blender's Cycles as a POSSE renderer."""

from __future__ import annotations

from collections.abc import Sequence

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers() -> Sequence[ComponentSpec]:
    """The renderer ``blender``."""
    return [
        ComponentSpec(
            name="blender",
            summary="path tracing with Blender's Cycles, in a child process with its own interpreter",
            factory="posse_render_blender.renderer:BlenderRenderer",
            options="posse_render_blender.options:BlenderOptions",
            capabilities=frozenset({"path-traced", "deterministic", "environment", "depth", "gpu"}),
        )
    ]
