"""pyrender as a POSSE renderer."""

from __future__ import annotations

from collections.abc import Sequence

import posse_core as posse


@posse.hookimpl
def posse_renderers() -> Sequence[posse.ComponentSpec]:
    """The renderer ``pyrender``. Its class is named and not imported, so listing plugins is quick."""
    return [
        posse.ComponentSpec(
            name="pyrender",
            summary="an example of a plugin: pyrender with linear float radiance, without a display",
            factory="posse_render_pyrender.renderer:PyrenderRenderer",
            options="posse_render_pyrender.options:PyrenderOptions",
            capabilities=frozenset({"deterministic", "environment", "depth", "gpu"}),
        )
    ]
