"""The sensors of a scenario beside its camera, and their readings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pydantic import ValidationError

from posse_core._arrays import FloatArray
from posse_core._dataset.sensors import SensorInfo
from posse_core._errors import ComponentError, InputError
from posse_core._frames import quaternion_from_matrix
from posse_core._interfaces.look import Look, SensorLook, Standpoint
from posse_core._interfaces.sensor import Sensor, SensorSetting
from posse_core._model.craft_state import BodyState
from posse_core._model.label_line import BodyReading, JointReading, ReadingLabels, first_fault
from posse_core._model.labels import Labels
from posse_core._model.light import Light
from posse_core._model.mount import Mount
from posse_core._model.reading import Reading
from posse_core._model.scene import FrameState, Scene
from posse_core._plugins.component import failures_named
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import create
from posse_core._scenario.model import Scenario
from posse_core._scenario.sensors import SensorChoice
from posse_core._simulator.optics import Optics
from posse_core._simulator.returned import checked_reading


@dataclass(frozen=True)
class OpenSensor:
    """A sensor of a scenario, opened.

    Attributes:
        name: in the scenario.
        choice: the scenario's keys.
        mount: where it is.
        sensor: the component.
        scene: the spacecraft, and the camera of its pixels.
    """

    name: str
    choice: SensorChoice
    mount: Mount
    sensor: Sensor[Any]
    scene: Scene

    @property
    def info(self) -> SensorInfo:
        """What a dataset tells of the sensor."""
        return SensorInfo(
            self.name,
            self.choice.name,
            self.mount,
            self.choice.rate_hz,
            self.sensor.camera,
            self.choice.options,
        )


def open_sensors(
    scenario: Scenario, registry: Registry, scene: Scene, annotate: Callable[[Look], Labels]
) -> tuple[OpenSensor, ...]:
    """Make and open the sensors of a scenario.

    Raises:
        InputError: the options of a sensor do not go with the scenario.
        ComponentError: a sensor cannot be made.
    """

    def opened(name: str, choice: SensorChoice) -> OpenSensor:
        mount = choice.mount.mount()
        sensor: Sensor[Any] = create(registry, "sensor", choice)
        setting = SensorSetting(name, scenario.seed, scene, scenario.sensor, mount, annotate)
        try:
            with failures_named("sensor", name):
                sensor.open(setting)
        except InputError as error:
            raise InputError(f"sensors.{name}: {error}") from None
        own = replace(scene, camera=sensor.camera or scene.camera)
        return OpenSensor(name, choice, sensor.mount or mount, sensor, own)

    return tuple(opened(name, choice) for name, choice in scenario.sensors.items())


def readings_s(name: str, choice: SensorChoice, duration_s: float) -> tuple[float, ...]:
    """Seconds from a frame's instant to that of each reading of the sensor ``name``.

    duration_s: time to the sequence's next frame.

    Raises:
        InputError: there would be too many.
    """
    try:
        return choice.instants_s(duration_s)
    except ValueError as error:
        raise InputError(f"sensors.{name}.rate_hz: {error}") from None


def sensor_infos(scenario: Scenario, registry: Registry, scene: Scene) -> tuple[SensorInfo, ...]:
    """What a dataset will tell of a scenario's sensors.

    Raises:
        InputError: the options of a sensor do not go with the scenario.
        ComponentError: a sensor cannot be made.
    """

    def no_labels(look: Look) -> Labels:
        raise RuntimeError("a sensor is opened before it may annotate")

    return tuple(each.info for each in open_sensors(scenario, registry, scene, no_labels))


class Sensing:
    """Takes the readings of a frame."""

    def __init__(self, sensors: Sequence[OpenSensor], optics: Optics, seed: int) -> None:
        """seed: of the run."""
        self._sensors = sensors
        self._optics = optics
        self._seed = seed

    def of(
        self, state: FrameState, image_light: Light
    ) -> tuple[dict[str, tuple[Reading, ...]], dict[str, tuple[ReadingLabels, ...]]]:
        """The readings of a frame by sensor, and their labels, still without files.

        image_light: that the frame's image was made of.

        Raises:
            InputError: a sensor would take too many readings until the next frame.
            ComponentError: a sensor failed.
        """
        readings: dict[str, tuple[Reading, ...]] = {}
        labels: dict[str, tuple[ReadingLabels, ...]] = {}
        for sensor in self._sensors:
            stands = self._stands(sensor, state)
            taken = [self._reading(sensor, stand, image_light) for stand in stands]
            readings[sensor.name] = tuple(reading for reading, _ in taken)
            labels[sensor.name] = tuple(label for _, label in taken)
        return readings, labels

    def _stands(self, sensor: OpenSensor, state: FrameState) -> list[Standpoint]:
        duration_s = _until_next_frame_s(state)
        instants_s = readings_s(sensor.name, sensor.choice, duration_s)
        ends_s = [*instants_s[1:], duration_s]
        return [
            Standpoint(
                state,
                sensor.mount,
                self._seed,
                f"sensor {sensor.name}",
                k,
                reading_s=start_s,
                duration_s=max(0.0, end_s - start_s),
            )
            for k, (start_s, end_s) in enumerate(zip(instants_s, ends_s, strict=True))
        ]

    def _reading(
        self, sensor: OpenSensor, stand: Standpoint, image_light: Light
    ) -> tuple[Reading, ReadingLabels]:
        at_image = (
            stand.mount.is_none and stand.number == 0 and sensor.scene.camera == image_light.camera
        )
        look = SensorLook(
            stand,
            sensor.scene,
            self._optics.geometry,
            self._optics.light,
            image_light=image_light if at_image else None,
        )
        with failures_named("sensor", sensor.name):
            made = sensor.sensor.sense(look)
        reading = checked_reading(made, sensor.name, sensor.sensor.camera)
        return reading, reading_labels(look, reading, sensor.name)


def reading_labels(look: Look, reading: Reading, name: str) -> ReadingLabels:
    """The labels of a reading of the sensor ``name``, without files.

    Raises:
        ComponentError: a label cannot be written.
    """
    craft = look.state.craft
    try:
        return ReadingLabels(
            t_s=look.state.t_s,
            q_sensor_from_body=_tuple(quaternion_from_matrix(craft.R_cam_from_body)),
            t_body_sensor_m=_tuple(craft.t_body_cam_m),
            v_body_sensor_m_s=_tuple(craft.rates.v_body_cam_m_s),
            omega_body_rad_s=_tuple(craft.rates.omega_body_rad_s),
            omega_sensor_rad_s=_tuple(craft.rates.omega_camera_rad_s),
            labels=dict(reading.labels),
            joints=_joints(craft),
            bodies={
                known.name: _body_reading(body)
                for known, body in zip(look.scene.others, craft.others, strict=True)
            },
        )
    except ValidationError as error:
        raise ComponentError(
            f"sensor {name!r}: a label cannot be written: {first_fault(error)}"
        ) from None


def _body_reading(body: BodyState) -> BodyReading:
    return BodyReading(
        q_sensor_from_body=_tuple(quaternion_from_matrix(body.R_cam_from_body)),
        t_body_sensor_m=_tuple(body.t_body_cam_m),
        v_body_sensor_m_s=_tuple(body.rates.v_body_cam_m_s),
        omega_body_rad_s=_tuple(body.rates.omega_body_rad_s),
        is_carried=body.is_carried,
        joints=_joints(body),
    )


def _joints(body: BodyState) -> dict[str, JointReading]:
    moving = body.articulation
    return {
        joint.name: JointReading(value=float(value), rate=float(rate))
        for joint, value, rate in zip(moving.joints, moving.values, moving.rates, strict=True)
    }


def _tuple(vector: FloatArray) -> Any:
    return tuple(vector.tolist())


def annotated_look(state: FrameState, scene: Scene, optics: Optics, seed: int) -> Look:
    """The look of the chaser's camera at a frame, for annotators."""
    duration_s = _until_next_frame_s(state)
    stand = Standpoint(state, Mount(), seed, "annotator", duration_s=duration_s)
    return Look(stand, scene, optics.geometry)


def _until_next_frame_s(state: FrameState) -> float:
    """Time until the sequence's next frame; 0 where there is none or it is not known."""
    return 0.0 if state.onward is None else state.onward.duration_s
