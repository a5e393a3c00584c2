"""One HTML file that shows a dataset: no server, no network, nothing beside it but the images."""

from __future__ import annotations

from pathlib import Path

from posse_core._arrays import evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._view.document import VIEWER_SCRIPTS, Document, Page, Progress

_SCRIPTS = (*VIEWER_SCRIPTS, "player.js", "plots.js", "orbit.js", "main.js")


def write_page(
    dataset: Dataset, out: Path, *, frames: int | None, max_bytes: int, progress: Progress
) -> Page:
    """Write the page to ``out``, never larger than ``max_bytes``.

    Every frame's labels are in it. Previews are too, for all frames or, where they would not fit, for
    evenly spread ones; the page shows the dataset's own images where it finds them.

    Args:
        frames: show only so many, evenly spread; all if None.

    Raises:
        InputError: the labels alone are larger than that, or a file of the dataset cannot be read.
    """
    if not len(dataset):
        raise InputError(f"{dataset.folder}: has no frames to show")
    positions = evenly_spread(len(dataset), len(dataset) if frames is None else frames).tolist()
    document = Document(
        dataset, positions, "dataset.html", ("page.css",), _SCRIPTS, {}, lambda index: {}
    )
    way_out = "show fewer by --frames, or raise --max-mib"
    return document.write(out, max_bytes=max_bytes, way_out=way_out, progress=progress)
