"""Batches of samples, prepared in the background while the network learns from those before."""

from __future__ import annotations

import multiprocessing
import warnings
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from types import TracebackType
from typing import Protocol

import cv2
import numpy as np
import torch
from torch import Tensor

from posse_core import random_generator
from posse_detect_torch.options import TrainOptions

Batch = Mapping[str, Tensor]
Arrays = dict[str, np.ndarray]


class Sampled(Protocol):
    """What batches are made of."""

    options: TrainOptions

    def __len__(self) -> int: ...

    def sample(self, position: int, random: np.random.Generator) -> Arrays: ...


class Batches:
    """Prepares the batches of each epoch, as many at a time as the options have threads.

    Threads do so, or processes where the network learns on another device than the processor: there
    pictures are needed faster than the threads of one Python program can prepare them. The batches are
    the same either way. Systems that cannot fork have threads alone.

    Args:
        lesson: what is sampled. Processes keep it as it is when they start.
        in_processes: whether the workers are processes.
    """

    def __init__(self, lesson: Sampled, *, in_processes: bool) -> None:
        self._lesson = lesson
        threads = lesson.options.threads
        self._pool: Executor
        if in_processes and "fork" in multiprocessing.get_all_start_methods():
            # What forks is not pickled, so pictures that are mapped from files stay in memory once.
            context = multiprocessing.get_context("fork")
            self._pool = ProcessPoolExecutor(threads, context, initializer=_begin, initargs=(lesson,))
            self._prepare = _prepare_in_process
            with warnings.catch_warnings():
                # Python 3.12 warns of forks beside threads. The workers call NumPy and OpenCV alone.
                warnings.simplefilter("ignore", DeprecationWarning)
                self._pool.submit(int).result()
        else:
            self._pool = ThreadPoolExecutor(threads)
            self._prepare = partial(_prepare, lesson)

    def __enter__(self) -> Batches:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pool.shutdown(cancel_futures=True)

    def of_epoch(self, epoch: int) -> Iterator[Batch]:
        """Yield the batches of an epoch, counted from 0, in its random order."""
        options, count = self._lesson.options, len(self._lesson)
        order = random_generator(options.seed, epoch, "order").permutation(count).tolist()
        groups = deque(order[i : i + options.batch] for i in range(0, count, options.batch))
        coming: deque[Future[Arrays]] = deque()
        while groups or coming:
            while groups and len(coming) <= options.threads:
                coming.append(self._pool.submit(self._prepare, epoch, groups.popleft()))
            yield {key: torch.from_numpy(array) for key, array in coming.popleft().result().items()}


def _prepare(lesson: Sampled, epoch: int, positions: Sequence[int]) -> Arrays:
    """Return the samples at positions, stacked."""
    first = epoch * len(lesson)
    samples = [
        lesson.sample(position, random_generator(lesson.options.seed, first + position, "augmentation"))
        for position in positions
    ]
    return {key: np.stack([sample[key] for sample in samples]) for key in samples[0]}


_lessons: list[Sampled] = []
"""The lesson of a worker process."""


def _begin(lesson: Sampled) -> None:
    # OpenCV's threads do not survive a fork: without them it computes, while with 1 it waits for them.
    cv2.setNumThreads(0)
    _lessons.append(lesson)


def _prepare_in_process(epoch: int, positions: Sequence[int]) -> Arrays:
    return _prepare(_lessons[0], epoch, positions)
