"""Checks that frames have the labels that a format needs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._model.label_line import LabelLine, annotator_of


def labels_with(
    dataset: Dataset, format_name: str, needs: Sequence[str], positions: Iterable[int] | None = None
) -> Iterator[LabelLine]:
    """Yield the labels of frames after checking that they have what the format needs.

    Args:
        dataset: the dataset.
        format_name: name of the format, for the message.
        needs: names of the labels.
        positions: of the frames; all if None.

    Raises:
        InputError: A label is missing; the message names its annotator.
    """
    for labels in dataset if positions is None else map(dataset.__getitem__, positions):
        for name in needs:
            if not labels.has(name):
                raise InputError(
                    f"{dataset.folder}: frame {labels.index} has no {name!r}, which {format_name} needs;"
                    f" add {annotator_of(name)!r} to the scenario's annotators"
                )
        yield labels
