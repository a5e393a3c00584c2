"""A trial tells what a picture takes to learn from, whatever else a training takes."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cuboid
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_recipe import KEYS

from posse_core._dataset.dataset import Dataset
from posse_core._plugins.loading import load_plugins
from posse_core._recipe import probe
from posse_core._recipe.budget import Learning
from posse_core._recipe.file import recipe_of
from posse_core._recipe.training import pictures_for
from posse_core._selection.partition import write_partition


class Machine:
    """A clock, and a training by it."""

    def __init__(self, once_s: float, epoch_s: float, prepared_s: float, picture_s: float) -> None:
        self.once_s, self.epoch_s = once_s, epoch_s
        self.prepared_s, self.picture_s = prepared_s, picture_s
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def train(
        self,
        recipe: Any,
        task: str,
        options: Mapping[str, Any],
        dataset: Dataset,
        folder: Path,
        registry: Any,
    ) -> None:
        folder.mkdir(parents=True)
        print("epoch 1", file=sys.stderr)
        pictures = len(pictures_for(task, dataset))
        evaluated = len(dataset.part("valid"))
        epoch_s = self.epoch_s + pictures * self.picture_s + 0.5 * evaluated
        self.now_s += self.once_s + pictures * self.prepared_s + options["epochs"] * epoch_s


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    """Sixty frames, of which fifty show a spacecraft."""
    folder = tmp_path_factory.mktemp("data") / "d"
    cuboid.write_dataset(folder, tuple((f"brick-{i}", cuboid.HALF) for i in range(10)))
    write_partition(Dataset(folder), (70.0, 30.0, 0.0), 1, "frame")
    return folder


@given(
    once_s=st.floats(0, 10),
    epoch_s=st.floats(0, 1),
    prepared_s=st.floats(0, 1),
    picture_s=st.floats(1e-2, 1),
    task=st.sampled_from(["boxes", "keypoints"]),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=25)
def test_what_happens_once_or_once_an_epoch_is_left_out(
    data: Path,
    tmp_path: Path,
    capsys: Any,
    once_s: float,
    epoch_s: float,
    prepared_s: float,
    picture_s: float,
    task: str,
) -> None:
    nets = {task: {"name": "nano" if task == "boxes" else "heatmap"} for task in ("boxes", "keypoints")}
    recipe = recipe_of({**KEYS, "hours": 1.0, **nets}, "recipe")
    machine = Machine(once_s, epoch_s, prepared_s, picture_s)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(probe, "time", machine)
        patch.setattr(probe, "train", machine.train)
        told = probe.learning_of(recipe, task, data, tmp_path, load_plugins().registry)
    # Of a training of which pictures are the least part, a share of the mean is taken.
    assert len(Dataset(data).part("valid")) > 16
    pictures = len(pictures_for(task, probe._Excerpt(data, 144)))
    mean_s = picture_s + prepared_s / 6 + (0.5 * 16 + epoch_s + once_s / 6) / pictures
    assert told.picture_s == pytest.approx(max(picture_s, 0.3 * mean_s), rel=0.02)
    # What is told of both together is what they take.
    both_s = prepared_s + picture_s
    assert told.prepared_s == pytest.approx(max(both_s - told.picture_s, 0), abs=1e-6)
    assert not (tmp_path / ".trial").exists()
    assert capsys.readouterr() == ("", "")  # a user would take it for the training to come


@pytest.mark.parametrize(
    ("trials_s", "before_s", "expected_s", "left"),
    [
        ([1.0, 9.0], 1.0, 1.0, 1),
        ([2.0, 1.1], 1.0, 1.1, 0),  # interrupted once
        ([2.0, 2.2], 1.0, 2.0, 0),  # slower now
        ([2.0, 1.0], None, 2.0, 1),
    ],
)
def test_a_trial_that_was_interrupted_is_made_again(
    trials_s: list[float], before_s: float | None, expected_s: float, left: int
) -> None:
    trials = list(trials_s)
    before = None if before_s is None else Learning(0.0, before_s)
    told = probe.steady(lambda: Learning(0.5, trials.pop(0)), before)
    assert told == Learning(0.5, expected_s)
    assert len(trials) == left
