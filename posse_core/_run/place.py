"""Where a run puts its dataset, held by one run at a time.

The *books* (labels, checksums, scenario, manifest, exports: all but images and arrays) are kept in a
folder of this machine, since lines are appended to them. On a network store, which cannot append, a
copy of the books is kept up: what has been appended goes there as a journal every few seconds, and
the books whole, in place of the journal, when a run starts and when it ends. Images and arrays are
written straight to the store by the workers.
"""

from __future__ import annotations

import contextlib
import hashlib
import shutil
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from posse_core._dataset.layout import LABELS, MANIFEST, SCENARIO, SPACECRAFT
from posse_core._errors import InputError, StoreError
from posse_core._files.store import LocalStore, RemoteStore, Store, is_remote
from posse_core._run.lease import Lease
from posse_core._run.shards import replay

JOURNAL = ".journal"
JOURNAL_EVERY_S = 5.0
_MARK, _LAST = SCENARIO, MANIFEST


class Place(ABC):
    """A run's hold on where its dataset goes.

    Attributes:
        store: the dataset's files.
        books: the folder of this machine where the books are kept.
    """

    store: Store
    books: Path

    @abstractmethod
    def claimed(self) -> contextlib.AbstractContextManager[None]:
        """Keep other runs away for the length of a block; ``books`` is there within it.

        Raises:
            InputError: another run holds the place, or the folder cannot be made.
            StoreError: a network store refuses.
        """

    @abstractmethod
    def entered(self, entry: bytes) -> None:
        """A frame has been entered in the books by ``entry``."""

    @abstractmethod
    def save(self) -> None:
        """Bring the store's books up to date."""

    @abstractmethod
    def discard(self) -> None:
        """Leave nothing behind."""


class LocalPlace(Place):
    """A folder of this machine: the books are where they belong."""

    def __init__(self, folder: Path) -> None:
        self.books = folder.absolute()
        self.store = LocalStore(self.books)

    @contextlib.contextmanager
    def claimed(self) -> Iterator[None]:
        try:
            self.books.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            reason = (error.strerror or "").lower()
            raise InputError(
                f"--out {self.books}: cannot be made ({reason}); name another folder"
            ) from None
        lock = self.books / ".lock"
        try:
            with FileLock(lock, timeout=0):
                try:
                    yield
                finally:
                    lock.unlink(missing_ok=True)
        except Timeout:
            raise InputError(f"{self.books}: another run is writing there; wait for it to end") from None

    def entered(self, entry: bytes) -> None:
        """The entry is where it belongs."""

    def save(self) -> None:
        """The books are where they belong."""

    def discard(self) -> None:
        shutil.rmtree(self.books, ignore_errors=True)


class RemotePlace(Place):
    """A folder of a network store."""

    store: RemoteStore

    def __init__(self, url: str) -> None:
        self.store = RemoteStore(url)
        self._saved: dict[str, str] = {}
        self._entries: list[bytes] = []
        self._journals = 0
        self._journalled_s = time.monotonic()

    @contextlib.contextmanager
    def claimed(self) -> Iterator[None]:
        with tempfile.TemporaryDirectory() as folder, Lease(self.store) as self._lease:
            self.books = Path(folder)
            self._fetch()
            try:
                yield
            except BaseException:
                with contextlib.suppress(StoreError):
                    self._write_journal()
                raise

    def _fetch(self) -> None:
        """Get the books, and enter what a cut run left in its journal."""
        names = [name for name in self.store.names() if not name.startswith(".")]
        if _MARK not in names:  # new, or nothing of ours
            for name in names:
                (self.books / name).touch()
            return
        for part in (LABELS, SPACECRAFT):
            (self.books / part).mkdir()
            names += self.store.names(part)
        for name in names:
            data = self.store.read(name)
            (self.books / name).write_bytes(data)
            self._saved[name] = hashlib.sha256(data).hexdigest()
        for name in self.store.names(JOURNAL):
            replay(self.books, self.store.read(name))

    def entered(self, entry: bytes) -> None:
        self._entries.append(entry)
        if time.monotonic() - self._journalled_s >= JOURNAL_EVERY_S:
            self._lease.check()
            self._write_journal()

    def _write_journal(self) -> None:
        if self._entries:
            name = f"{JOURNAL}/{self._lease.holder}-{self._journals:06d}"
            self.store.write(name, b"".join(self._entries))
            self._journals += 1
            self._entries.clear()
        self._journalled_s = time.monotonic()

    def save(self) -> None:
        self._lease.check()
        paths = (path for path in self.books.rglob("*") if path.is_file())
        names = {path.relative_to(self.books).as_posix() for path in paths}
        for name in self._saved.keys() - names:
            self.store.delete(name)
            del self._saved[name]
        for name in sorted(names, key=lambda name: (name == _LAST, name != _MARK, name)):
            data = (self.books / name).read_bytes()
            digest = hashlib.sha256(data).hexdigest()
            if self._saved.get(name) != digest:
                self.store.write(name, data)
                self._saved[name] = digest
        self._entries.clear()
        for name in self.store.names(JOURNAL):
            self.store.delete(name)

    def discard(self) -> None:
        with contextlib.suppress(StoreError):
            for name in [*self._saved, *self.store.names(JOURNAL)]:
                self.store.delete(name)


def place_at(name: str) -> Place:
    """The place of this name: a path, or a URL."""
    return RemotePlace(name) if is_remote(name) else LocalPlace(Path(name))
