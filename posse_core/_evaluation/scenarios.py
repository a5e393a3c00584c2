"""The scenarios that a dataset was made from: its own, or those of the datasets that were joined."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import SCENARIO, inside
from posse_core._errors import ComponentError, InputError
from posse_core._evaluation.photometry import base_colour
from posse_core._model.label_line import LabelLine
from posse_core._model.scene import Scene
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._scenario.model import Scenario
from posse_core._scenario.sensor import SensorConfig
from posse_core._simulator.scene import scene_of


class Scenarios:
    """The scenario of each frame of a dataset, read when it is asked for."""

    def __init__(self, dataset: Dataset) -> None:
        self._dataset = dataset
        self._read: dict[str, Scenario | None] = {}
        self._scenes: dict[int, Scene | None] = {}
        self._colours: dict[int, tuple[FloatArray, ...]] = {}
        self.faults: list[str] = []

    @cached_property
    def own(self) -> Scenario | None:
        """The scenario of the dataset as a whole; None if it was joined from others, or has none."""
        return self._scenario(SCENARIO)

    @cached_property
    def own_scene(self) -> Scene | None:
        """What the scenario of the dataset as a whole builds, likewise."""
        return None if self.own is None else self._scene(self.own)

    def of(self, labels: LabelLine) -> Scenario | None:
        """The scenario of a frame; None if there is none, or it cannot be read here (see ``faults``)."""
        if not labels.has("origin"):
            return self.own
        for source in self._dataset.manifest.sources or ():
            if source.dataset == labels.origin[0] and source.scenario is not None:
                return self._scenario(source.scenario)
        return None

    def sensor(self, labels: LabelLine) -> SensorConfig | None:
        """The image sensor of a frame, likewise."""
        scenario = self.of(labels)
        return None if scenario is None else scenario.sensor

    def scene(self, labels: LabelLine) -> Scene | None:
        """What the scenario of a frame builds, likewise."""
        scenario = self.of(labels)
        return None if scenario is None else self._scene(scenario)

    def _scene(self, scenario: Scenario) -> Scene | None:
        if id(scenario) not in self._scenes:
            self._scenes[id(scenario)] = self._built(scenario)
        return self._scenes[id(scenario)]

    def base_colours(self, labels: LabelLine) -> Sequence[FloatArray]:
        """(3,) mean reflectance of each part of the scene; empty where it is not known."""
        scene = self.scene(labels)
        if scene is None:
            return ()
        if id(scene) not in self._colours:
            self._colours[id(scene)] = tuple(base_colour(piece.material) for piece in scene.pieces)
        return self._colours[id(scene)]

    def _built(self, scenario: Scenario) -> Scene | None:
        try:
            return scene_of(scenario, load_plugins().registry)
        except (InputError, ComponentError) as error:
            self.faults.append(str(error))
            return None

    def _scenario(self, name: str) -> Scenario | None:
        if name not in self._read:
            self._read[name] = self._load(inside(self._dataset.folder, name))
        return self._read[name]

    def _load(self, path: Path) -> Scenario | None:
        if not path.is_file():
            return None
        try:
            return load_scenario(str(path), load_plugins().registry)
        except InputError as error:
            self.faults.append(str(error))
            return None
