"""The right eye of a stereo pair, with images, labels and the disparity of both eyes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from posse_core._errors import ComponentError, InputError
from posse_core._interfaces.look import SensorLook
from posse_core._interfaces.sensor import Sensor, SensorSetting, StoredReading
from posse_core._model.mount import Mount
from posse_core._model.reading import Reading
from posse_core._sensors.camera.camera import LabelledCamera
from posse_core._sensors.stereo.disparity import eye_labels
from posse_core._sensors.stereo.faults import pair_faults
from posse_core._sensors.stereo.options import StereoOptions


class StereoSensor(Sensor[StereoOptions]):
    """A camera like the chaser's, ``baseline_m`` along its +x, with the same axes.

    The two are a rectified pair, so the lens must be a pinhole. Noise is of its own.
    """

    def open(self, setting: SensorSetting) -> None:
        if not setting.mount.is_none:
            raise InputError("baseline_m says where a stereo eye is; leave out mount")
        if setting.scene.camera.distortion is not None:
            raise InputError(
                "disparity is that of rectified images, and the chaser's camera has a distorting lens;"
                " leave out camera.distortion, or use type: camera with a mount"
            )
        self.camera = setting.scene.camera
        self.mount = Mount(np.array([self.options.baseline_m, 0.0, 0.0]))
        self._labelled = LabelledCamera(setting, setting.scene.camera, setting.image_sensor)

    def sense(self, look: SensorLook) -> Reading:
        reading, camera, baseline_m = (
            self._labelled.take(look),
            look.scene.camera,
            self.options.baseline_m,
        )
        right = eye_labels(look, camera, -baseline_m)
        left = eye_labels(look.from_camera, camera, baseline_m)
        arrays = {
            "disparity_right_px": right.disparity_px,
            "visibility_in_left": right.visibility,
            "disparity_left_px": left.disparity_px,
            "visibility_in_right": left.visibility,
        }
        taken = reading.arrays.keys() & arrays.keys()
        if taken:
            raise ComponentError(
                f"an annotator makes the array {min(taken)!r} of stereo's; leave it out"
            )
        return replace(reading, arrays={**reading.arrays, **arrays})

    def faults(self, stored: StoredReading) -> Iterator[str]:
        yield from pair_faults(stored, self.options.baseline_m)
