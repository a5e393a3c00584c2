"""Random numbers that depend on the run's seed, the frame's index and the purpose, and on nothing else.

A frame's noise is therefore the same for any worker, any order of frames and any number of tries.
"""

from __future__ import annotations

import zlib

import numpy as np


def random_generator(seed: int, index: int, purpose: str) -> np.random.Generator:
    """Return the random generator of a frame and purpose.

    Its numbers are the same on every machine and for any order of frames.

    Args:
        seed: of the run, 0 or greater.
        index: of the frame, 0 or greater; −1 for numbers that belong to the whole run.
        purpose: a unique name for the use of the numbers, such as ``"sensor"``. Numbers for one purpose
            are independent of those for another.
    """
    words = (seed, index + 1, zlib.crc32(purpose.encode()))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


def derived_seed(seed: int, index: int, purpose: str) -> int:
    """Return a 31-bit seed for a library with its own random numbers, such as a renderer."""
    return int(random_generator(seed, index, purpose).integers(2**31))
