"""A camera beside the chaser's, with images and labels of its own."""

from __future__ import annotations

from posse_core._imaging.image_sensor import ImageSensor
from posse_core._interfaces.look import SensorLook
from posse_core._interfaces.sensor import Sensor, SensorSetting
from posse_core._model.reading import Reading
from posse_core._sensors.camera.options import CameraOptions


class CameraSensor(Sensor[CameraOptions]):
    """Takes images through a lens of its own, labelled by the scenario's annotators."""

    def open(self, setting: SensorSetting) -> None:
        config, keys = self.options.sensor or setting.image_sensor, self.options.camera
        self.camera = setting.camera if keys is None else keys.camera()
        self._setting = setting
        self._image_sensor = ImageSensor(config, self.camera, setting.name)

    def sense(self, look: SensorLook) -> Reading:
        photograph = self._image_sensor.photograph(
            lambda exposure_s, instants: look.light(exposure_s=exposure_s, instants=instants),
            self._setting.seed,
            look.index,
            look.number,
        )
        made = self._setting.annotate(look)
        labels = {"exposure_s": photograph.exposure_s, **made.values}
        return Reading(labels, made.arrays, photograph.image)
