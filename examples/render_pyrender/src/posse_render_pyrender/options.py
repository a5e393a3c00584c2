"""Options of the renderer ``pyrender``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

import posse_core as posse


class PyrenderOptions(posse.Options):
    """How finely pixels are sampled."""

    samples_per_axis: Literal[1, 3, 5, 7] = Field(
        3, description="samples per pixel in each direction; odd, so that one is at the centre"
    )
