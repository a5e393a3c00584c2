"""How many frames and epochs fit into a recipe's time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field

from posse_core._files.reading import FileRecord
from posse_core._recipe.model import Recipe

LEAST_FRAMES: Final = 40
LEAST_EPOCHS: Final = 12
"""Frames are not so many that they would be learned from less often than this, where time is short, and
a machine that becomes slower does not make it less."""
_RESERVE: Final = 0.92
"""Share of the time that is planned for: a machine that others use too is slower than when measured."""

Seconds = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=1)]


@dataclass(frozen=True)
class Learning:
    """How fast a net learns.

    Attributes:
        prepared_s: time to prepare a picture, once for all epochs.
        picture_s: time to learn from a picture once, above 0.
    """

    prepared_s: float
    picture_s: float

    def training_s(self, pictures: float, epochs: int) -> float:
        """How long a training takes."""
        return pictures * (self.prepared_s + self.picture_s * epochs)

    def epochs_in(self, pictures: float, seconds: float) -> int:
        """The most epochs of a training that takes no longer, or less than 1 if there are none."""
        return math.floor((seconds / max(pictures, 1.0) - self.prepared_s) / self.picture_s)


@dataclass(frozen=True)
class Speeds:
    """What a probe measured.

    Attributes:
        frame_s: source → time from one frame to the next, of all workers together.
        opening_s: source → time until the first frame.
        learning: task → how fast its net learns.
        spent_s: that the probe itself took.
    """

    frame_s: Mapping[str, float]
    opening_s: Mapping[str, float]
    learning: Mapping[str, Learning]
    spent_s: float


class Decision(FileRecord):
    """How many frames are made, and how often each is likely to be learned from.

    Attributes:
        frames: source → number of its frames.
        epochs: task → number of epochs; where the time gives them, :func:`epochs_in_time` corrects them
            when the training begins.
        expected_s: step → how long it is expected to take; empty if nothing was measured.
        measured_s: what else was measured, by name.
    """

    frames: dict[str, Count]
    epochs: dict[str, Count]
    expected_s: dict[str, Seconds]
    measured_s: dict[str, Seconds]

    def learning(self, task: str) -> Learning | None:
        """How fast a net learns, by the probe; None if that was not measured."""
        if _a_picture_for(task) not in self.measured_s:
            return None
        # A decision of an earlier version does not tell this.
        prepared_s = self.measured_s.get(_preparing_for(task), 0.0)
        return Learning(prepared_s, max(self.measured_s[_a_picture_for(task)], 1e-6))


def decide(recipe: Recipe, speeds: Speeds | None) -> Decision:
    """Return the numbers that a recipe gives, and those that follow from its time.

    Args:
        recipe: with hours, where it does not give all numbers.
        speeds: None where the recipe gives all numbers.
    """
    if speeds is None:
        assert recipe.data.frames is not None  # as the recipe was checked for
        given = {task: int(choice.options["epochs"]) for task, choice in recipe.nets.items()}
        frames = divided(recipe, recipe.data.frames)
        return Decision(frames=frames, epochs=given, expected_s={}, measured_s={})
    assert recipe.hours is not None
    total_s = max(_RESERVE * 3600 * recipe.hours - speeds.spent_s, 1.0)
    shares, time = _shares(recipe), recipe.time
    frame_s = sum(share * speeds.frame_s[name] for name, share in shares.items())
    opening_s = sum(speeds.opening_s.values())
    training = sum(recipe.data.split[:2]) / sum(recipe.data.split)  # with the valid part
    shown = sum(share for name, share in shares.items() if recipe.data.sources[name].craft)
    # Pictures per frame and epoch: boxes are learned from all frames, keypoints where there are some.
    pictures = {"boxes": training, "keypoints": training * shown}
    count = recipe.data.frames
    if count is None:
        by_making = (time.frames * total_s - opening_s) / frame_s
        least_s = sum(
            speeds.learning[task].training_s(pictures[task], LEAST_EPOCHS) for task in recipe.nets
        )
        by_learning = (time.boxes + time.keypoints) * total_s / least_s
        count = max(LEAST_FRAMES, int(min(by_making, by_learning)))
    data_s = opening_s + count * frame_s
    left_s = (time.frames + time.boxes + time.keypoints) * total_s - data_s
    epochs, expected_s = {}, {"frames": data_s}
    for task, share in (("boxes", time.boxes), ("keypoints", time.keypoints)):
        learning, shown_to = speeds.learning[task], count * pictures[task]
        mine_s = left_s * share / (time.boxes + time.keypoints)
        given_epochs = recipe.nets[task].options.get("epochs")
        fitting = max(1, learning.epochs_in(shown_to, mine_s))
        epochs[task] = fitting if given_epochs is None else int(given_epochs)
        expected_s[task] = learning.training_s(shown_to, epochs[task])
    expected_s["evaluation"] = total_s * (1 - time.frames - time.boxes - time.keypoints)
    return Decision(
        frames=divided(recipe, count),
        epochs=epochs,
        expected_s={step: round(seconds, 1) for step, seconds in expected_s.items()},
        measured_s={
            **{f"a frame of {name}": round(x, 4) for name, x in speeds.frame_s.items()},
            **{f"before the first frame of {name}": round(x, 2) for name, x in speeds.opening_s.items()},
            **{_preparing_for(task): round(x.prepared_s, 6) for task, x in speeds.learning.items()},
            **{_a_picture_for(task): round(x.picture_s, 6) for task, x in speeds.learning.items()},
            "this probe": round(speeds.spent_s, 1),
        },
    )


def epochs_in_time(
    recipe: Recipe, decision: Decision, task: str, learning: Learning, pictures: int, spent_s: float
) -> int:
    """Return how many epochs of a training fit into what is left of the time, and at least a dozen, or
    those that were decided if they are fewer: a model that has hardly learned is of no use in time.

    Args:
        recipe: with hours.
        decision: that was made for it.
        task: of the training.
        learning: how fast the net learns on the machine as it is now.
        pictures: that are learned from or measured by.
        spent_s: time that all steps before the training took.
    """
    assert recipe.hours is not None
    left_s = _RESERVE * 3600 * recipe.hours - spent_s
    time = recipe.time
    shares = {"boxes": time.boxes, "keypoints": time.keypoints}
    later = 1 - time.frames - (time.boxes if task == "keypoints" else 0.0)
    least = min(LEAST_EPOCHS, decision.epochs[task])
    return max(least, learning.epochs_in(pictures, left_s * shares[task] / later))


def _preparing_for(task: str) -> str:
    return f"preparing a picture for {task}"


def _a_picture_for(task: str) -> str:
    return f"a picture for {task}"


def divided(recipe: Recipe, count: int) -> dict[str, int]:
    """Divide a number of frames among the sources by their shares: source → its frames.

    Each is within one frame of its share (largest remainders) and has at least one.
    """
    shares = {name: share * count for name, share in _shares(recipe).items()}
    frames = {name: math.floor(exact) for name, exact in shares.items()}
    by_remainder = sorted(shares, key=lambda name: frames[name] - shares[name])
    for name in by_remainder[: count - sum(frames.values())]:
        frames[name] += 1
    return {name: max(1, own) for name, own in frames.items()}


def _shares(recipe: Recipe) -> dict[str, float]:
    """Source → its share, with the sum 1."""
    total = sum(source.share for source in recipe.data.sources.values())
    return {name: source.share / total for name, source in recipe.data.sources.items()}
