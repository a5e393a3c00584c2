"""The radiance in every pixel of the chaser's camera."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posse_core._interfaces.look import SensorLook
from posse_core._interfaces.sensor import Sensor, SensorSetting, StoredReading
from posse_core._model.reading import Reading
from posse_core._sensors.radiance.exr import exr, library
from posse_core._sensors.radiance.options import RadianceOptions

ARRAY = "radiance_rgb"


class RadianceSensor(Sensor[RadianceOptions]):
    """Records the light that the image is made of: (H, W, 3) W m⁻² sr⁻¹ in the red, green and blue band.

    Each pixel has the mean of the spacecraft and of the sky beside it, without stars, which are points.
    At the camera's place and at a frame's instant it is the light of the frame's image itself, rendered
    once and averaged over its exposure; elsewhere, and between frames, it is that of one instant.
    """

    def open(self, setting: SensorSetting) -> None:
        self.camera = setting.scene.camera
        if self.options.formats:
            library()

    def sense(self, look: SensorLook) -> Reading:
        light = look.image_light
        if light is None:
            light = look.light()
        dtype = np.dtype(self.options.dtype)
        most = np.float32(np.finfo(dtype).max)
        radiance = np.minimum(light.radiance_rgb(), most).astype(dtype)
        files = {".exr": exr(radiance)} if self.options.formats else {}
        return Reading(arrays={ARRAY: radiance}, files=files)

    def faults(self, stored: StoredReading) -> Iterator[str]:
        if [*stored.reading.arrays] != [ARRAY]:
            yield f"the arrays are {sorted(stored.reading.arrays)}, not {ARRAY} alone"
            return
        radiance, camera = stored.reading.arrays[ARRAY], stored.camera
        if camera is not None and radiance.shape != (camera.height_px, camera.width_px, 3):
            yield f"{ARRAY} is {radiance.shape}, not of the camera's size with three bands"
        if radiance.dtype != np.dtype(self.options.dtype):
            yield f"{ARRAY} is {radiance.dtype}, not {self.options.dtype}"
        elif not (np.isfinite(radiance) & (radiance >= 0)).all():
            yield f"{ARRAY} is negative or not finite somewhere"
