"""A dataset on disk, read: the folder that a run writes. Its layout stands in ``docs/dataset.md``."""

from __future__ import annotations

from pathlib import Path


class Dataset:
    """A folder made by ``posse run``.

    Raises:
        posse_core.errors.InputError: the folder is not a dataset; the message says why.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
