"""A camera beside the chaser's, with images and labels of its own."""

from __future__ import annotations

from posse_core._imaging.image_sensor import ImageSensor
from posse_core._interfaces.look import SensorLook
from posse_core._interfaces.sensor import Sensor, SensorSetting
from posse_core._model.camera import Camera
from posse_core._model.reading import Reading
from posse_core._scenario.sensor import SensorConfig
from posse_core._sensors.camera.options import CameraOptions


class LabelledCamera:
    """Takes images through a lens, labelled by the scenario's annotators."""

    def __init__(self, setting: SensorSetting, camera: Camera, config: SensorConfig) -> None:
        """config: of the image sensor behind the lens."""
        self._setting = setting
        self._image_sensor = ImageSensor(config, camera, setting.name)

    def take(self, look: SensorLook) -> Reading:
        """The image and its labels at a look's instant."""
        photograph = self._image_sensor.photograph(
            lambda exposure_s, instants: look.light(exposure_s=exposure_s, instants=instants),
            self._setting.seed,
            look.index,
            look.number,
        )
        made = self._setting.annotate(look)
        labels = {"exposure_s": photograph.exposure_s, **made.values}
        return Reading(labels, made.arrays, photograph.image)


class CameraSensor(Sensor[CameraOptions]):
    """A camera with a lens and an image sensor of its own, or with those of the chaser's."""

    def open(self, setting: SensorSetting) -> None:
        config, keys = self.options.sensor or setting.image_sensor, self.options.camera
        self.camera = setting.scene.camera if keys is None else keys.camera()
        self._labelled = LabelledCamera(setting, self.camera, config)

    def sense(self, look: SensorLook) -> Reading:
        return self._labelled.take(look)
