"""The conformance kit on the star tracker."""

from __future__ import annotations

from posse_core.testing import SensorConformance
from posse_star_tracker.options import StarTrackerOptions
from posse_star_tracker.tracker import StarTracker


class TestStarTracker(SensorConformance):
    def sensor(self) -> StarTracker:
        # The kit's Sun is 27° from the axis, and its spacecraft hides some of the faint stars.
        return StarTracker(StarTrackerOptions(sun_exclusion_deg=20, max_magnitude=7))
