"""Options of the right eye of a stereo pair."""

from __future__ import annotations

from pydantic import Field

from posse_core._plugins.options import Options


class StereoOptions(Options):
    """The right eye of a rectified pair, whose left eye is the chaser's camera."""

    baseline_m: float = Field(
        0.3, gt=0, description="distance of the right eye from the chaser's camera, along its +x, m"
    )
