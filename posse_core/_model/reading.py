"""A reading of a sensor beside the chaser's camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from posse_core._arrays import AnyArray


@dataclass(frozen=True)
class Reading:
    """What a sensor read at one instant.

    Attributes:
        labels: small labels by key, of plain JSON types; they go into the frame's label line.
        arrays: arrays by name, of any shapes, which one ``.npz`` file holds.
        image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16, which a ``.png`` file holds; or None.
        files: ending → content of further files, such as ``{".ply": b"ply..."}``.
    """

    labels: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, AnyArray] = field(default_factory=dict)
    image: AnyArray | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)
