"""The labels that a format needs, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._model.label_line import LabelLine, annotator_of


def labels_with(
    dataset: Dataset, format_name: str, needs: Sequence[str], positions: Iterable[int] | None = None
) -> Iterator[LabelLine]:
    """Every frame's labels, each checked to have what the format needs.

    Args:
        needs: names of labels.
        positions: of the frames; all, if None.

    Raises:
        InputError: a label is missing; the message names its annotator.
    """
    for labels in dataset if positions is None else map(dataset.__getitem__, positions):
        for name in needs:
            if not labels.has(name):
                raise InputError(
                    f"{dataset.folder}: frame {labels.index} has no {name!r}, which {format_name} needs;"
                    f" add {annotator_of(name)!r} to the scenario's annotators"
                )
        yield labels
