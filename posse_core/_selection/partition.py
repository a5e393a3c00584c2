"""Partition of a dataset into parts for training, validation and test (thesis, Section 3.5.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from posse_core._arrays import IntArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import PARTITION_FILE, PARTS
from posse_core._errors import InputError
from posse_core._files.atomic import atomic_folder, write_json
from posse_core._files.text import write_csv
from posse_core._formats.needs import labels_with
from posse_core._formats.thesis import NEEDS_POSE, POSE_COLUMNS, camera_pose
from posse_core._model.label_line import LabelLine
from posse_core._randomness import random_generator

By = Literal["frame", "sequence"]


def partition(
    indices: IntArray, sequences: IntArray, shares: Sequence[float], seed: int, by: By
) -> dict[str, list[int]]:
    """Divide frames at random; the same arguments give the same parts.

    Args:
        indices: (F,) of the frames.
        sequences: (F,) number of the continuous motion that each frame belongs to.
        shares: of train, valid and test, which are normalised by their sum.
        seed: of the random order.
        by: ``frame`` shuffles frames; ``sequence`` shuffles sequences and keeps each within one part,
            so that the test part has no frames that are similar to training frames.

    Returns:
        Part → ascending indices. By frame, sizes are within one frame of the shares. By sequence, each
        sequence goes to the part that is furthest below its share.
    """
    random = random_generator(seed, -1, "partition")
    wanted = np.array(shares) / np.sum(shares) * len(indices)
    if by == "frame":
        cuts = np.round(np.cumsum(wanted)).astype(int)[:-1]
        chosen = np.split(random.permutation(indices), cuts)
    else:
        groups: list[list[IntArray]] = [[] for _ in PARTS]
        have = np.zeros(len(PARTS))
        for sequence in random.permutation(np.unique(sequences)):
            members = indices[sequences == sequence]
            part = int(
                np.argmin(np.divide(have, wanted, where=wanted > 0, out=np.full_like(have, np.inf)))
            )
            groups[part].append(members)
            have[part] += len(members)
        chosen = [np.concatenate([*group, np.empty(0, dtype=np.int64)]) for group in groups]
    return {part: np.sort(members).tolist() for part, members in zip(PARTS, chosen, strict=True)}


def write_partition(
    dataset: Dataset, shares: Sequence[float], seed: int, by: By
) -> dict[str, list[int]]:
    """Divide a dataset and write ``partition/`` with the indices and the thesis' six lists.

    ``{train,valid,test}_images.csv`` have the names of images, ``..._pose.csv`` the camera's poses.

    Returns:
        Part → ascending indices.

    Raises:
        InputError: There are fewer sequences than parts with a share, if divided by sequence.
    """
    indices = dataset.indices
    sequences = np.array([labels.sequence for labels in dataset], dtype=np.int64)
    needed = sum(share > 0 for share in shares)
    if by == "sequence" and len(np.unique(sequences)) < needed:
        raise InputError(
            f"{dataset.folder}: {len(np.unique(sequences))} sequence(s) cannot be divided into {needed}"
            " parts; divide by frame"
        )
    parts = partition(indices, sequences, shares, seed, by)
    file = dataset.folder / PARTITION_FILE
    with atomic_folder(file.parent) as folder:
        for part, members in parts.items():
            images = ([labels.image] for labels in _labels(dataset, members))
            write_csv(folder / f"{part}_images.csv", ("filename",), images)
            poses = ([labels.image, *camera_pose(labels)] for labels in _labels(dataset, members))
            write_csv(folder / f"{part}_pose.csv", ("filename", *POSE_COLUMNS), poses)
        value = {"seed": seed, "shares": list(shares), "by": by, "parts": parts}
        write_json(folder / file.name, value)
    return parts


def _labels(dataset: Dataset, indices: Sequence[int]) -> Iterator[LabelLine]:
    return labels_with(dataset, "a partition", NEEDS_POSE, map(dataset.position, indices))
