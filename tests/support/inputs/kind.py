"""What a kind of input is."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    Attributes:
        write: writes sound inputs into a folder.
        case: damages one of them, and returns the command to run in the folder.
        sound: commands that do what they are for with the sound inputs. A command that would take long
            ends where it writes, because ``--out`` is a file.
        keeps: beginnings of names of what a command rightly leaves when it is refused: the steps of a
            recipe, or of an adaptation, that are done.
    """

    write: Callable[[Path], None]
    case: Callable[[Path, random.Random], list[str]]
    sound: tuple[str, ...]
    keeps: tuple[str, ...] = ()
