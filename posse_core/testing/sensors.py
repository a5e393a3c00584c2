"""The conformance class for sensors."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import AnyArray, FloatArray
from posse_core._frames import matrix_from_rotation_vector
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import Look, SensorLook, Standpoint
from posse_core._interfaces.sensor import Sensor, SensorSetting, StoredReading
from posse_core._model.craft_state import Rates
from posse_core._model.labels import Labels
from posse_core._model.light import Light, LightRequest
from posse_core._model.mount import Mount
from posse_core._model.reading import Reading
from posse_core._model.scene import FrameState, Radiance, Scene
from posse_core._model.sky_view import SkyView
from posse_core._scenario.sensor import SensorConfig
from posse_core._simulator.returned import checked_reading
from posse_core._simulator.sensing import reading_labels
from posse_core.testing import scenes
from posse_core.testing.conformance import Conformance
from posse_core.testing.stage import craft

SEED = 7
MOUNT = Mount(np.array([0.3, -0.1, 0.2]), matrix_from_rotation_vector(np.array([0.0, 0.05, 0.02])))
RATES = Rates(np.array([0.02, -0.01, 0.05]), np.array([0.0, 0.02, 0.01]), np.array([0.001, 0.002, 0.0]))
"""Of the kit's spacecraft: some centimetres a second, about a degree a second."""


class SensorConformance(Conformance):
    """What every sensor must do. A subclass provides :meth:`sensor`.

    The kit's spacecraft is a drum with a wing and a boom, 2.6 m wide, 6 to 12 m in front of a camera of
    192 by 144 pixels, sunlit, and moves. The light that the kit shows is Lambert's on exact geometry,
    before a sky that is black but for one star.
    """

    @abstractmethod
    def sensor(self) -> Sensor[Any]:
        """A new sensor, with the same options each time."""

    def mount(self) -> Mount:
        """The mount that the scenario gives; ``Mount()`` for a sensor whose options say where it is."""
        return MOUNT

    def test_its_readings_can_be_written(self) -> None:
        for state in _states():
            reading = self._read(self._opened(), state)
            json.dumps(dict(reading.labels), allow_nan=False)

    def test_every_reading_has_the_same_arrays_and_files(self) -> None:
        """Also where the spacecraft is out of view."""
        sensor = self._opened()
        kinds = {_kind(self._read(sensor, state)) for state in _states()}
        assert len(kinds) == 1, f"readings are of several kinds: {kinds}"

    def test_a_reading_does_not_depend_on_others(self) -> None:
        """To the bit: from a sensor that read other frames before, and from a new one."""
        sensor, states = self._opened(), _states()
        before = [self._read(sensor, state) for state in states]
        for state, reading in [*zip(states, before, strict=True)][::-1]:
            _assert_equal(self._read(sensor, state), reading, "read again in another order")
            _assert_equal(self._read(self._opened(), state), reading, "from another sensor")

    def test_two_readings_of_a_frame_are_told_apart(self) -> None:
        """The second reading of a frame, a moment later, can be written too."""
        sensor = self._opened()
        look = self._look(sensor, _states()[0], number=1, reading_s=0.1)
        assert look.number == 1, "the kit's second look is number 1"
        self._checked(look, sensor)

    def test_its_readings_have_no_faults(self) -> None:
        """A component that is not open finds nothing wrong with what it read, as a file holds it."""
        sensor = self._opened()
        for state in _states():
            look = self._look(sensor, state)
            reading = self._checked(look, sensor)
            said = reading_labels(look, reading, "kit")
            said = type(said).model_validate_json(said.model_dump_json())
            stored = StoredReading(
                index=look.index,
                labels=said,
                reading=replace(reading, labels=said.labels, files={}),
                camera=sensor.camera,
                mount=sensor.mount or self.mount(),
                parts=tuple(part.name for part in look.scene.spacecraft.parts),
                distances_m=partial(_distances_m, look),
            )
            faults = list(self.sensor().faults(stored))
            assert not faults, faults[0]

    def test_what_it_is_given_is_left_alone(self) -> None:
        state = _states()[0]
        kept = [np.array(x) for x in _arrays(state)]
        self._read(self._opened(), state)
        for now, before in zip(_arrays(state), kept, strict=True):
            np.testing.assert_array_equal(now, before, "the state was modified")

    def _opened(self) -> Sensor[Any]:
        sensor = self.sensor()
        scene = craft()
        sensor.open(
            SensorSetting(
                name="kit",
                seed=SEED,
                scene=scene,
                image_sensor=SensorConfig(),
                mount=self.mount(),
                annotate=lambda look: Labels({"pixels": int(look.view().mask.sum())}),
            )
        )
        return sensor

    def _read(self, sensor: Sensor[Any], state: FrameState) -> Reading:
        return self._checked(self._look(sensor, state), sensor)

    def _checked(self, look: SensorLook, sensor: Sensor[Any]) -> Reading:
        return checked_reading(sensor.sense(look), type(sensor).__name__, sensor.camera)

    def _look(
        self, sensor: Sensor[Any], state: FrameState, number: int = 0, reading_s: float = 0.0
    ) -> SensorLook:
        scene, mount = craft(), sensor.mount or self.mount()
        stand = Standpoint(state, mount, SEED, "sensor kit", number, reading_s, duration_s=0.1)
        caster = RayCaster(scene)
        own = replace(scene, camera=sensor.camera or scene.camera)
        return SensorLook(stand, own, caster.through, lit(scene))


