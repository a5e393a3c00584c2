"""The sensor ``events``: an event camera, whose pixels report changes of the light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import ceil

import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray, IntArray, evenly_spread
from posse_core._constants import Constants
from posse_core._errors import InputError
from posse_core._imaging.image_sensor import ImageSensor
from posse_core._interfaces.look import SensorLook
from posse_core._interfaces.sensor import Sensor, SensorSetting, StoredReading
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.light import Light
from posse_core._model.reading import Reading
from posse_core._randomness import random_generator
from posse_core._sensors.events.formats import check, written
from posse_core._sensors.events.noise import Noise
from posse_core._sensors.events.options import EventsOptions
from posse_core._sensors.events.pixels import Array
from posse_core._sensors.events.receptor import Receptor
from posse_core._sensors.events.recording import Events, instants_s, record
from posse_core._sky.sky import sky_speed_px_s

_ARRAYS = {"x": np.uint16, "y": np.uint16, "t_us": np.int64, "p": np.uint8}
"""Arrays of a reading, see :class:`~posse_core._sensors.events.recording.Events`, and their types."""

_NEGLIGIBLE_PX = 0.05
"""A recording goes by the rates of its instant, which is quick, if they lead to the same image to this
accuracy."""
_LEAST_RANGE_SHARE = 0.01
"""Least range at which motion in the image is computed, as a share of the spacecraft's radius."""


