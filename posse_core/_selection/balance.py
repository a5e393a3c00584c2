"""Balancing of frames, so that bins of class, range and viewing direction have equal numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from posse_core._errors import InputError
from posse_core._frames import matrix_from_quaternion
from posse_core._model.label_line import LabelLine
from posse_core._plugins.options import nearest
from posse_core._randomness import random_generator

RANGES_PER_OCTAVE = 2
BANDS, SECTORS = 4, 8
"""Bins of viewing directions: bands of equal height along body z, which have equal areas, and sectors
about that axis."""


Bin = tuple[int | str, ...]


@dataclass(frozen=True)
class Axis:
    """A property of frames that is divided into bins.

    Attributes:
        name: of the axis.
        why: one line of documentation.
        bin_of: returns the bin of a frame from its labels.
        name_of: returns the name of a bin.
        needs: names of the labels that ``bin_of`` needs.
    """

    name: str
    why: str
    bin_of: Callable[[LabelLine], int | str]
    name_of: Callable[[Any], str]
    needs: Sequence[str]


def _class(labels: LabelLine) -> str:
    return labels.spacecraft


def _range(labels: LabelLine) -> int:
    return math.floor(RANGES_PER_OCTAVE * math.log2(labels.range_m))


def _name_of_range(step: int) -> str:
    low, high = (2 ** (k / RANGES_PER_OCTAVE) for k in (step, step + 1))
    return f"{low:.4g} to {high:.4g} m"


def _direction(labels: LabelLine) -> int:
    R_cam_from_body = matrix_from_quaternion(np.array(labels.q_cam_from_body))
    x, y, z = -R_cam_from_body.T @ np.array(labels.t_body_cam_m) / labels.range_m
    band = min(int((z + 1) / 2 * BANDS), BANDS - 1)
    sector = int(math.atan2(y, x) / (2 * math.pi) % 1 * SECTORS) % SECTORS
    return band * SECTORS + sector


def _name_of_direction(number: int) -> str:
    band, sector = divmod(number, SECTORS)
    south, north = (math.degrees(math.asin(2 * k / BANDS - 1)) for k in (band, band + 1))
    west, east = (360 / SECTORS * k for k in (sector, sector + 1))
    return f"latitude {south:.0f} to {north:.0f}, longitude {west:.0f} to {east:.0f} deg"


AXES = {
    axis.name: axis
    for axis in (
        Axis("class", "the spacecraft", _class, str, ("spacecraft",)),
        Axis(
            "range",
            f"the distance, {RANGES_PER_OCTAVE} bins per octave",
            _range,
            _name_of_range,
            ("range_m",),
        ),
        Axis(
            "direction",
            f"direction to the camera in body axes, {BANDS * SECTORS} bins of equal area",
            _direction,
            _name_of_direction,
            ("q_cam_from_body", "t_body_cam_m", "range_m"),
        ),
    )
}
"""All axes by name, in the order of a bin's elements."""


@dataclass(frozen=True)
class Balance:
    """How frames are balanced.

    Attributes:
        axes: axes whose bins are combined.
        frames: number of frames to keep; None for the largest number with equal bins.
        seed: of the random choice within a bin.
    """

    axes: Sequence[Axis]
    frames: int | None
    seed: int

    @property
    def why(self) -> str:
        """Description of the balance for the manifest."""
        even = "even" if self.frames is None else f"{self.frames} frames, as even as possible"
        return f"{even} over {', '.join(axis.name for axis in self.axes)} (seed {self.seed})"

    def bin_of(self, location: str, labels: LabelLine) -> Bin:
        """Return the bin of a frame, with an element for each axis.

        Args:
            location: of the dataset, for the message.
            labels: of the frame.

        Raises:
            InputError: The labels lack what an axis needs.
        """
        for axis in self.axes:
            for key in axis.needs:
                if not labels.has(key):
                    raise InputError(
                        f"{location}: frame {labels.index} has no {key!r}, which balancing by"
                        f" {axis.name} needs"
                    )
        return tuple(axis.bin_of(labels) for axis in self.axes)

    def counts(self, bins: Sequence[Bin], kept: Sequence[int]) -> Iterator[dict[str, str | int]]:
        """Yield the names, the number of frames and the number of kept frames of each bin.

        Args:
            bins: the bin of every frame.
            kept: positions in ``bins``.
        """
        there, left = Counter(bins), Counter(bins[position] for position in kept)
        for bin_ in sorted(there):
            names = {a.name: a.name_of(part) for a, part in zip(self.axes, bin_, strict=True)}
            yield {**names, "frames": there[bin_], "kept": left[bin_]}


def axes_named(names: Sequence[str]) -> list[Axis]:
    """Return the axes of these names, in the order of :data:`AXES`.

    Raises:
        InputError: There is no axis of a name.
    """
    for name in names:
        if name not in AXES:
            raise InputError(f"cannot balance by {name!r}{nearest(name, AXES)}; by {', '.join(AXES)}")
    return [axis for axis in AXES.values() if axis.name in names]


def balanced(bins: Sequence[Bin], frames: int | None, seed: int) -> list[int]:
    """Return the positions of the frames to keep, ascending.

    Bins are filled evenly: a bin gets at most one frame more than another that still has frames left.
    Which bins get one more, and which frames of a bin are kept, is random.

    Args:
        bins: the bin of each frame.
        frames: number of frames to keep, at most all; None for the largest number with equal bins.
        seed: of the random choices. The same arguments give the same result.
    """
    random = random_generator(seed, -1, "balance")
    order = sorted(random.permutation(len(bins)).tolist(), key=lambda position: bins[position])
    queues = [list(members) for _, members in groupby(order, key=lambda position: bins[position])]
    if frames is None:
        frames = len(queues) * min(map(len, queues), default=0)
    left = [queues[i] for i in random.permutation(len(queues))]
    kept: list[int] = []
    while left and len(kept) < frames:
        kept += [queue.pop() for queue in left[: frames - len(kept)]]
        left = [queue for queue in left if queue]
    return sorted(kept)