def lit(scene: Scene) -> Callable[[LightRequest], Light]:
    """Light by Lambert's law on exact geometry, for :class:`posse_core.SensorLook`."""
    caster = RayCaster(scene)
    colours = np.array(
        [scene.spacecraft.materials[part.material].base_color for part in scene.spacecraft.parts]
    )

    def gather(request: LightRequest) -> Light:
        state, camera = request.state, request.camera
        view = caster.through(camera).view(state.craft)
        star = np.array([[3.25, 4.5]]), np.full((1, 3), 1e-9)
        if view.box.is_empty:
            return Light(camera, SkyView(None, *star), None)
        facing = np.clip(np.nan_to_num(view.normal_cam) @ state.craft.sun_direction_cam, 0, None)
        plate_rgb = colours[view.part_id] * state.craft.sun_irradiance_rgb_w_m2 / np.pi
        radiance = (plate_rgb * (facing * view.lit * view.mask)[..., None]).astype(np.float32)
        seen = Radiance(view.box, radiance, view.mask.astype(np.float32))
        return Light(camera, SkyView(None, *star), seen)

    return gather


def _distances_m(
    look: Look, directions: ArrayLike, origin_m: ArrayLike, after_s: ArrayLike
) -> FloatArray:
    return look.rays(directions, origin_m=origin_m, after_s=after_s).distance_m


def _states() -> list[FrameState]:
    """In view twice, and once behind the camera."""
    places = ((0.0, 0.0, 6.0), (0.5, -0.3, 12.0), (0.0, 0.0, -9.0))
    made = []
    for index, place in enumerate(places):
        state = scenes.frame(t_body_cam_m=place, sun_direction_body=(0.3, -0.4, -1.0))
        made.append(replace(state, index=index, craft=replace(state.craft, rates=RATES)))
    return made


def _arrays(state: FrameState) -> list[FloatArray]:
    return [
        *(state.craft.R_cam_from_body, state.craft.t_body_cam_m, state.craft.sun_direction_cam),
        *(state.R_cam_from_eci, state.r_camera_eci_m, state.craft.rates.v_body_cam_m_s),
    ]


def _kind(reading: Reading) -> tuple[Any, ...]:
    arrays = sorted((name, array.dtype.str, array.ndim) for name, array in reading.arrays.items())
    image = None if reading.image is None else (reading.image.dtype.str, reading.image.shape)
    return tuple(arrays), image, tuple(sorted(reading.files)), tuple(sorted(reading.labels))


def _assert_equal(one: Reading, other: Reading, why: str) -> None:
    assert one.labels == other.labels, why
    assert dict(one.files) == dict(other.files), why
    both: Mapping[str, tuple[AnyArray, AnyArray]] = {
        name: (one.arrays[name], other.arrays[name]) for name in {*one.arrays} | {*other.arrays}
    }
    for name, (mine, theirs) in both.items():
        np.testing.assert_array_equal(mine, theirs, f"{name}, {why}")
    if one.image is not None and other.image is not None:
        np.testing.assert_array_equal(one.image, other.image, why)
