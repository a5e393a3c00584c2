"""Interface of writers, which export a finished dataset to a format that other tools load."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from posse_core._plugins.component import Component, OptionsT

if TYPE_CHECKING:  # at run time this import would slow down every command that loads plugins
    from posse_core._dataset.dataset import Dataset


class Writer(Component[OptionsT]):
    """Exports a dataset to one format."""

    @abstractmethod
    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the files into an empty folder, and return their paths.

        When this returns, they move into the folder that the user named, all or none.

        Image paths in the files are relative to the dataset's folder.

        Raises:
            posse_core.InputError: The dataset lacks labels that the format needs.
        """
