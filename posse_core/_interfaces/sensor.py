"""Interface of sensors, which take readings beside the chaser's camera."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from numpy.typing import ArrayLike

from posse_core._arrays import FloatArray
from posse_core._interfaces.look import Look, SensorLook
from posse_core._model.camera import Camera
from posse_core._model.label_line import ReadingLabels
from posse_core._model.labels import Labels
from posse_core._model.mount import Mount
from posse_core._model.reading import Reading
from posse_core._model.scene import Scene
from posse_core._plugins.component import Component, OptionsT
from posse_core._scenario.sensor import SensorConfig


@dataclass(frozen=True)
class SensorSetting:
    """What is the same for all readings of a sensor.

    Attributes:
        name: of the sensor in the scenario.
        seed: of the run; a fixed pattern is drawn by ``random_generator(seed, -1, purpose)`` with the
            sensor's name in the purpose.
        scene: the bodies, and the chaser's camera.
        image_sensor: keys of the chaser's image sensor.
        mount: where the scenario says that the sensor is.
        annotate: labels of a look by the scenario's annotators, with arrays of the size of the whole
            image of the look's camera.
    """

    name: str
    seed: int
    scene: Scene
    image_sensor: SensorConfig
    mount: Mount
    annotate: Callable[[Look], Labels]


@dataclass(frozen=True)
class StoredReading:
    """A reading as a dataset holds it, beside what it can be compared with.

    Attributes:
        index: of the frame.
        labels: the reading's labels, with pose and rates at its instant.
        reading: labels of the sensor's own, arrays and image; ``files`` is empty.
        camera: that its pixels are of, or None.
        mount: where the sensor is.
        parts: names of the parts of all bodies, in the order of their ids.
        distances_m: where rays first meet a body by the labelled poses, joints and rates, computed by
            other code than :meth:`posse_core.Look.rays`: (directions (N, 3), origin (3,) m, seconds
            after the reading's instant, (N,) or one) → (N,) distances, infinite for none.
    """

    index: int
    labels: ReadingLabels
    reading: Reading
    camera: Camera | None
    mount: Mount
    parts: tuple[str, ...]
    distances_m: Callable[[ArrayLike, ArrayLike, ArrayLike], FloatArray]


class Sensor(Component[OptionsT]):
    """Takes readings of the scene from its own place on the chaser.

    A reading depends on its look and on the options alone, to the bit, and on no other reading: frames
    are made in any order, by several workers, and made again after a crash. Axes of a sensor that forms
    an image are OpenCV's: x right, y down, z forward.
    """

    camera: Camera | None = None
    """The camera whose pixels the image and arrays are of, known after :meth:`open`; None for a sensor
    that has none."""
    mount: Mount | None = None
    """Where a sensor is whose options say it, known after :meth:`open`; None where the scenario's
    ``mount`` says it."""

    def open(self, setting: SensorSetting) -> None:
        """Prepare; called once, before the first reading.

        Raises:
            posse_core.InputError: options and setting do not go together.
        """

    @abstractmethod
    def sense(self, look: SensorLook) -> Reading:
        """Take a reading at the look's instant, or from there until its next reading.

        Every reading of a sensor has the same arrays and files. Random draws are those of
        ``look.generator``.
        """

    def faults(self, stored: StoredReading) -> Iterator[str]:
        """What is wrong with a reading that was written, one line each; ``posse validate`` asks.

        It is called on a component that is not open.
        """
        yield from ()
