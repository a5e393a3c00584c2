"""The destination of a run: the location of its dataset, which one run at a time may write to.

The bookkeeping files (labels, checksums, scenario, manifest and exports: everything but images and
arrays) are kept in a folder on this machine, since lines are appended to them. A network store cannot
append, so it holds a copy of these files: appended lines are written there as a journal every few
seconds, and the complete files replace the journal when a run starts and when it ends. The workers write
images and arrays directly to the store.
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

from posse_core._dataset.layout import BODIES, INPUTS, LABELS, MANIFEST, SCENARIO, SPACECRAFT
from posse_core._errors import InputError, StoreError
from posse_core._files.store import LocalStore, RemoteStore, Store, is_remote
from posse_core._run.lease import Lease
from posse_core._run.shards import replay

JOURNAL = ".journal"
JOURNAL_EVERY_S = 5.0
_MARK, _LAST = SCENARIO, MANIFEST


class Destination(ABC):
    """The location that a run writes its dataset to.

    Attributes:
        store: stores the dataset's files.
        folder: the folder on this machine that holds the bookkeeping files.
    """

    store: Store
    folder: Path

    @abstractmethod
    def claimed(self) -> contextlib.AbstractContextManager[None]:
        """Lock the destination against other runs within the block, where ``folder`` exists.

        Raises:
            InputError: Another run has locked the destination, or the folder cannot be created.
            StoreError: The network store refuses.
        """

    @abstractmethod
    def frame_logged(self, entry: bytes) -> None:
        """Note that ``entry``, a frame's lines, was appended to the bookkeeping files."""

    @abstractmethod
    def save(self) -> None:
        """Bring the store's copy of the bookkeeping files up to date."""

    @abstractmethod
    def discard(self) -> None:
        """Delete the bookkeeping files."""


class LocalDestination(Destination):
    """A folder on this machine, which holds the bookkeeping files itself."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.absolute()
        self.store = LocalStore(self.folder)

    @contextlib.contextmanager
    def claimed(self) -> Iterator[None]:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            reason = (error.strerror or "").lower()
            raise InputError(
                f"--out {self.folder}: cannot be created ({reason}); choose another folder"
            ) from None
        lock = self.folder / ".lock"
        try:
            with FileLock(lock, timeout=0):
                try:
                    yield
                finally:
                    lock.unlink(missing_ok=True)
        except Timeout:
            raise InputError(
                f"{self.folder}: another run is writing there; wait for it to end"
            ) from None

    def frame_logged(self, entry: bytes) -> None:
        """Do nothing: the entry is already in the dataset's folder."""

    def save(self) -> None:
        """Do nothing: the bookkeeping files are already in the dataset's folder."""

    def discard(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


class RemoteDestination(Destination):
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
            self.folder = Path(folder)
            self._fetch()
            try:
                yield
            except BaseException:
                with contextlib.suppress(StoreError):
                    self._write_journal()
                raise

    def _fetch(self) -> None:
        """Download the bookkeeping files and replay the journal of an interrupted run."""
        names = [name for name in self.store.names() if not name.startswith(".")]
        if _MARK not in names:  # new, or not a dataset
            for name in names:
                (self.folder / name).touch()
            return
        for part in (LABELS, SPACECRAFT):
            (self.folder / part).mkdir()
            names += self.store.names(part)
        for part in (BODIES, INPUTS):
            names += self.store.names(part, below=True)
        for name in names:
            data = self.store.read(name)
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            self._saved[name] = hashlib.sha256(data).hexdigest()
        for name in self.store.names(JOURNAL):
            replay(self.folder, self.store.read(name))

    def frame_logged(self, entry: bytes) -> None:
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
        paths = (path for path in self.folder.rglob("*") if path.is_file())
        names = {path.relative_to(self.folder).as_posix() for path in paths}
        for name in self._saved.keys() - names:
            self.store.delete(name)
            del self._saved[name]
        for name in sorted(names, key=lambda name: (name == _LAST, name != _MARK, name)):
            data = (self.folder / name).read_bytes()
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


def open_destination(location: str) -> Destination:
    """Return the destination at a location: the path of a folder, or a URL."""
    if is_remote(location):
        return RemoteDestination(location)
    return LocalDestination(Path(location))
