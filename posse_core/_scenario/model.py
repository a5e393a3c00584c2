"""The scenario as a frozen record. Every key has a description; its name has the unit."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from pydantic import Field, field_validator, model_validator

from posse_core._arrays import FloatArray
from posse_core._constants import THESIS_SOLAR_CONSTANT_W_M2, Constants
from posse_core._errors import InputError
from posse_core._plugins.options import Options
from posse_core._scenario.attitude import AttitudeConfig
from posse_core._scenario.bodies import MOST_BODIES, BodyConfig
from posse_core._scenario.camera import CameraConfig
from posse_core._scenario.component import ComponentChoice, TargetChoice
from posse_core._scenario.damage import DamageConfig
from posse_core._scenario.flight import FlightConfig
from posse_core._scenario.joints import JointLawChoice
from posse_core._scenario.limits import MOST_FRAMES
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._scenario.presets import with_preset
from posse_core._scenario.sensor import SensorConfig
from posse_core._scenario.sensors import SensorChoice
from posse_core._scenario.sky import SkyConfig
from posse_core._scenario.variation import VariationConfig

_SENSOR_NAME: Final = re.compile(r"[a-z][a-z0-9-]{0,63}")


class TimesConfig(Options):
    """When frames are taken: at listed times, or evenly spaced over a duration that starts at the epoch.

    With ``rate_hz`` and no duration, it is that of a recorded motion, or else one orbit.
    """

    t_s: tuple[float, ...] | None = Field(
        None, min_length=1, description="time of each frame, seconds after the epoch"
    )
    duration_orbits: float | None = Field(
        None, gt=0, description="duration, periods of the target's orbit"
    )
    duration_s: float | None = Field(None, gt=0, description="duration, seconds")
    count: int | None = Field(
        None,
        ge=1,
        le=MOST_FRAMES,
        description="number of frames over the duration, ends included; null is 101",
    )
    rate_hz: float | None = Field(
        None,
        gt=0,
        description="frames per second, instead of count, from the epoch to the end of the duration;"
        " without a duration, from the first to the last instant of a recorded motion",
    )

    @model_validator(mode="before")
    @classmethod
    def _default_duration(cls, raw: Any) -> Any:
        others = {"t_s", "duration_orbits", "duration_s", "rate_hz"}
        if isinstance(raw, dict) and not others & set(raw):
            return {**raw, "duration_orbits": 1.0}
        return raw

    @model_validator(mode="after")
    def _exactly_one(self) -> TimesConfig:
        given = [k for k in ("t_s", "duration_orbits", "duration_s") if getattr(self, k) is not None]
        if len(given) > 1 or (not given and self.rate_hz is None):
            raise ValueError(f"give exactly one of t_s, duration_orbits, duration_s, not {given}")
        if self.t_s is not None and not (self.count is None and self.rate_hz is None):
            raise ValueError("count and rate_hz go with a duration, not with t_s")
        if self.count is not None and self.rate_hz is not None:
            raise ValueError("give count or rate_hz, not both")
        return self

    @property
    def recorded_rate_hz(self) -> float | None:
        """The rate, if frames are taken over all of a recorded motion."""
        return None if self.duration_s or self.duration_orbits else self.rate_hz

    def seconds(self, period_s: Callable[[], float]) -> FloatArray:
        """(F,) times of the frames, seconds after the epoch.

        Args:
            period_s: gives the target's orbital period. It is called only where the duration is in
                orbits, since a hyperbolic orbit has no period.
        """
        if self.t_s is not None:
            return np.asarray(self.t_s, dtype=np.float64)
        duration_s = self.duration_s
        if duration_s is None:
            duration_s = (self.duration_orbits or 1.0) * period_s()
        if self.rate_hz is not None:
            return at_rate(0.0, duration_s, self.rate_hz)
        return np.linspace(0.0, duration_s, self.count or 101)


def at_rate(start_s: float, end_s: float, rate_hz: float) -> FloatArray:
    """(F,) times from a start, a step apart, up to an end.

    Raises:
        InputError: there would be more than :data:`MOST_FRAMES`.
    """
    steps = (end_s - start_s) * rate_hz * (1 + 1e-12) + 1e-9
    if not steps < MOST_FRAMES:
        raise InputError(
            f"times.rate_hz: {rate_hz:g} frames per second for {end_s - start_s:g} s are more than"
            f" {MOST_FRAMES} frames; lower it, or give a duration"
        )
    return start_s + np.arange(int(steps) + 1) / rate_hz


class Scenario(Options):
    """Everything that defines a run. Only ``target`` and ``orbit`` have no default, and a propagator of
    recorded motion gives the orbit too."""

    target: TargetChoice = Field(
        description="the spacecraft: {name: aqua}, {mesh: model.glb, scale_m_per_unit: 0.0385,"
        ' body_axes: "x y z"} or {package: folder}'
    )
    damage: DamageConfig | None = Field(None, description="random damage to the target")
    variation: VariationConfig | None = Field(None, description="random materials of the target")
    orbit: OrbitConfig = Field(description="the target's orbit: one of tle, elements, state_eci")
    relative: RelativeConfig = Field(
        RelativeConfig(roe_m=(0.0, 0.0, 20.0, 0.0, 20.0, 0.0)),
        description="the chaser's motion relative to the target",
    )
    times: TimesConfig | None = Field(
        None,
        description="when frames are taken; null: 101 frames over one orbit, or the own frames of a"
        " propagator that has some",
    )
    frames: int | None = Field(
        None, ge=1, description="make only this many of the frames, evenly spread; null for all"
    )
    propagator: ComponentChoice = Field(
        ComponentChoice(name="roe"),
        description="model of the orbital motion: a name, or {name, options}",
    )
    attitude: AttitudeConfig = Field(AttitudeConfig(), description="attitude of target and camera")
    joints: Mapping[str, JointLawChoice] = Field(
        {},
        description="laws of the target's joints: name of a joint → a law's name, or {law, options};"
        " 'posse describe joint-law' lists laws. A joint without a law does not move",
    )
    bodies: Mapping[str, BodyConfig] = Field(
        {},
        description="bodies beside the target, by names of your own, each {spacecraft, relative or"
        " mount, attitude, count, spread_m}",
    )
    camera: CameraConfig = Field(CameraConfig(), description="the camera's geometry")
    sky: SkyConfig = Field(SkyConfig(), description="what is behind and around the spacecraft")
    sensor: SensorConfig = Field(SensorConfig(), description="from radiance to digital numbers")
    sensors: Mapping[str, SensorChoice] = Field(
        {},
        description="sensors beside the camera, by names of your own, each {type, mount, rate_hz,"
        " options}; 'posse describe sensor' lists types",
    )
    renderer: ComponentChoice = Field(
        ComponentChoice(name="mitsuba"),
        description="renderer of the spacecraft: a name, or {name, options}",
    )
    annotators: tuple[ComponentChoice, ...] = Field(
        tuple(ComponentChoice(name=n) for n in ("box", "mask", "parts", "depth", "keypoints", "pose")),
        description="annotators that make the labels: names, or {name, options}",
    )
    writers: tuple[ComponentChoice, ...] = Field(
        (ComponentChoice(name="coco"), ComponentChoice(name="speed")),
        description="writers that export the labels when the run ends: names, or {name, options}",
    )
    flight: FlightConfig | None = Field(
        None, description="a flight, in which the chaser sees and steers, for 'posse fly'"
    )
    constants: Constants = Field(Constants(), description="physical constants")
    seed: int = Field(0, ge=0, lt=2**63, description="seed of every random draw")

    @model_validator(mode="before")
    @classmethod
    def _names(cls, raw: Any) -> Any:
        """Give options without a name the default component's name, and fill in a named camera's
        keys."""
        if not isinstance(raw, dict):
            return raw
        named = with_preset(raw)
        for key in ("propagator", "renderer"):
            if isinstance(raw.get(key), dict) and "name" not in raw[key]:
                named[key] = {"name": cls.model_fields[key].default.name, **raw[key]}
        return named

    @model_validator(mode="before")
    @classmethod
    def _times_of_earlier_versions(cls, raw: Any) -> Any:
        """Drop times that earlier versions wrote into datasets of recorded motion, which ignored
        them."""
        written = {"t_s", "duration_orbits", "duration_s", "count"}
        if not isinstance(raw, dict) or not isinstance(times := raw.get("times"), dict):
            return raw
        propagator = raw.get("propagator")
        is_file = isinstance(propagator, dict) and propagator.get("name") == "file"
        return {**raw, "times": None} if is_file and set(times) == written else raw

    @model_validator(mode="before")
    @classmethod
    def _constants_of_the_thesis(cls, raw: Any) -> Any:
        """Propagator ``thesis`` uses the thesis' solar constant, unless the scenario gives another."""
        if not isinstance(raw, dict) or not isinstance(given := raw.get("constants", {}), dict):
            return raw
        propagator = raw.get("propagator")
        name = propagator.get("name") if isinstance(propagator, dict) else propagator
        if name != "thesis":
            return raw
        return {**raw, "constants": {"solar_constant_w_m2": THESIS_SOLAR_CONSTANT_W_M2, **given}}

    @model_validator(mode="after")
    def _scaled(self) -> Scenario:
        if self.camera.scale == 1:
            return self
        sensor = self.sensor.with_pixels_of(self.camera.scale**-2)
        return self.model_copy(update={"camera": self.camera.scaled(), "sensor": sensor})

    @field_validator("bodies")
    @classmethod
    def _not_too_many(cls, bodies: Mapping[str, BodyConfig]) -> Mapping[str, BodyConfig]:
        members = [member for name, body in bodies.items() for member, _ in body.members(name)]
        if len(members) > MOST_BODIES:
            raise ValueError(f"{len(members)} bodies are over {MOST_BODIES}")
        for member in members:
            if members.count(member) > 1:
                raise ValueError(f"two bodies are named {member!r}")
        return bodies

    @field_validator("sensors", "bodies")
    @classmethod
    def _names_of_folders(cls, named: Mapping[str, Any]) -> Mapping[str, Any]:
        for name in named:
            if not _SENSOR_NAME.fullmatch(name):
                raise ValueError(
                    f"{name!r} cannot be a folder's name; take lower-case letters, digits and -"
                )
        return named

    @field_validator("annotators", "writers")
    @classmethod
    def _no_twins(cls, choices: tuple[ComponentChoice, ...]) -> tuple[ComponentChoice, ...]:
        names = [choice.name for choice in choices]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"{name!r} is given twice")
        return choices
