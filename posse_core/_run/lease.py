"""A lock on a network store, where nothing tells that its holder has died: it must be renewed."""

from __future__ import annotations

import contextlib
import threading
import time
import uuid
from types import TracebackType

from posse_core._errors import InputError, StoreError
from posse_core._files.store import RemoteStore

LOCK = ".lock"
RENEW_S = 3.0
PATIENCE_S = 15.0
"""A lock that has not changed for this long is that of a run that has died."""


class Lease:
    """The right of one run to write, for the length of a block.

    The lock holds who has it and a count that goes up as long as the holder lives. No clocks are
    compared. Should two runs hold it after all, both write the same frames, and the one whose lock was
    taken ends.

    Attributes:
        holder: a name that no other has.

    Raises:
        InputError: another run holds it, and lives.
        StoreError: the store refuses.
    """

    def __init__(self, store: RemoteStore) -> None:
        self.holder = uuid.uuid4().hex[:12]
        self._store = store
        self._ended = threading.Event()
        self._taken = False
        self._renewer = threading.Thread(target=self._renew, daemon=True)

    def __enter__(self) -> Lease:
        while True:
            try:
                self._store.create(LOCK, self._text(0))
                break
            except FileExistsError:
                self._outwait()
        self._renewer.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        self._renewer.join()
        with contextlib.suppress(StoreError, FileNotFoundError):
            if self._is_ours():
                self._store.delete(LOCK)

    def check(self) -> None:
        """Raises InputError where another run has taken the place."""
        if self._taken:
            raise InputError(f"{self._store.location}: another run has taken over; this one ends")

    def _outwait(self) -> None:
        """Remove the lock of a run that has died."""
        with contextlib.suppress(FileNotFoundError):
            before = self._store.read(LOCK)
            deadline = time.monotonic() + PATIENCE_S
            while time.monotonic() < deadline:
                time.sleep(RENEW_S / 3)
                if self._store.read(LOCK) != before:
                    raise InputError(
                        f"{self._store.location}: another run is writing there; wait for it to end"
                    )
            self._store.delete(LOCK)

    def _renew(self) -> None:
        count = 0
        while not self._ended.wait(RENEW_S):
            count += 1
            try:
                self._taken = not self._is_ours()
                if not self._taken:
                    self._store.write(LOCK, self._text(count))
            except StoreError:
                pass  # what the run writes itself will be refused too, and told
            except FileNotFoundError:
                self._taken = True

    def _is_ours(self) -> bool:
        return self._store.read(LOCK).startswith(self.holder.encode())

    def _text(self, count: int) -> bytes:
        return f"{self.holder} {count}\n".encode()
