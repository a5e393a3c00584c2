"""A star tracker as a POSSE sensor."""

from __future__ import annotations

from collections.abc import Sequence

import posse_core as posse


@posse.hookimpl
def posse_sensors() -> Sequence[posse.ComponentSpec]:
    """The sensor ``star-tracker``. Its class is named and not imported, so listing plugins is quick."""
    return [
        posse.ComponentSpec(
            name="star-tracker",
            summary="an example of a plugin: a star tracker",
            factory="posse_star_tracker.tracker:StarTracker",
            options="posse_star_tracker.options:StarTrackerOptions",
        )
    ]
