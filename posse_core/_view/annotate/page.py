"""One HTML file on which a person clicks the keypoints of a spacecraft on photographs."""

from __future__ import annotations

from collections.abc import Sequence

from posse_core._model.camera import Camera
from posse_core._model.spacecraft import Spacecraft
from posse_core._view.html import page_halves, read
from posse_core._view.mesh_block import mesh_block

ANNOTATE = "annotate.html"
"""Name of the page, in the photographs' folder."""
_SCRIPTS = ("numbers.js", "canvas.js", "turntable.js", "meshview.js", "annotate/annotate.js")
_STYLES = ("page.css", "workbench.css", "annotate/annotate.css")


def annotate_page(craft: Spacecraft, camera: Camera, photos: Sequence[str], command: str) -> bytes:
    """The page, which shows the photographs that are beside it.

    It saves a file of points (see ``posse_core/_photos/points.py``).

    Args:
        craft: whose keypoints are clicked.
        camera: of the photographs.
        photos: their names.
        command: that computes poses from the file.
    """
    task = {
        "photos": list(photos),
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "command": command,
    }
    blocks = {"craft": mesh_block(craft), "task": task}
    return b"".join(page_halves(read("annotate/annotate.html"), _STYLES, _SCRIPTS, blocks))
