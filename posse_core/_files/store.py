"""Where a dataset's files lie: a folder of this machine, or of a network store that fsspec knows.

A file is named by its path in the dataset, as in ``images/000012.png``. It is either whole or not
there, in both.
"""

from __future__ import annotations

import contextlib
import hashlib
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from posse_core._errors import InputError, StoreError
from posse_core._files.atomic import sha256, write_bytes


class Store(ABC):
    """Files by name.

    Attributes:
        name: as the user wrote it.
        readers: threads that read best. A few do not help with files that memory holds, nor do they
            harm; of a disk, as of a network store, answers are waited for together.
    """

    name: str
    readers: int

    @abstractmethod
    def read(self, name: str) -> bytes:
        """A file's content.

        Raises:
            FileNotFoundError: there is none.
            StoreError: a network store refuses.
        """

    @abstractmethod
    def write(self, name: str, data: bytes) -> None:
        """Write a whole file; raises OSError or, of a network store, StoreError."""

    @abstractmethod
    def sha256(self, name: str) -> str:
        """Hexadecimal digest of a file; raises as :meth:`read`."""

    @abstractmethod
    def local_copy(self, name: str) -> contextlib.AbstractContextManager[Path]:
        """A path with the file's content, for the length of a block; raises as :meth:`read`."""


class LocalStore(Store):
    """A folder of this machine."""

    readers = 4

    def __init__(self, folder: Path) -> None:
        self.name = str(folder)
        self._folder = folder

    def read(self, name: str) -> bytes:
        return (self._folder / name).read_bytes()

    def write(self, name: str, data: bytes) -> None:
        write_bytes(self._folder / name, data)

    def sha256(self, name: str) -> str:
        return sha256(f"{self._folder}/{name}")

    @contextlib.contextmanager
    def local_copy(self, name: str) -> Iterator[Path]:
        yield self._folder / name


class RemoteStore(Store):
    """A folder of a network store, as in ``s3://bucket/folder``; credentials as for its own tools."""

    readers = 16

    def __init__(self, url: str) -> None:
        self.name = url.rstrip("/")
        try:
            import fsspec

            self._files: Any
            self._files, self._root = fsspec.url_to_fs(self.name, use_listings_cache=False)
        except ImportError as error:
            raise InputError(
                f"{url}: {error}; 'pip install posse-core[s3]' brings what s3:// needs"
            ) from None
        except ValueError as error:
            raise InputError(f"{url}: {error}") from None

    def read(self, name: str) -> bytes:
        with self._explained("read"):
            data: bytes = self._files.cat_file(f"{self._root}/{name}")
        return data

    def write(self, name: str, data: bytes) -> None:
        with self._explained("written to"):
            self._files.pipe_file(f"{self._root}/{name}", data)

    def create(self, name: str, data: bytes) -> None:
        """Write a file that is not there yet; raises FileExistsError where it is."""
        with self._explained("written to"):
            self._files.pipe_file(f"{self._root}/{name}", data, mode="create")

    def delete(self, name: str) -> None:
        """Remove a file; none may be there."""
        with self._explained("written to"), contextlib.suppress(FileNotFoundError):
            self._files.rm_file(f"{self._root}/{name}")

    def names(self, folder: str = "") -> list[str]:
        """Names of the files straight in a folder, sorted."""
        path = f"{self._root}/{folder}".rstrip("/")
        with self._explained("read"):
            try:
                found = self._files.ls(path, detail=True)
            except FileNotFoundError:
                return []
        files = (each["name"] for each in found if each["type"] == "file")
        return sorted(name.removeprefix(f"{self._root}/") for name in files)

    def sha256(self, name: str) -> str:
        return hashlib.sha256(self.read(name)).hexdigest()

    @contextlib.contextmanager
    def local_copy(self, name: str) -> Iterator[Path]:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / Path(name).name
            path.write_bytes(self.read(name))
            yield path

    @contextlib.contextmanager
    def _explained(self, what: str) -> Iterator[None]:
        try:
            yield
        except FileExistsError:
            raise
        except FileNotFoundError as error:
            if what == "read":
                raise
            raise StoreError(f"{self.name}: there is no such bucket ({error}); make it first") from None
        except Exception as error:  # each store's library has errors of its own
            reason = " ".join(str(error).split()) or type(error).__name__
            raise StoreError(f"{self.name}: cannot be {what} ({reason})") from None


def is_remote(name: str) -> bool:
    """Whether a dataset's name is that of a network store."""
    return "://" in name


def open_store(name: str) -> Store:
    """The store of this name: a path, or a URL."""
    return RemoteStore(name) if is_remote(name) else LocalStore(Path(name))
