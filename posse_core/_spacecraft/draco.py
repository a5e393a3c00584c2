"""The headers of meshes compressed with Draco, whose decoder takes as much memory as they ask for.

Source: Draco bitstream specification 2.2, sections "Header" and "Connectivity Data".
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from posse_core._errors import InputError

MOST_VALUES: Final = 20_000_000
"""The most vertices, or triangles, of a mesh."""
_METHOD, _HEADER = 8, 11
"""Position of the byte that names the method of connectivity, and the length of the header."""
_EDGEBREAKER = 1


def check_draco(data: bytes, path: Path) -> None:
    """Check the numbers of vertices, triangles and symbols of a compressed mesh.

    Args:
        data: the compressed mesh.
        path: the file that contains it, for the message.

    Raises:
        InputError: A number is above :data:`MOST_VALUES`.
        IndexError: The data end within the header.
    """
    by_edges = data[_METHOD] == _EDGEBREAKER
    at = _HEADER + by_edges  # the kind of traversal comes first
    for number in range(4 if by_edges else 2):
        at += number == 2  # the number of attributes is between vertices and triangles, and symbols
        count, at = _varint(data, at)
        if count > MOST_VALUES:
            raise InputError(
                f"{path}: a mesh compressed with Draco asks for {count} values, and at most"
                f" {MOST_VALUES} are read; export it again"
            )


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """The number at a position, seven bits a byte, lowest first; and the position after it."""
    number = shift = 0
    while True:
        byte = data[at]
        number |= (byte & 0x7F) << shift
        shift, at = shift + 7, at + 1
        if byte < 0x80:
            return number, at
