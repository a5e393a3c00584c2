"""What a check found."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


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


@dataclass(frozen=True)
class Report:
    """What all checks found."""

    folder: Path
    frames: int
    results: tuple[Result, ...]

    @property
    def passed(self) -> bool:
        """No check found a fault."""
        return not any(result.faults for result in self.results)

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        return {
            "dataset": str(self.folder),
            "frames": self.frames,
            "passed": self.passed,
            "checks": [
                {
                    "name": result.name,
                    "proves": result.proves,
                    "checked": result.checked,
                    "frames_failed": result.frames,
                    "faults": [
                        {"frame": fault.frame, "message": fault.message} for fault in result.faults
                    ],
                }
                for result in self.results
            ],
        }
