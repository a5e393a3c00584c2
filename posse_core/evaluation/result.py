"""What a check found."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong; ``frame`` is an index, or None where it is of the whole dataset."""

    frame: int | None
    message: str


@dataclass
class Result:
    """What one check found. ``checked`` counts frames (files, for ``checksums``); 0 where no frame had
    the labels that it compares."""

    name: str
    proves: str
    checked: int = 0
    faults: list[Fault] = field(default_factory=list)

    @property
    def frames(self) -> list[int]:
        """Indices of the frames with a fault, ascending."""
        return sorted({fault.frame for fault in self.faults if fault.frame is not None})
