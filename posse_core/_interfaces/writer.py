"""Writers: a finished dataset's labels in a format that other tools load."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from posse_core._plugins.component import Component, OptionsT

if TYPE_CHECKING:  # plugins that name this interface beside their hooks are loaded by every command
    from posse_core._dataset.dataset import Dataset


class Writer(Component[OptionsT]):
    """Exports a dataset to one format."""

    @abstractmethod
    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the files into ``folder`` (it exists), atomically; return their paths.

        Image paths in the files are relative to the dataset's own folder.

        Raises:
            posse_core.InputError: the dataset lacks labels that the format needs.
        """
