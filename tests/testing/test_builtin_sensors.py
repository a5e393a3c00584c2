"""The core's sensors under the conformance kit."""

from posse_core._plugins.loading import Plugins
from posse_core.testing import SensorConformance

REGISTRY = Plugins([]).registry


class TestCamera(SensorConformance):
    def sensor(self):
        return REGISTRY.create("sensor", "camera")


class TestWideCamera(SensorConformance):
    def sensor(self):
        keys = {"camera": {"width_px": 64, "height_px": 48, "hfov_deg": 80}, "sensor": {"color": "rgb"}}
        return REGISTRY.create("sensor", "camera", REGISTRY.options("sensor", "camera", keys))
