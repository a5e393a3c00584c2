"""Carrying nets on with labelled images of a target domain, or with photographs with trusted poses.

The steps are as those of a recipe: done once, and gone on with where they were stopped.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from pydantic import JsonValue

from posse_core._adaptation.figures import Compared, Figures, accuracy, trusting
from posse_core._adaptation.mixture import Mixture, check_alike
from posse_core._adaptation.nets import Nets
from posse_core._adaptation.photographs import (
    LABELS,
    Photographs,
    found_file,
    look,
    read_found,
    write_trusted,
)
from posse_core._arrays import evenly_spread
from posse_core._dataset.camera import camera_record
from posse_core._dataset.images import LabelledImages
from posse_core._detection.known import target_shapes
from posse_core._detection.models import open_models
from posse_core._detection.pose_detector import PoseDetector
from posse_core._errors import InputError
from posse_core._evaluation.metrics import seen_bodies
from posse_core._files.atomic import sha256, write_json
from posse_core._files.reading import read_record
from posse_core._formats.opening import open_dataset
from posse_core._plugins.registry import Registry
from posse_core._randomness import random_generator
from posse_core._recipe.steps import Show, Steps
from posse_core._recipe.training import MODEL, export, train
from posse_core._scenario.component import ComponentChoice

BEFORE: Final = "before"
TRUSTED: Final = "trusted"
AFTER: Final = "after"
FIGURES: Final = "adaptation.json"
"""What the nets find in each photograph at first; those that they learn from; what they find then; and
the figures."""
HELD_OUT: Final = "held out"
OWN: Final = "the recipe's test part"
_SHARE_HELD_OUT: Final = 0.25
"""Of labelled images without parts, so many are not learned from."""
_OWN_FRAMES: Final = 100
"""So many frames of the recipe's test part show whether the nets have forgotten what they knew."""


@dataclass(frozen=True)
class Choice:
    """How nets are carried on.

    Attributes:
        trust: least trust of a pose that is learned from.
        share: of the target domain's images in what is learned from.
        epochs: of each training.
    """

    trust: float
    share: float
    epochs: int


