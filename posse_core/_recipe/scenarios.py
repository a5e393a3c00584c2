"""The scenarios of a recipe: where the camera stands and looks, and when."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.remarks import ECLIPSE_DISC_SHARE
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.registry import Registry
from posse_core._randomness import derived_seed, random_generator
from posse_core._recipe.model import Recipe, SourceConfig
from posse_core._scenario.component import create
from posse_core._scenario.load import load_scenario
from posse_core._scenario.model import Scenario
from posse_core._simulator.returned import built
from posse_core._trajectory.build import make_trajectory

CRAFT: Final = "craft"
"""Folder of the package that a recipe's mesh is imported into."""
LEAST_KEYPOINTS: Final = 4
_WINDOW_S: Final = 86400.0
"""Frames are taken in so long a time after the epoch. The Earth turns once; in much more, the clouds'
winds, which differ by latitude, would draw them out into bands."""
_NEAREST: Final = 1.1
"""Least distance, in radii of the sphere around the spacecraft: outside of it."""
_CLEAR_RAD: Final = math.radians(2)
"""Angle that is kept between the spacecraft and the border of an image that does not show it."""
_LEAST_SUNLIT: Final = 0.05
"""Share of random instants in the Sun's light below which an orbit is refused."""


@dataclass(frozen=True)
class Scenarios:
    """The scenarios of a recipe's sources, with any number of frames.

    Attributes:
        recipe: whose they are.
        folder: of the recipe, which its paths are relative to.
        registry: the installed components.
        spacecraft: that the recipe is for.
        camera: of all sources.
    """

    recipe: Recipe
    folder: Path
    registry: Registry
    spacecraft: Spacecraft
    camera: Camera

    @classmethod
    def of(cls, recipe: Recipe, folder: Path, registry: Registry) -> Scenarios:
        """Build the spacecraft and check all scenarios.

        Raises:
            InputError: a key is wrong, the spacecraft cannot be used or has too few keypoints, the
                sources have different cameras, or a size or place in the image is impossible.
        """
        spacecraft = spacecraft_of(recipe, folder, registry)
        if len(spacecraft.keypoints_body_m) < LEAST_KEYPOINTS:
            raise InputError(
                f"craft: {spacecraft.name} has {len(spacecraft.keypoints_body_m)} keypoints, and a pose"
                f" needs {LEAST_KEYPOINTS}; 'posse import MODEL' proposes some"
            )
        camera = _first(recipe, folder, registry).camera.camera()
        found = cls(recipe, folder, registry, spacecraft, camera)
        for name in recipe.data.sources:
            camera = found._scenario(name, np.zeros(1)).camera.camera()
            if camera != found.camera:
                raise InputError(
                    f"data.sources.{name}.set: its camera is another one; the frames of a dataset have"
                    " one camera"
                )
        return found

    def scenario(self, name: str, frames: int) -> Scenario:
        """Return the scenario of a source with so many frames, all in sunlight."""
        given = self._scenario(name, np.zeros(1))
        if "times" in self._given(name):
            return given.model_copy(update={"frames": frames})
        random = random_generator(given.seed, -1, "recipe: times")
        kept: list[FloatArray] = []
        tried = 0
        while sum(map(len, kept)) < frames:
            t_s = np.round(random.uniform(0, _WINDOW_S, max(2 * frames, 100)), 3)
            kept.append(t_s[self._is_sunlit(name, t_s)])
            tried += len(t_s)
            if sum(map(len, kept)) < _LEAST_SUNLIT * tried:
                raise InputError(
                    "data.scenario.orbit: is hardly ever in the Sun's light; choose another orbit"
                )
        return self._scenario(name, np.concatenate(kept)[:frames])

    @property
    def radius_m(self) -> float:
        """Of the sphere around the spacecraft."""
        return self.spacecraft.radius_m

    @property
    def ranges_m(self) -> tuple[float, float]:
        """Least and largest distance of the camera, by the apparent sizes.

        The apparent size of a sphere of radius R at the distance d is 2 R f / d pixels: that of a disc
        in its middle.
        """
        smallest, largest = self.recipe.data.apparent_size
        at_one_m = 2 * self.radius_m * self.camera.fy_px / self.camera.height_px
        nearest_m, farthest_m = at_one_m / largest, at_one_m / smallest
        if nearest_m < _NEAREST * self.radius_m:
            most = at_one_m / (_NEAREST * self.radius_m)
            raise InputError(
                f"data.apparent_size: {largest:g} puts the camera {nearest_m:.3g} m from the middle of a"
                f" spacecraft with a radius of {self.radius_m:.3g} m; give at most {most:.2f}, or a"
                " smaller field of view"
            )
        return nearest_m, farthest_m

    def _off_axis_deg(self, source: SourceConfig) -> list[float]:
        """Least and largest angle between the boresight and the spacecraft."""
        camera = self.camera
        if source.craft:
            away_px = self.recipe.data.off_centre * camera.height_px
            return [0.0, math.degrees(math.atan(away_px / camera.fy_px))]
        rays = camera.rays(camera.border_px())
        farthest = float(np.arccos(rays[:, 2] / np.linalg.norm(rays, axis=-1)).max())
        nearest_m, _ = self.ranges_m
        least = farthest + math.asin(self.radius_m / nearest_m) + _CLEAR_RAD
        if least >= math.pi:
            raise InputError(
                "data.sources: this camera sees the spacecraft wherever it looks; leave out the sources"
                " with craft: false"
            )
        return [math.degrees(least), 180.0]

    def _given(self, name: str) -> set[str]:
        """The top keys that the user's scenario gives for a source."""
        steps = {key.split(".")[0] for key in self.recipe.data.sources[name].set}
        return {*self.recipe.data.scenario, *steps}

    def _scenario(self, name: str, t_s: FloatArray) -> Scenario:
        """The scenario of a source at times (F,)."""
        recipe, source = self.recipe, self.recipe.data.sources[name]
        design = {
            "name": "view-sphere",
            "range_m": [float(f"{x:.6g}") for x in self.ranges_m],
            "range_law": "logarithmic",
        }
        pointing = {"law": "random-pointing", "off_axis_deg": self._off_axis_deg(source)}
        keys = {
            "times": {"t_s": t_s.tolist()},
            "relative": {"design": design},
            "attitude": {"camera": pointing},
            "seed": derived_seed(recipe.seed, -1, f"recipe: {name}"),
        }
        try:
            return _checked(recipe, self.folder, self.registry, keys, source.set)
        except InputError as error:
            raise InputError(f"data.sources.{name}: {error}") from None

    def _is_sunlit(self, name: str, t_s: FloatArray) -> FloatArray:
        trajectory = make_trajectory(self._scenario(name, t_s), self.registry)
        return np.asarray(trajectory.sun_fraction_target >= ECLIPSE_DISC_SHARE)


