"""One HTML file on which a person picks the keypoints of a spacecraft among the vertices of its mesh."""

from __future__ import annotations

from collections.abc import Sequence

from posse_core._model.spacecraft import Spacecraft
from posse_core._view.html import page_halves, read
from posse_core._view.mesh_block import mesh_block

PICKER = "keypoints.html"
"""Name of the page in a package."""
_SCRIPTS = ("numbers.js", "canvas.js", "turntable.js", "meshview.js", "picker/picker.js")
_STYLES = ("page.css", "workbench.css", "picker/picker.css")


def picker_page(craft: Spacecraft, centre_of_mass_m: Sequence[float]) -> bytes:
    """The page; it begins with the keypoints that the spacecraft has.

    Args:
        centre_of_mass_m: (3,) from the mesh file's origin, along body axes; what the page saves is
            measured from there.

    It needs nothing else, and saves a keypoint file (see ``posse_core/_spacecraft/keypoint_file.py``).
    A mesh of 100,000 triangles makes 4 MB.
    """
    blocks = {"craft": mesh_block(craft), "measured_from_m": [float(x) for x in centre_of_mass_m]}
    return b"".join(page_halves(read("picker/picker.html"), _STYLES, _SCRIPTS, blocks))
