"""Batches are the same whoever prepares them."""

import multiprocessing
import os
import subprocess
import sys

import numpy as np
import pytest

from posse_detect_torch.batches import Batches
from posse_detect_torch.options import TrainOptions

forks = pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(),
    reason="where a system cannot fork, batches are prepared by threads alone",
)


class Draws:
    """Samples of nothing but their place, a random number and the process that drew it."""

    def __init__(self, count: int, options: TrainOptions) -> None:
        self.options = options
        self._count = count

    def __len__(self) -> int:
        return self._count

    def sample(self, position: int, random: np.random.Generator) -> dict[str, np.ndarray]:
        drawn = np.float64(random.uniform())
        return {"position": np.int64(position), "drawn": drawn, "by": np.int64(os.getpid())}


def epochs(lesson: Draws, *, in_processes: bool) -> list[list[dict[str, list]]]:
    with Batches(lesson, in_processes=in_processes) as batches:
        return [
            [
                {key: values.tolist() for key, values in batch.items()}
                for batch in batches.of_epoch(epoch)
            ]
            for epoch in range(3)
        ]


def of(found: list[list[dict[str, list]]], key: str) -> list[list[list]]:
    return [[batch[key] for batch in batches] for batches in found]


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize(("count", "batch"), [(37, 8), (1, 4), (16, 4)])
def test_an_epoch_has_each_sample_once_in_an_order_of_its_own(count, batch, threads):
    found = epochs(Draws(count, TrainOptions(batch=batch, threads=threads)), in_processes=False)
    for batches in of(found, "position"):
        assert [len(positions) for positions in batches[:-1]] == [batch] * (len(batches) - 1)
        assert sorted(position for positions in batches for position in positions) == list(range(count))
    drawn = [number for batches in of(found, "drawn") for numbers in batches for number in numbers]
    assert len(set(drawn)) == 3 * count
    if count > 1:
        assert of(found, "position")[0] != of(found, "position")[1]


@forks
def test_processes_and_any_number_of_threads_prepare_the_same():
    alone = epochs(Draws(37, TrainOptions(batch=8, threads=1)), in_processes=False)
    for lesson, in_processes in [
        (Draws(37, TrainOptions(batch=8, threads=3)), False),
        (Draws(37, TrainOptions(batch=8, threads=1)), True),
        (Draws(37, TrainOptions(batch=8, threads=3)), True),
    ]:
        found = epochs(lesson, in_processes=in_processes)
        assert of(found, "position") == of(alone, "position")
        assert of(found, "drawn") == of(alone, "drawn")
        own = {pid for batches in of(found, "by") for by in batches for pid in by} == {os.getpid()}
        assert own != in_processes


@forks
def test_processes_compute_by_opencv_though_its_threads_are_left_behind():
    """A program that has used sixteen threads of OpenCV, as pictures are cut, once waited for ever."""
    program = """
import cv2, numpy as np
from concurrent.futures import ThreadPoolExecutor
from posse_detect_torch.batches import Batches
from posse_detect_torch.options import TrainOptions

picture = np.ones((480, 640), np.float32)

class Turns:
    options = TrainOptions(batch=2, threads=2)
    def __len__(self): return 8
    def sample(self, position, random):
        return {"picture": cv2.warpAffine(picture, np.eye(2, 3), (640, 480))}

cv2.setNumThreads(16)
with ThreadPoolExecutor(8) as pool:
    list(pool.map(lambda i: Turns().sample(i, None), range(200)))
with Batches(Turns(), in_processes=True) as batches:
    print(sum(len(batch["picture"]) for batch in batches.of_epoch(0)))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.stdout.strip() == "8", done.stderr


def test_an_epoch_that_is_left_early_begins_anew():
    with Batches(Draws(40, TrainOptions(batch=8, threads=2)), in_processes=False) as batches:
        first = next(iter(batches.of_epoch(0)))
        assert next(iter(batches.of_epoch(0)))["drawn"].equal(first["drawn"])


def test_a_sample_that_fails_fails_the_training():
    class Broken(Draws):
        def sample(self, position: int, random: np.random.Generator) -> dict[str, np.ndarray]:
            raise ValueError("no such picture")

    for in_processes in (False, True):
        with (
            Batches(Broken(4, TrainOptions(batch=2)), in_processes=in_processes) as batches,
            pytest.raises(ValueError, match="no such picture"),
        ):
            list(batches.of_epoch(0))
