"""The core's sensors under the conformance kit."""

from posse_core._model.mount import Mount
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


class TestRadiance(SensorConformance):
    def sensor(self):
        return REGISTRY.create("sensor", "radiance")


class TestHalfRadiance(SensorConformance):
    def sensor(self):
        keys = {"dtype": "float16", "formats": ["exr"]}
        return REGISTRY.create("sensor", "radiance", REGISTRY.options("sensor", "radiance", keys))


def lidar(**keys):
    return REGISTRY.create("sensor", "lidar", REGISTRY.options("sensor", "lidar", keys))


class TestScanner(SensorConformance):
    def sensor(self):
        pattern = {"shape": "raster", "columns": 30, "rows": 20}
        return lidar(pattern=pattern, formats=["ply", "las", "pcd"])


class TestSpiralScanner(SensorConformance):
    def sensor(self):
        pattern = {"shape": "spiral", "beams": 300, "turns": 8, "duration_s": 0.1}
        return lidar(pattern=pattern, ranging={"echo": "strongest"})


class TestFlash(SensorConformance):
    def sensor(self):
        return lidar(pattern={"shape": "flash", "width_px": 24, "height_px": 16})


class TestEventCamera(SensorConformance):
    def sensor(self):
        keys = {"formats": ["h5", "aedat4"], "bandwidth_hz": 300.0}
        return REGISTRY.create("sensor", "events", REGISTRY.options("sensor", "events", keys))


class TestStereo(SensorConformance):
    def mount(self):
        return Mount()

    def sensor(self):
        return REGISTRY.create("sensor", "stereo")