class EventCamera(Sensor[EventsOptions]):
    """Records events from the instant of its reading until the next one.

    Every recording starts anew, with pixels that have settled to the light of its first instant, so one
    does not depend on another.
    """

    def open(self, setting: SensorSetting) -> None:
        options = self.options
        for chosen in options.formats:
            check(chosen)
        keys = options.camera
        camera = setting.scene.camera if keys is None else keys.camera()
        self.camera = replace(camera, line_time_s=0.0)  # pixels work at all times: there is no shutter
        lens = (options.sensor or setting.image_sensor).model_copy(update={"color": "mono"})
        self._image_sensor = ImageSensor(lens, self.camera)
        self._name = setting.name
        plate_rgb = Constants().solar_constant_w_m2 * SOLAR_BAND_FRACTIONS / np.pi
        white_e_s = options.white_e_s or float(self._image_sensor.electrons_s(plate_rgb)[0])
        self._array = Array.drawn(
            random_generator(setting.seed, -1, f"sensor {setting.name}: thresholds"),
            self.camera.width_px * self.camera.height_px,
            receptor=Receptor(options.floor_e_s, white_e_s, options.bandwidth_hz),
            threshold_on=options.threshold_on,
            threshold_off=options.threshold_off,
            threshold_sigma=options.threshold_sigma,
            leak_hz=options.leak_hz,
            refractory_s=options.refractory_s,
        )

    def sense(self, look: SensorLook) -> Reading:
        assert self.camera is not None, "the sensor is not open"
        window_s = self.options.window_s or look.duration_s
        events, renders = self._recorded(look, window_s)
        arrays = {name: getattr(events, name) for name in _ARRAYS}
        size_px = (self.camera.width_px, self.camera.height_px)
        offset_us, window_us = round(look.state.t_s * 1e6), round(window_s * 1e6)
        return Reading(
            labels={
                "window_s": window_s,
                "events": len(events.p),
                "on_events": int(events.p.sum()),
                "renders": renders,
            },
            arrays=arrays,
            files={
                f".{chosen}": written(chosen, events, offset_us, window_us, size_px)
                for chosen in self.options.formats
            },
        )

    def faults(self, stored: StoredReading) -> Iterator[str]:
        arrays, labels = stored.reading.arrays, stored.reading.labels
        for name, dtype in _ARRAYS.items():
            array = arrays.get(name)
            if array is None or array.dtype != dtype or array.shape != arrays["x"].shape:
                yield f"{name} is not {np.dtype(dtype)} with one number for each event"
                return
        t_us, window_us = arrays["t_us"], round(float(labels["window_s"]) * 1e6)
        if (np.diff(t_us) < 0).any():
            yield "t_us is not ascending"
        if len(t_us) and not 0 <= t_us.min() <= t_us.max() <= window_us:
            yield f"t_us is from {t_us.min()} to {t_us.max()}, not within the window's {window_us} µs"
        camera = stored.camera
        if camera is None or not _all_below(arrays["x"], camera.width_px):
            yield "x is outside the image"
        if camera is None or not _all_below(arrays["y"], camera.height_px):
            yield "y is outside the image"
        if not _all_below(arrays["p"], 2):
            yield "p is neither 0 nor 1"
        for key, count in (("events", len(t_us)), ("on_events", int((arrays["p"] == 1).sum()))):
            if labels[key] != count:
                yield f"{key} is {labels[key]}, and the arrays have {count}"

    def _recorded(self, look: SensorLook, window_s: float) -> tuple[Events, int]:
        """The events of a recording, and the number of its renders."""
        assert self.camera is not None
        if window_s <= 0:
            return Events.of([], self.camera.width_px), 0
        first, end = look.light(), look.at(window_s)
        earth = first.sky.radiance_rgb is not None
        sky_px_s = max(sky_speed_px_s(self.camera, each.state, earth=earth) for each in (look, end))
        craft_px_s = max(look.speed_px_s(), end.speed_px_s())
        step_px, least_rate_hz = self.options.step_px, self.options.least_rate_hz
        try:
            instants = instants_s(window_s, max(sky_px_s, craft_px_s), step_px, least_rate_hz)
        except InputError as error:
            raise InputError(f"sensors.{self._name}: frame {look.index}: {error}") from None
        skies = evenly_spread(len(instants), 1 + ceil(max(1.0, window_s * sky_px_s / step_px)))
        noise = Noise.drawn(
            look.generator("shot noise"), self.options.shot_noise_hz, len(self._array.on), window_s
        )
        start = look.generator("remembered levels")
        lights = self._lights(look, first, instants, skies)
        return record(self._array, lights, noise, start, self.camera.width_px), len(instants)

    def _lights(
        self, look: SensorLook, first: Light, instants: FloatArray, skies: IntArray
    ) -> Iterator[tuple[float, Float32Array]]:
        """The light at each of the instants. The sky is computed at those with the indices ``skies``,
        and between them it is mixed from both."""
        window_s = float(instants[-1])
        by_rates = self._apart_px(look.at(window_s), look.at(window_s, by_rates=True)) < _NEGLIGIBLE_PX
        yield 0.0, self._electrons_s(first)
        before = first
        for start, end in pairwise(skies.tolist()):
            after = look.at(float(instants[end]), by_rates=by_rates).light()
            for i in range(start + 1, end):
                t_s = float(instants[i])
                share = (t_s - instants[start]) / (instants[end] - instants[start])
                sky = before.sky.mixed(after.sky, float(share))
                yield t_s, self._electrons_s(look.at(t_s, by_rates=by_rates).light(sky=sky))
            yield float(instants[end]), self._electrons_s(after)
            before = after

    def _apart_px(self, one: SensorLook, other: SensorLook) -> float:
        """A bound of how far apart two states show a point of a body or the sky, px."""
        assert self.camera is not None
        mine, theirs = one.state.craft.link_poses(), other.state.craft.link_poses()
        moved_m = np.linalg.norm(mine.t_link_cam_m - theirs.t_link_cam_m, axis=1)
        turned = np.linalg.norm(mine.R_cam_from_link - theirs.R_cam_from_link, axis=(1, 2))
        bodies = list(zip(one.scene.bodies, one.state.craft.bodies, strict=True))
        links = [state.articulation.links for _, state in bodies]
        radius_m = np.repeat([spacecraft.radius_m for spacecraft, _ in bodies], links)
        range_m = np.repeat([state.range_m for _, state in bodies], links)
        nearest_m = np.maximum(range_m - radius_m, _LEAST_RANGE_SHARE * radius_m)
        turned_sky = np.linalg.norm(one.state.R_cam_from_eci - other.state.R_cam_from_eci)
        apart = max(float(((moved_m + radius_m * turned) / nearest_m).max()), float(turned_sky))
        return apart / self.camera.pixel_rad

    def _electrons_s(self, light: Light) -> Float32Array:
        """(H, W) photo-electrons per second."""
        return self._image_sensor.mean_electrons(light.sky, light.craft, 1.0)[..., 0]


def _all_below(array: AnyArray, limit: int) -> bool:
    return not (array >= limit).any()
