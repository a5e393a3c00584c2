"""Checks that a dataset is one that a format can hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady
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


def refuse_rational_lens(camera: Camera, who: str) -> None:
    """Check that a lens is a fisheye, or Brown and Conrady's without a denominator.

    Args:
        camera: the camera.
        who: dataset and format, the start of the message.

    Raises:
        InputError: The lens has one of k₄, k₅ and k₆.
    """
    lens = camera.distortion
    if isinstance(lens, BrownConrady) and lens.is_rational:
        raise InputError(
            f"{who} cannot describe OpenCV's rational lens, and camera.distortion is"
            f" {lens.coefficients.tolist()}; export colmap or opencv-calibration"
        )
