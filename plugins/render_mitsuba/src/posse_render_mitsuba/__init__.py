"""Mitsuba 3 as a renderer of POSSE. Importing this module does not import Mitsuba."""

from __future__ import annotations

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "mitsuba",
            "path tracing with Mitsuba 3, compiled by LLVM or CUDA, or in plain C++",
            "posse_render_mitsuba.renderer:MitsubaRenderer",
            "posse_render_mitsuba.options:MitsubaOptions",
            capabilities=frozenset({"path-traced", "deterministic", "environment"}),
        )
    ]