@dataclass(frozen=True)
class Adaptation:
    """The carrying on of a recipe's nets in a folder.

    Attributes:
        nets: of the recipe.
        choice: how they are carried on.
        folder: for all that is made; it exists.
        registry: the installed components.
        show: shows how far it is.
    """

    nets: Nets
    choice: Choice
    folder: Path
    registry: Registry
    show: Show

    def by_photographs(self, photographs: Photographs) -> Figures:
        """Carry the nets on by those photographs in which they find a pose that is trusted.

        Raises:
            InputError: a photograph cannot be used, no pose is trusted, or the folder has steps of
                something else.
            ComponentError: a component failed.
        """
        least = self.choice.trust
        of = self._look(photographs, BEFORE, self._models(self.nets.folder))
        found = read_found(photographs, self.folder / BEFORE)
        make = partial(write_trusted, found, least, photographs.camera, self.folder / TRUSTED)
        self._do(TRUSTED, {**of, "trust": least}, f"{TRUSTED}/{LABELS}", make)
        spacecraft = self.nets.spacecraft.welded(())
        target = open_dataset(self.folder / TRUSTED / LABELS, target=spacecraft)
        learned = target.part("all")
        self.show.say(
            f"{len(learned)} of {len(found)} photographs have a pose with a trust of at least {least:g};"
            f" the nets learn from these, see {self.folder / TRUSTED}"
        )
        self._train(Mixture(self.nets.data, target, learned, self.choice.share))
        self._look(photographs, AFTER, self._models(self.folder))
        later = read_found(photographs, self.folder / AFTER)

        def make_figures() -> Figures:
            counts = trusting(list(found.values()), list(later.values()), least)
            return Figures(learned=len(learned), trusting=counts, compared=[self._own()])

        return self._figures({**of, "trust": least}, make_figures)

    def by_labelled(self, target: LabelledImages) -> Figures:
        """Carry the nets on by labelled images, of which a part is held out to measure by.

        Raises:
            InputError: the images cannot be learned from, or the folder has steps of something else.
            ComponentError: a component failed.
        """
        learned, held_out = divided(target, self.nets.recipe.seed)
        check_alike(self.nets.data, target)
        _check_labels(target, [*learned, *held_out])
        self.show.say(f"{len(learned)} images to learn from, {len(held_out)} held out")
        self._train(Mixture(self.nets.data, target, learned, self.choice.share))

        def make_figures() -> Figures:
            refiner = self.nets.recipe.refiner
            compared = [self._compared(HELD_OUT, target, held_out, refiner), self._own()]
            return Figures(learned=len(learned), trusting=None, compared=compared)

        return self._figures({"images": target.sha256}, make_figures)

    def _look(self, photographs: Photographs, name: str, models: Sequence[Path]) -> dict[str, JsonValue]:
        """Look at each photograph with some nets, and return what the result depends on."""
        of: dict[str, JsonValue] = {
            "photographs": photographs.sha256,
            "camera": camera_record(photographs.camera),
            "refiner": self.nets.recipe.model_dump(mode="json")["refiner"],
            "boxes": sha256(models[0]),
            "keypoints": sha256(models[1]),
        }

        def make() -> None:
            detector, finder = open_models(models[0], models[1], self.registry, {})
            shapes = target_shapes(self.nets.spacecraft, self.registry, self.nets.recipe.refiner)
            with contextlib.closing(PoseDetector(detector, finder, shapes=shapes)) as whole:
                look(photographs, whole, self.folder / name, self.show)

        self._do(name, of, f"{name}/{found_file(photographs.files[-1])}", make)
        return of

    def _train(self, mixture: Mixture) -> None:
        """Carry on both trainings, and export the models."""
        recipe, registry = self.nets.recipe, self.registry
        for task in recipe.nets:
            options = self.nets.options(task, self.choice.epochs, registry)
            start = {"start": sha256(self.nets.model(task))}
            of: dict[str, JsonValue] = {
                "dataset": mixture.sha256,
                "detector": recipe.nets[task].name,
                "options": {**options, **start},
            }
            made = partial(train, recipe, task, options, mixture, self.folder / task, registry)
            self._do(task, of, f"{task}/{MODEL}", made)
        for task, model in zip(recipe.nets, self._models(self.folder), strict=True):
            out = self.folder / f"{task}.onnx"
            made = partial(export, model, task, self.nets.data, out, registry)
            self._do(out.name, {"model": sha256(model)}, out.name, made)

    def _figures(self, of: dict[str, JsonValue], make: Callable[[], Figures]) -> Figures:
        """Compute the figures and write them, or read those that are there."""
        path = self.folder / FIGURES
        after: dict[str, JsonValue] = {
            model.parent.name: sha256(model) for model in self._models(self.folder)
        }

        def write() -> None:
            write_json(path, make().model_dump(mode="json"))

        self._do(FIGURES, {**of, "nets": after}, FIGURES, write)
        return read_record(path, Figures, "figures of 'posse adapt'")

    def _own(self) -> Compared:
        """Accuracy on the recipe's own frames, without refinement."""
        test = self.nets.data.part("test")
        chosen = [test[k] for k in evenly_spread(len(test), _OWN_FRAMES)]
        return self._compared(OWN, self.nets.data, chosen, None)

    def _compared(
        self,
        name: str,
        dataset: LabelledImages,
        positions: Sequence[int],
        refiner: ComponentChoice | None,
    ) -> Compared:
        """Accuracy on frames, of the recipe's nets and of those that were carried on."""
        before, after = (
            accuracy(
                dataset,
                self.show.bar(positions, len(positions), f"evaluating, {name}"),
                self._models(folder),
                self.nets.spacecraft,
                refiner,
                self.registry,
            )
            for folder in (self.nets.folder, self.folder)
        )
        return Compared(name=name, frames=len(positions), before=before, after=after)

    def _do(self, name: str, of: dict[str, JsonValue], last: str, make: Callable[[], None]) -> None:
        """Do the step that makes the file or folder of its name."""
        Steps(self.folder, self.show).do(name, of, name, last, make)

    def _models(self, folder: Path) -> list[Path]:
        return [folder / task / MODEL for task in self.nets.recipe.nets]


def divided(target: LabelledImages, seed: int) -> tuple[list[int], list[int]]:
    """Divide labelled images: positions to learn from, and positions that are held out.

    These are their own parts train and test, where both have images; otherwise a quarter of all, drawn
    at random, is held out.

    Raises:
        InputError: there is but one image.
    """
    with contextlib.suppress(InputError):  # they are in no parts, or in others
        learned, held_out = target.part("train"), target.part("test")
        if learned and held_out:
            return learned, held_out
    if len(target) < 2:
        raise InputError(
            f"{target.folder}: has one image; the nets learn from one, and another is needed to measure"
            " by"
        )
    order = random_generator(seed, -1, "adapt: held out").permutation(len(target)).tolist()
    count = max(1, round(_SHARE_HELD_OUT * len(order)))
    return sorted(order[count:]), sorted(order[:count])


def _check_labels(target: LabelledImages, positions: Sequence[int]) -> None:
    """Check that there are keypoints to learn, and poses to measure by.

    Raises:
        InputError: some are missing.
    """
    _ = target.camera  # raises if there is none
    for position in positions:
        labels = target[position]
        for body in seen_bodies(labels).values():
            if not body.has("keypoints", "q_cam_from_body"):
                raise InputError(
                    f"{target.folder}: {labels.image}: its labels have no keypoints or no pose; label it"
                    " by 'posse annotate'"
                )
