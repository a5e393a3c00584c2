"""Options of the core's scene sources. Cheap to import."""

from __future__ import annotations

from pydantic import Field

from posse_core.options import Options


class AquaOptions(Options):
    """Aqua-like: a bus with one long solar wing."""

    panel_angle_deg: float = Field(
        0.0, ge=-180.0, le=180.0, description="Turn of the solar wing about its axis, body Y."
    )


class ClusterOptions(Options):
    """Cluster-like: a spinning drum with booms."""
