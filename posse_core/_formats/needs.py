"""The labels that a format needs, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError


def labels_with(
    dataset: Dataset, format_name: str, needs: Mapping[str, str], indices: Iterable[int] | None = None
) -> Iterator[dict[str, Any]]:
    """Every frame's labels, each checked to have what the format needs.

    Args:
        needs: label → the annotator that makes it.
        indices: of the frames; all, if None.

    Raises:
        InputError: a label is missing; the message names its annotator.
    """
    for labels in dataset.frames if indices is None else map(dataset.frame, indices):
        for key, annotator in needs.items():
            if key not in labels:
                raise InputError(
                    f"{dataset.folder}: frame {labels['index']} has no {key!r}, which"
                    f" {format_name} needs; add {annotator!r} to the scenario's annotators"
                )
        yield labels
