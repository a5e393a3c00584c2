"""The keys of a recipe: how a net for the pose of one spacecraft is made, from frames to models."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import Field, field_validator, model_validator

from posse_core._errors import InputError
from posse_core._plugins.options import Options
from posse_core._scenario.component import ComponentChoice, TargetChoice
from posse_core._scenario.limits import MOST_FRAMES
from posse_core._selection.rules import named

_SOURCE_NAME: Final = re.compile(r"[a-z][a-z0-9-]{0,63}")
Share = Annotated[float, Field(gt=0, lt=1)]
Part = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class TimeConfig(Options):
    """How the hours are divided. What is left is for evaluation and export."""

    frames: Share = Field(0.25, description="share of the time for making frames")
    boxes: Share = Field(0.19, description="share for training the model that finds boxes")
    keypoints: Share = Field(0.48, description="share for training the model that finds keypoints")

    @model_validator(mode="after")
    def _leave_something(self) -> TimeConfig:
        if self.frames + self.boxes + self.keypoints >= 1:
            raise ValueError("frames, boxes and keypoints leave nothing for the evaluation")
        return self


class SourceConfig(Options):
    """Frames of one sort: a run of its own."""

    share: float = Field(gt=0, description="its share of the frames, relative to the other shares")
    craft: bool = Field(
        True, description="whether the camera looks at the spacecraft, or else away from it"
    )
    set: Mapping[str, Any] = Field(
        {},
        description="keys of the scenario that differ, each as -o sets it: {renderer.spp: 16,"
        " sky.earth: false}",
    )


class DataConfig(Options):
    """The frames to learn from."""

    frames: int | None = Field(
        None, ge=10, le=MOST_FRAMES, description="number of frames; null is as many as the time allows"
    )
    apparent_size: tuple[float, float] = Field(
        (0.1, 1.2),
        description="least and largest diameter in the image of the sphere around the spacecraft, as a"
        " share of the image's height; between them its logarithm is spread evenly",
    )
    off_centre: float = Field(
        0.3,
        ge=0,
        description="largest distance of the spacecraft's origin from the image's middle, as a share of"
        " the image's height",
    )
    scenario: Mapping[str, Any] = Field(
        description="keys that the scenarios of all sources have. The target is the recipe's craft."
        " Times, relative motion, attitudes and seed are the recipe's where they are not given here"
    )
    sources: Mapping[str, SourceConfig] = Field(
        min_length=1, description="sorts of frames, by names of your own"
    )
    drop: tuple[str, ...] = Field(
        ("dark",),
        description="rules of 'posse collect' by which frames with the spacecraft are left out",
    )
    split: tuple[Part, Part, Part] = Field(
        (80.0, 10.0, 10.0), description="shares of the parts train, valid and test"
    )

    @field_validator("apparent_size")
    @classmethod
    def _in_order(cls, sizes: tuple[float, float]) -> tuple[float, float]:
        if not 0 < sizes[0] <= sizes[1]:
            raise ValueError("give the least size and then the largest, above 0")
        return sizes

    @field_validator("sources")
    @classmethod
    def _are_folders(cls, sources: Mapping[str, SourceConfig]) -> Mapping[str, SourceConfig]:
        for name in sources:
            if not _SOURCE_NAME.fullmatch(name):
                raise ValueError(
                    f"{name!r} cannot be a folder's name; take lower-case letters, digits and -"
                )
        if not any(source.craft for source in sources.values()):
            raise ValueError("no source shows the spacecraft; leave out craft: false in one")
        return sources

    @field_validator("scenario")
    @classmethod
    def _no_target(cls, scenario: Mapping[str, Any]) -> Mapping[str, Any]:
        if "target" in scenario:
            raise ValueError("the target is the recipe's craft; leave it out here")
        return scenario

    @field_validator("drop")
    @classmethod
    def _known_rules(cls, rules: tuple[str, ...]) -> tuple[str, ...]:
        try:
            named(rules)
        except InputError as error:
            raise ValueError(str(error)) from None
        return rules

    @field_validator("split")
    @classmethod
    def _train_and_test(cls, split: tuple[float, float, float]) -> tuple[float, float, float]:
        if split[0] <= 0 or split[2] <= 0 or not math.isfinite(sum(split)):
            raise ValueError("the parts train and test need a share above 0")
        return split


class Recipe(Options):
    """A net for the pose of one spacecraft: frames, models, evaluation."""

    craft: TargetChoice = Field(
        description="the spacecraft: {name: aqua}, {package: folder} or {mesh: model.stl,"
        " scale_m_per_unit: 0.01}"
    )
    hours: float | None = Field(
        None,
        gt=0,
        description="time that all may take, on this machine; null for numbers of frames and epochs that"
        " are given",
    )
    time: TimeConfig = Field(TimeConfig(), description="how the hours are divided")
    workers: int = Field(
        1, ge=1, le=1024, description="processes that make frames; threads of a training"
    )
    seed: int = Field(0, ge=0, lt=2**63, description="seed of every random draw")
    data: DataConfig = Field(description="the frames to learn from")
    boxes: ComponentChoice = Field(
        description="detector that finds boxes, and its options; without epochs, as many as the time"
        " allows"
    )
    keypoints: ComponentChoice = Field(
        description="detector that finds keypoints, and its options, likewise"
    )
    start: str | None = Field(
        None,
        description="spacecraft whose shipped nets the trainings start from, such as aqua: other craft"
        " are learned from fewer frames so; null for random weights",
    )
    refiner: ComponentChoice | None = Field(
        None,
        description="refiner of the poses in the evaluation, and its options; null for none",
    )

    @model_validator(mode="after")
    def _enough_is_given(self) -> Recipe:
        if self.hours is None:
            missing = ["data.frames"] if self.data.frames is None else []
            missing += [f"{key}.epochs" for key, choice in self.nets.items() if not _epochs(choice)]
            if missing:
                raise ValueError(f"give hours, or {' and '.join(missing)}")
        return self

    @property
    def nets(self) -> Mapping[str, ComponentChoice]:
        """The detectors by their tasks, in the order of their training."""
        return {"boxes": self.boxes, "keypoints": self.keypoints}

    @property
    def is_timed(self) -> bool:
        """Whether a number of frames or epochs follows from the time."""
        return self.data.frames is None or not all(map(_epochs, self.nets.values()))


def _epochs(choice: ComponentChoice) -> bool:
    return choice.options.get("epochs") is not None
