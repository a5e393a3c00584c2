"""Published cameras by name, as keys of a scenario's ``camera`` and ``sensor``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any


@dataclass(frozen=True)
class CameraPreset:
    """A camera by name.

    Attributes:
        source: where the numbers come from, and which of them are not published.
        camera, sensor: keys of the scenario.
    """

    source: str
    camera: Mapping[str, Any]
    sensor: Mapping[str, Any]


_IMX174: Mapping[str, Any] = MappingProxyType(
    {
        "exposure_s": 0.001,
        "f_number": 16.0,
        "quantum_efficiency": [0.55, 0.72, 0.70],
        "full_well_e": 32500.0,
        "color": "mono",
        "bit_depth": 8,
        "noise": {"read_e": 7.0, "dark_e_s": 4.0},
    }
)
_GRASSHOPPER = (
    "Point Grey Grasshopper 3 with a Xenoplan 1.9/17 mm lens, Sony IMX174, 8 bits, global shutter."
    " Full well, read noise and efficiency are the sensor maker's; exposure and f-number are not"
    " published: they keep a white plate in sunlight under the full well."
)
PRESETS: Mapping[str, CameraPreset] = MappingProxyType(
    {
        "thesis": CameraPreset(
            "Table 3.5 of the thesis. It says nothing of a sensor: these are the values that POSSE's"
            " scenarios of its datasets have.",
            {"width_px": 1280, "height_px": 960, "hfov_deg": 90.0, "sensor_width_mm": 36.0},
            {"exposure_s": 0.002, "response": "srgb", "noise": {"gaussian_dn": 1.0}},
        ),
        "speed": CameraPreset(
            "SPEED (Kisantal et al. 2020, IEEE TAES 56): 17.6 mm, pixels of 5.86 µm, K with the"
            f" principal point at half the image's size, no distortion. {_GRASSHOPPER}",
            {
                "width_px": 1920,
                "height_px": 1200,
                "focal_px": [17.6e-3 / 5.86e-6, 17.6e-3 / 5.86e-6],
                "centre_px": [960.0, 600.0],
                "sensor_width_mm": 11.2512,
            },
            _IMX174,
        ),
        "speed-plus": CameraPreset(
            "camera.json of SPEED+ (Park et al. 2022, IEEE Aerospace Conference): calibrated, with"
            f" distortion. {_GRASSHOPPER}",
            {
                "width_px": 1920,
                "height_px": 1200,
                "focal_px": [2988.5795163815555, 2988.3401159176124],
                "centre_px": [960.0, 600.0],
                "sensor_width_mm": 11.2512,
                "distortion": [
                    -0.22383016606510672,
                    0.51409797089106379,
                    -0.00066499611998340662,
                    -0.00021404771667484594,
                    -0.13124227429077406,
                ],
            },
            _IMX174,
        ),
    }
)


def with_preset(raw: Mapping[str, Any]) -> dict[str, Any]:
    """A scenario's raw keys, completed by those of ``camera.preset``."""
    filled = dict(raw)
    camera, sensor = raw.get("camera"), raw.get("sensor", {})
    name = camera.get("preset") if isinstance(camera, Mapping) else None
    preset = PRESETS.get(str(name))
    if preset is not None and isinstance(camera, Mapping) and isinstance(sensor, Mapping):
        filled["camera"] = {**_without_other_field(preset.camera, camera), **camera}
        filled["sensor"] = _merged(preset.sensor, sensor)
    return filled


def _without_other_field(preset: Mapping[str, Any], camera: Mapping[str, Any]) -> dict[str, Any]:
    """A preset's camera keys less the one that describes the field of view in the other way than the
    scenario."""
    ways = {"hfov_deg": "focal_px", "focal_px": "hfov_deg"}
    given = {other for way, other in ways.items() if camera.get(way) is not None}
    return {key: value for key, value in preset.items() if key not in given}


def _merged(under: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of both. Mappings in both are merged in turn; for other values ``over`` prevails."""
    both = {**under, **over}
    for key in under.keys() & over.keys():
        if isinstance(under[key], Mapping) and isinstance(over[key], Mapping):
            both[key] = _merged(under[key], over[key])
    return both
