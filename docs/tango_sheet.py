"""Makes the sheet of Tango in speed.md: ``python docs/tango_sheet.py``, with posse-mitsuba.

A row for each of the scenarios tango, tango-lightbox and tango-sunlamp, from 2.6 to 4.5 m.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import posse_core
from posse_core._arrays import AnyArray

SHEET = Path(__file__).parent / "images" / "tango.jpg"
SCENARIOS = ("tango", "tango-lightbox", "tango-sunlamp")
FRAMES = 6
CHANGES = {
    "camera.scale": 0.25,
    "relative.design.range_m": [2.6, 4.5],
    "times": {"duration_s": 5000, "count": FRAMES},
    "renderer": {"name": "mitsuba", "spp": 64},
    "annotators": ["box"],
    "writers": [],
    "seed": 11,
}


def main() -> None:
    """Render and paste the sheet."""
    cv2.imwrite(str(SHEET), np.vstack([row(name) for name in SCENARIOS]), [cv2.IMWRITE_JPEG_QUALITY, 88])


def row(scenario: str) -> AnyArray:
    """(H, W) grey pictures of a scenario's frames, side by side."""
    with posse_core.open(scenario, overrides=CHANGES) as simulator:
        pictures = [simulator.frame(simulator.state(i)).image for i in range(FRAMES)]
    small = [cv2.resize(picture, (320, 200), interpolation=cv2.INTER_AREA) for picture in pictures]
    return np.asarray(np.hstack(small))


if __name__ == "__main__":
    main()
