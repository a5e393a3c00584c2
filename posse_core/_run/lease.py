"""A lock on a network store. Its holder renews it, since the store cannot detect a holder that died."""

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
"""A lock that has not changed for this time belongs to a run that died."""


class Lease:
    """The exclusive right of one run to write to a network store within a block.

    The lock file contains the holder's name and a counter that the holder increments while it is alive,
    so the clocks of different machines are never compared. If two runs hold the lock all the same, both
    write the same frames, and the one that lost the lock ends.

    Attributes:
        holder: a unique name.

    Raises:
        InputError: Another run holds the lock and is alive.
        StoreError: The store refuses.
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
                self._remove_if_dead()
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
        """Check that this run still holds the lock.

        Raises:
            InputError: Another run has taken the lock.
        """
        if self._taken:
            raise InputError(f"{self._store.location}: another run has taken over; this one ends")

    def _remove_if_dead(self) -> None:
        """Delete the lock if it does not change for a while, because its run has died."""
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
                pass  # the run's own writes will fail too and report it
            except FileNotFoundError:
                self._taken = True

    def _is_ours(self) -> bool:
        return self._store.read(LOCK).startswith(self.holder.encode())

    def _text(self, count: int) -> bytes:
        return f"{self.holder} {count}\n".encode()
