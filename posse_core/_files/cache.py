"""Arrays that take long to compute, kept in the user's cache folder."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterable

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._files.atomic import atomic_file
from posse_core._files.cache_folder import cache_folder


def cached_array(name: str, made_of: Iterable[bytes], make: Callable[[], AnyArray]) -> AnyArray:
    """Return what ``make`` returns, from the cache if it has been made before.

    Processes may do this at the same time: a file in the cache is always complete. A file that cannot
    be read is made anew, and where the cache cannot be written nothing is kept. Files of the same name
    that were made of something else are deleted.

    Args:
        name: of the array; the beginning of the file's name.
        made_of: everything that the array depends on, such as the content of files and the versions of
            libraries.
        make: computes the array.
    """
    digest = hashlib.sha256()
    for part in made_of:
        digest.update(hashlib.sha256(part).digest())
    folder = cache_folder()
    path = folder / f"{name}-{digest.hexdigest()[:16]}.npy"
    with contextlib.suppress(OSError, ValueError, EOFError):
        kept: AnyArray = np.load(path, allow_pickle=False)
        return kept
    array = make()
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as stream:
            np.save(stream, array, allow_pickle=False)
        for other in folder.glob(f"{name}-{'?' * 16}.npy"):
            if other != path:
                other.unlink()
    return array
