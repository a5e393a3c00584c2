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
from posse_core._recipe.file import recipe_of
from posse_core._recipe.training import pictures_for
from posse_core._selection.partition import write_partition


class Machine:
    """A clock, and a training by it."""

    def __init__(self, once_s: float, epoch_s: float, picture_s: float) -> None:
        self.once_s, self.epoch_s, self.picture_s = once_s, epoch_s, picture_s
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
        self.now_s += self.once_s + options["epochs"] * epoch_s


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
    picture_s=st.floats(1e-2, 1),
    task=st.sampled_from(["boxes", "keypoints"]),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=25)
def test_what_happens_once_or_once_an_epoch_is_left_out(
    data: Path, tmp_path: Path, capsys: Any, once_s: float, epoch_s: float, picture_s: float, task: str
) -> None:
    nets = {task: {"name": "nano" if task == "boxes" else "heatmap"} for task in ("boxes", "keypoints")}
    recipe = recipe_of({**KEYS, "hours": 1.0, **nets}, "recipe")
    machine = Machine(once_s, epoch_s, picture_s)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(probe, "time", machine)
        patch.setattr(probe, "train", machine.train)
        told_s = probe.learning_s(recipe, task, data, tmp_path, load_plugins().registry)
    # Of a training of which pictures are the least part, a share of the mean is taken.
    assert len(Dataset(data).part("valid")) > 16
    pictures = len(pictures_for(task, probe._Excerpt(data, 144)))
    mean_s = picture_s + (0.5 * 16 + epoch_s + once_s / 5) / pictures
    assert told_s == pytest.approx(max(picture_s, 0.3 * mean_s), rel=0.02)
    assert not (tmp_path / ".trial").exists()
    assert capsys.readouterr() == ("", "")  # a user would take it for the training to come
