"""Options of an event camera."""

from __future__ import annotations

from pydantic import Field, field_validator

from posse_core._scenario.sensor import SensorConfig
from posse_core._sensors.camera.options import CameraOptions
from posse_core._sensors.events.formats import Format


class EventsOptions(CameraOptions):
    """An event camera: geometry and lens as of a camera, and its pixels. Thresholds are changes of the
    natural logarithm of the light."""

    sensor: SensorConfig | None = Field(
        None,
        description="its lens, with the keys of the scenario's 'sensor', of which f_number,"
        " quantum_efficiency, psf and vignetting count; null for the same as the chaser's camera",
    )
    threshold_on: float = Field(0.2, gt=0, description="nominal threshold of ON events")
    threshold_off: float = Field(0.2, gt=0, description="nominal threshold of OFF events")
    threshold_sigma: float = Field(
        0.03, ge=0, description="standard deviation of the thresholds among the pixels"
    )
    refractory_s: float = Field(
        5e-4, ge=0, description="time after an event in which the pixel makes none, s"
    )
    leak_hz: float = Field(0.1, ge=0, description="ON events per second and pixel by the leak")
    shot_noise_hz: float = Field(
        1.0,
        ge=0,
        description="events per second and pixel by shot noise in the dark; a quarter at white",
    )
    bandwidth_hz: float | None = Field(
        None,
        gt=0,
        description="-3 dB frequency of a photoreceptor at white, in proportion lower in less light;"
        " null follows the light at once",
    )
    floor_e_s: float = Field(
        25_000.0,
        gt=0,
        description="light below which the response is linear and not logarithmic, about the dark"
        " current, electrons per second",
    )
    white_e_s: float | None = Field(
        None,
        gt=0,
        description="light of brightness 1 for bandwidth and shot noise, electrons per second; null is a"
        " white plate that faces the Sun at 1 au",
    )
    window_s: float | None = Field(
        None, gt=0, description="length of a recording, s; null lasts until the next reading"
    )
    step_px: float = Field(
        0.5, gt=0, description="largest motion in the image from one render to the next, px"
    )
    least_rate_hz: float = Field(
        30.0, gt=0, description="least number of renders per second, whatever moves"
    )
    formats: tuple[Format, ...] = Field(
        (), description="further files of the events: h5 (HDF5 as in DSEC), aedat4"
    )

    @field_validator("formats")
    @classmethod
    def _once(cls, formats: tuple[Format, ...]) -> tuple[Format, ...]:
        if len(set(formats)) < len(formats):
            raise ValueError("a format is named twice")
        return formats
