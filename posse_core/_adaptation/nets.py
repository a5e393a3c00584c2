"""The nets of a recipe that was followed to its end, and what they were made with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import PARTITION_FILE
from posse_core._errors import InputError
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.registry import Registry
from posse_core._recipe.data import DATA
from posse_core._recipe.file import RECIPE, read_recipe
from posse_core._recipe.model import Recipe
from posse_core._recipe.scenarios import spacecraft_of
from posse_core._recipe.training import MODEL, check_nets, options_for

_SLOWER: Final = 0.2
"""The learning rate as a share of the recipe's: what the nets know is to be corrected, not replaced."""


@dataclass(frozen=True)
class Nets:
    """The nets of a recipe.

    Attributes:
        recipe: that they were made by.
        folder: of the recipe.
        spacecraft: that they know.
        data: the frames that they have learned from, in parts.
    """

    recipe: Recipe
    folder: Path
    spacecraft: Spacecraft
    data: Dataset

    @classmethod
    def of(cls, folder: Path, registry: Registry) -> Nets:
        """Open the folder of a recipe.

        Raises:
            InputError: it is none, or the recipe has not been followed to its end.
        """
        if not (folder / RECIPE).is_file():
            raise InputError(f"{folder}: holds no {RECIPE}; give the folder of 'posse recipe'")
        recipe = read_recipe(folder / RECIPE)
        needed = [f"{DATA}/{PARTITION_FILE}", *(f"{task}/{MODEL}" for task in recipe.nets)]
        for name in needed:
            if not (folder / name).is_file():
                raise InputError(
                    f"{folder / name}: is not there; end the recipe by 'posse recipe {folder / RECIPE}'"
                )
        check_nets(recipe, registry)
        spacecraft = spacecraft_of(recipe, folder, registry)
        return cls(recipe, folder, spacecraft, Dataset(folder / DATA))

    def model(self, task: str) -> Path:
        """The model file of a task."""
        return self.folder / task / MODEL

    def options(self, task: str, epochs: int, registry: Registry) -> dict[str, Any]:
        """The options by which the training of a task is carried on.

        Raises:
            InputError: the detector cannot start from a model.
        """
        name = self.recipe.nets[task].name
        known = registry.options_model("detector", name).model_fields
        if "start" not in known:
            raise InputError(
                f"{task}: the detector {name!r} has no option 'start', so its training cannot be"
                " carried on"
            )
        options = options_for(self.recipe, task, epochs, registry)
        carried: dict[str, Any] = {"start": str(self.model(task)), "epochs": epochs}
        if "learning_rate" in known:
            own = options.get("learning_rate", known["learning_rate"].default)
            carried["learning_rate"] = _SLOWER * own
        return {**options, **{key: value for key, value in carried.items() if key in known}}
