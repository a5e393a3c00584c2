"""What several processes make is what one makes, and errors stay what they are."""

from dataclasses import asdict
from functools import partial
from pathlib import Path

import cuboid
import pytest
from telling import Labels, Points

from posse_core._dataset.dataset import Dataset
from posse_core._detection.evaluate import Judge, frames_of
from posse_core._detection.groups import groups
from posse_core._detection.processes import made_by
from posse_core._errors import ComponentError, InputError
from posse_core._plugins.loading import load_plugins

pytest.importorskip("faster_coco_eval")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cuboid.write_dataset(tmp_path_factory.mktemp("d") / "d", (("brick", cuboid.HALF),))


def judge_of(folder: Path, judge: type[Judge] = Judge) -> Judge:
    dataset = Dataset(folder)
    return judge(dataset, Labels(dataset, shift_px=3), Points(dataset))


class Refusing(Judge):
    """Cannot use the labels of one frame."""

    def make(self, index):
        if index == 2:
            raise InputError("labels.jsonl: line 3: no pose")
        return super().make(index)


class Failing(Judge):
    """Fails in one frame in a way that nobody foresaw."""

    def make(self, index):
        return super().make(index) if index != 2 else 1 / 0


def by(workers, folder, judge=Judge):
    make = partial(judge_of, folder, judge)
    here = make()
    made = made_by(here, frames_of(here.dataset, "all"), make, workers, load_plugins().registry)
    return here.dataset, list(made)


def test_two_processes_judge_as_one_does(folder):
    dataset, one = by(1, folder)
    _, two = by(2, folder)
    assert [each.labels.index for each in two] == list(range(len(dataset)))
    assert [asdict(group) for group in groups(dataset, two)] == [
        asdict(group) for group in groups(dataset, one)
    ]


@pytest.mark.parametrize("workers", [1, 2])
def test_what_is_wrong_with_the_labels_is_told_as_such(workers, folder):
    with pytest.raises(InputError, match=r"line 3: no pose"):
        by(workers, folder, Refusing)


def test_a_failure_in_a_worker_names_the_image(folder):
    with pytest.raises(ComponentError, match=r"worker of image 2 failed: ZeroDivisionError"):
        by(2, folder, Failing)
