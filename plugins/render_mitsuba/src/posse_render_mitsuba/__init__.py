"""Mitsuba 3 as a renderer of POSSE. Importing this module imports no Mitsuba."""

from __future__ import annotations

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "mitsuba",
            "Mitsuba 3: path tracing by LLVM, CUDA, or plain C++ that needs neither",
            "posse_render_mitsuba.renderer:MitsubaRenderer",
            "posse_render_mitsuba.options:MitsubaOptions",
            capabilities=frozenset({"path-traced", "deterministic", "environment"}),
        )
    ]
