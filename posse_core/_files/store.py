"""Stores hold the files of a dataset: in a folder on this machine, or in a network store through fsspec.

A file is named by its path in the dataset, such as ``images/000012.png``. In both kinds of store a file
is either complete or not there.
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
    """Reads and writes the files of one dataset by their names.

    Attributes:
        location: the folder or URL, as the user wrote it.
        read_threads: number of threads that reads many files fastest. Several threads overlap the time
            spent waiting for a disk or a network.
    """

    location: str
    read_threads: int

    @abstractmethod
    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            FileNotFoundError: There is no such file.
            StoreError: The network store refuses.
        """

    @abstractmethod
    def write(self, name: str, data: bytes) -> None:
        """Write a complete file.

        Raises:
            OSError: The disk refuses.
            StoreError: The network store refuses.
        """

    @abstractmethod
    def sha256(self, name: str) -> str:
        """Return the hexadecimal SHA-256 digest of a file; it raises the same errors as :meth:`read`."""

    @abstractmethod
    def local_copy(
        self, name: str, folder: str | None = None
    ) -> contextlib.AbstractContextManager[Path]:
        """Give a local path to the file's content, valid within the block.

        It raises the same errors as :meth:`read`.

        Args:
            name: of the file, in the dataset's folder itself.
            folder: name of a folder whose files are there too, beside the copy.
        """


class LocalStore(Store):
    """Stores a dataset in a folder on this machine."""

    read_threads = 4

    def __init__(self, folder: Path) -> None:
        self.location = str(folder)
        self._folder = folder

    def read(self, name: str) -> bytes:
        return (self._folder / name).read_bytes()

    def write(self, name: str, data: bytes) -> None:
        write_bytes(self._folder / name, data)

    def sha256(self, name: str) -> str:
        return sha256(f"{self._folder}/{name}")

    @contextlib.contextmanager
    def local_copy(self, name: str, folder: str | None = None) -> Iterator[Path]:
        yield self._folder / name


class RemoteStore(Store):
    """Stores a dataset in a folder of a network store, such as ``s3://bucket/folder``.

    Credentials are found in the same way as by the store's own tools.
    """

    read_threads = 16

    def __init__(self, url: str) -> None:
        self.location = url.rstrip("/")
        try:
            import fsspec

            self._files: Any
            self._files, self._root = fsspec.url_to_fs(self.location, use_listings_cache=False)
        except ImportError as error:
            raise InputError(
                f"{url}: {error}; 'pip install posse-core[s3]' installs what s3:// needs"
            ) from None
        except ValueError as error:
            raise InputError(f"{url}: {error}") from None

    def read(self, name: str) -> bytes:
        with self._explain_errors("read"):
            data: bytes = self._files.cat_file(f"{self._root}/{name}")
        return data

    def write(self, name: str, data: bytes) -> None:
        with self._explain_errors("written to"):
            self._files.pipe_file(f"{self._root}/{name}", data)

    def create(self, name: str, data: bytes) -> None:
        """Write a new file.

        Raises:
            FileExistsError: The file exists already.
            StoreError: The store refuses.
        """
        with self._explain_errors("written to"):
            self._files.pipe_file(f"{self._root}/{name}", data, mode="create")

    def delete(self, name: str) -> None:
        """Delete a file, if there is one.

        Raises:
            StoreError: The store refuses.
        """
        with self._explain_errors("written to"), contextlib.suppress(FileNotFoundError):
            self._files.rm_file(f"{self._root}/{name}")

    def names(self, folder: str = "", *, below: bool = False) -> list[str]:
        """Return the sorted names of the files in a folder.

        Args:
            folder: its name.
            below: also of those in its subfolders.

        Raises:
            StoreError: The store refuses, or a name leads out of the dataset.
        """
        path = f"{self._root}/{folder}".rstrip("/")
        with self._explain_errors("read"):
            try:
                if below:
                    found = self._files.find(path, detail=True).values()
                else:
                    found = self._files.ls(path, detail=True)
            except FileNotFoundError:
                return []
        files = (each["name"] for each in found if each["type"] == "file")
        names = sorted(name.removeprefix(f"{self._root}/") for name in files)
        for name in names:
            if ".." in name.split("/"):
                raise StoreError(
                    f"{self.location}: has the file {name!r}, which leads out of the folder"
                )
        return names

    def sha256(self, name: str) -> str:
        return hashlib.sha256(self.read(name)).hexdigest()

    @contextlib.contextmanager
    def local_copy(self, name: str, folder: str | None = None) -> Iterator[Path]:
        with tempfile.TemporaryDirectory() as temporary:
            copy = Path(temporary)
            if folder is not None:
                (copy / folder).mkdir()
            for each in [name, *(self.names(folder, below=True) if folder is not None else ())]:
                path = copy / each
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(self.read(each))
            yield copy / name

    @contextlib.contextmanager
    def _explain_errors(self, action: str) -> Iterator[None]:
        """Turn the errors of the store's library into StoreError; ``action`` completes "cannot be …"."""
        try:
            yield
        except FileExistsError:
            raise
        except FileNotFoundError as error:
            if action == "read":
                raise
            raise StoreError(
                f"{self.location}: there is no such bucket ({error}); create it first"
            ) from None
        except Exception as error:  # every store's library has its own exception classes
            reason = " ".join(str(error).split()) or type(error).__name__
            raise StoreError(f"{self.location}: cannot be {action} ({reason})") from None


def is_remote(location: str) -> bool:
    """Say whether a dataset's location is the URL of a network store."""
    return "://" in location


def open_store(location: str) -> Store:
    """Open the store at a location: the path of a folder, or a URL."""
    return RemoteStore(location) if is_remote(location) else LocalStore(Path(location))
