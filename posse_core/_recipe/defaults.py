"""The recipe of a spacecraft of which nothing is known but its shape."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from posse_core._detection.models import shipped_model
from posse_core._errors import InputError
from posse_core._model.spacecraft import PLAIN, is_plain
from posse_core._plugins.registry import Registry
from posse_core._recipe.file import recipe_of
from posse_core._recipe.model import Recipe
from posse_core._scenario.component import TargetChoice, create
from posse_core._simulator.returned import built

_DETECTORS: Final[Mapping[str, Mapping[str, Any]]] = {
    "boxes": {"name": "nano", "input_px": 256, "batch": 16},
    "keypoints": {"name": "heatmap", "input_px": 192, "batch": 16},
}
_START: Final = "aqua"
"""The shipped nets that trainings start from, where they are installed."""
_EPOCHS: Final = ("2022-01-10T00:00:00", "2022-05-01T00:00:00", "2022-08-20T00:00:00")
"""Of the sources: the Sun is elsewhere from one to the next."""
_SCENARIO: Final[Mapping[str, Any]] = {
    "orbit": {
        "elements": {
            "epoch_utc": _EPOCHS[0],
            "a_m": 6.978e6,
            "e": 0.001,
            "i_deg": 65.0,
            "raan_deg": 40.0,
            "argp_deg": 0.0,
            "mean_anomaly_deg": 0.0,
        }
    },
    "attitude": {"target": {"law": "random"}},
    "camera": {"width_px": 640, "height_px": 480, "hfov_deg": 40.0},
    "sky": {"stars": {"gain": 1e4}},
    "sensor": {
        "auto_exposure": {"percentile": 95, "level": 0.5, "longest_s": 0.05},
        "exposure_stops": [-2, 1],
        "response": "srgb",
        "psf": {"sigma_px": 0.7},
    },
    "annotators": ["box", "mask", "keypoints", "pose"],
    "writers": [],
}
_VARIED: Final = {"brightness": [0.6, 1.6], "tint": [0.9, 1.11], "roughness": [0.6, 1.6]}
"""How each material varies from frame to frame."""
_PATTERN: Final = 1.0
"""Strength of the patterns of what has no materials."""
_SPACE: Final[Mapping[str, Any]] = {
    "sky.earth": False,
    "sky.stars.gain": 1e6,
    "sensor.response": "linear",
    "sensor.psf.sigma_px": 1.4,
    "sensor.noise.read_e": 80.0,
    "sensor.exposure_stops": [-0.5, 1.5],
}
"""Without the Earth's light, through a softer lens, with a noisy sensor, as linear values, which show
less in the dark."""


_GLOBE: Final[Mapping[str, Any]] = {
    "orbit.elements.a_m": 3.0e7,
    "orbit.elements.e": 0.55,
    "relative.design": {"name": "hold-point", "r_rtn_m": [-1000.0, 0.0, 0.0]},
    "attitude.camera.off_axis_deg": [155.0, 180.0],
}
"""The Earth as a disc of 16° to 56°, from below the spacecraft, which is behind the camera: as round and
bright as nothing that is seen from a low orbit."""


def default_recipe(craft: Mapping[str, Any], hours: float, workers: int, registry: Registry) -> Recipe:
    """Return the recipe for a spacecraft, with the renderers and detectors that are installed.

    Most frames are by ``raster``, which is fast, and a sixth by ``mitsuba``, whose light is exact. Parts
    of a mesh without materials have another random pattern in each frame, so that what is learned is
    their shape.

    Args:
        craft: the key ``craft``.
        hours: time that all may take.
        workers: processes and threads.
        registry: the installed components.

    Raises:
        InputError: no renderer is installed, or no detector that can be trained, or the spacecraft
            cannot be used.
    """
    fast, exact = _renderers(registry)
    sources: dict[str, dict[str, Any]] = {
        "earth": {"share": 0.45},
        "space": {"share": 0.2, "set": dict(_SPACE)},
        "empty": {"share": 0.12, "craft": False, "set": {"orbit.elements.epoch_utc": _EPOCHS[1]}},
        "globe": {"share": 0.08, "craft": False, "set": dict(_GLOBE)},
    }
    if exact is not None:
        changed = {"renderer": exact, "sky.stars.gain": 1.0, "orbit.elements.epoch_utc": _EPOCHS[2]}
        sources["mitsuba"] = {"share": 0.17, "set": changed}
    for task, choice in _DETECTORS.items():
        if choice["name"] not in registry.names("detector"):
            raise InputError(
                f"recipe: the detector {choice['name']!r} for {task} is not installed; install"
                " posse-detect-torch"
            )
    materials = built(create(registry, "scene", TargetChoice.model_validate(craft)), "craft").materials
    any_plain = any(is_plain(material) for material in materials.values())
    vary = {PLAIN.name: {**_VARIED, "pattern": _PATTERN}} if any_plain else {}
    scenario = {
        **_SCENARIO,
        "renderer": fast,
        "variation": {"per": "frame", "materials": {**vary, "*": dict(_VARIED)}},
    }
    keys = {
        "craft": craft,
        "hours": hours,
        "workers": workers,
        "data": {"scenario": scenario, "sources": sources},
        **_DETECTORS,
        "start": _start(registry),
        "refiner": {"name": "render-compare"} if "raster" in registry.names("renderer") else None,
    }
    return recipe_of(keys, "recipe")


def _renderers(registry: Registry) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """The renderer of most frames, and one of true light beside it, if there are both."""
    installed = registry.names("renderer")
    mitsuba = {"name": "mitsuba", "spp": 16, "threads": 1}
    if "raster" in installed:
        return {"name": "raster"}, mitsuba if "mitsuba" in installed else None
    if "mitsuba" in installed:
        return mitsuba, None
    if not installed:
        raise InputError("recipe: no renderer is installed; install posse-render-raster")
    return {"name": installed[0]}, None


def _start(registry: Registry) -> str | None:
    """The spacecraft whose nets are started from, if those are installed."""
    try:
        for task in _DETECTORS:
            shipped_model(task, [_START], registry)
    except InputError:
        return None
    return _START
