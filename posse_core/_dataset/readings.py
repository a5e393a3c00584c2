"""Reading the files of a sensor's reading."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from posse_core._dataset.files import read_arrays, read_image
from posse_core._dataset.layout import inside
from posse_core._files.reading import read_bytes
from posse_core._model.label_line import ReadingLabels
from posse_core._model.reading import Reading


def read_reading(folder: Path, labels: ReadingLabels) -> Reading:
    """Read the files of a reading of the dataset in ``folder``.

    Raises:
        InputError: A file is missing or damaged.
    """
    by_ending = {PurePosixPath(name).suffix: inside(folder, name) for name in labels.files}
    image, arrays = by_ending.pop(".png", None), by_ending.pop(".npz", None)
    return Reading(
        labels.labels,
        {} if arrays is None else read_arrays(arrays),
        None if image is None else read_image(image),
        {ending: read_bytes(path, missing="missing") for ending, path in by_ending.items()},
    )
