"""Options of the core's propagators; cheap to import."""

from __future__ import annotations

from pydantic import Field

from posse_core.options import Options


class ThesisOptions(Options):
    """Options of the propagator ``thesis``."""

    relative_orbits: int = Field(
        25, ge=1, description="H of Algorithm 3.1: relative orbits, each over all the times"
    )