def spacecraft_of(recipe: Recipe, folder: Path, registry: Registry) -> Spacecraft:
    """Build the spacecraft of a recipe.

    Args:
        recipe: whose it is.
        folder: of the recipe.
        registry: the installed components.

    Raises:
        InputError: a key is wrong, or the spacecraft cannot be used.
    """
    target = _first(recipe, folder, registry).target
    return built(create(registry, "scene", target), target.name)


def _first(recipe: Recipe, folder: Path, registry: Registry) -> Scenario:
    """The scenario that all sources have, at one time."""
    return _checked(recipe, folder, registry, {"times": {"t_s": [0.0]}}, {})


def _checked(
    recipe: Recipe,
    folder: Path,
    registry: Registry,
    derived: Mapping[str, Any],
    overrides: Mapping[str, Any],
) -> Scenario:
    """A scenario with keys that the recipe derives, where it gives none itself."""
    given = recipe.data.scenario
    attitude = given.get("attitude", {})
    if isinstance(attitude, Mapping):  # any other value is refused below, by its key
        attitude = {**derived.get("attitude", {}), **attitude}
    imported = recipe.craft.name == "mesh"
    target: Any = {"package": CRAFT} if imported else recipe.craft.model_dump(mode="json")
    keys = {**derived, **given, "attitude": attitude, "target": target}
    return load_scenario(keys, registry, overrides, base=folder, name="data.scenario")
