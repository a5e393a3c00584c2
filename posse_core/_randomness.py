"""Random numbers: every draw comes from (run seed, frame index, purpose), and from nothing else.

So a frame's noise is the same whichever worker makes it, in which order, after how many tries.
"""

from __future__ import annotations

import zlib

import numpy as np


def random_generator(seed: int, index: int, purpose: str) -> np.random.Generator:
    """The random numbers of one frame and purpose, the same on every machine and in any order of frames.

    Args:
        seed: of the run, 0 or greater.
        index: of the frame, 0 or greater; −1 for draws of the whole run.
        purpose: a name of one's own for what is drawn, such as ``"sensor"``: draws for one purpose do
            not change those for another.
    """
    words = (seed, index + 1, zlib.crc32(purpose.encode()))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


def derived_seed(seed: int, index: int, purpose: str) -> int:
    """A 31-bit seed for a library that draws by itself, such as a renderer."""
    return int(random_generator(seed, index, purpose).integers(2**31))
