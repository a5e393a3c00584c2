"""Random numbers: every draw comes from (run seed, frame index, purpose), and from nothing else.

So a frame's noise is the same whichever worker makes it, in which order, after how many tries.
"""

from __future__ import annotations

import zlib

import numpy as np


def generator(seed: int, index: int, purpose: str) -> np.random.Generator:
    """The generator of one frame (``index`` ≥ 0; −1 for draws of the whole run) and purpose."""
    words = (seed, index + 1, zlib.crc32(purpose.encode()))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


def derived_seed(seed: int, index: int, purpose: str) -> int:
    """A 31-bit seed for a library that draws by itself, such as a renderer."""
    return int(generator(seed, index, purpose).integers(2**31))
