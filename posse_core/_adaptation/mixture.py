"""A recipe's own frames with images of the target domain among those that are learned from."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Final, overload

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.images import LabelledImages
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine

MOST_REPEATS: Final = 20
"""An image of the target domain is learned from so often in an epoch at most: a handful of them, however
often they were shown, would be learned by heart."""
_SAME_PLACE_M: Final = 1e-4
"""Largest difference of a keypoint's coordinate in two descriptions of one spacecraft."""


class Mixture(LabelledImages):
    """The frames of a dataset, and after them images of the target domain, which its train part has too.

    The parts ``valid`` and ``test`` are the dataset's alone, so its camera, which took these, is the
    camera here. The images of the target domain may have another one and other sizes. They are repeated
    until they have a share of the train part. Frames are numbered from 0, so index and position are the
    same.
    """

    def __init__(
        self, own: LabelledImages, target: LabelledImages, learned: Sequence[int], share: float
    ) -> None:
        """Mix images into a dataset.

        Args:
            own: the dataset, in parts.
            target: of the target domain, with the spacecraft and keypoints of the dataset.
            learned: positions in ``target`` of the images that are learned from, each once.
            share: of the train part that they get, above 0 and below 1, as far as
                :data:`MOST_REPEATS` allows; each is in it at least once.
        """
        super().__init__()
        self.folder, self.spacecraft_by_name = own.folder, own.spacecraft_by_name
        self._own, self._target = own, target
        wanted = round(share / (1 - share) * len(own.part("train")))
        count = min(max(wanted, len(learned)), MOST_REPEATS * len(learned))
        # Repeats are side by side, so that one reading of the file serves all of them.
        self._repeated = [learned[row * len(learned) // count] for row in range(count)]
        self._lines = {position: target[position] for position in learned}
        self._last: tuple[int, AnyArray] | None = None

    def __repr__(self) -> str:
        return f"Mixture({len(self._own)} frames and {len(self._repeated)} of {self._target!r})"

    def __len__(self) -> int:
        return len(self._own) + len(self._repeated)

    @overload
    def __getitem__(self, i: int) -> LabelLine: ...
    @overload
    def __getitem__(self, i: slice) -> list[LabelLine]: ...
    def __getitem__(self, i: int | slice) -> LabelLine | list[LabelLine]:
        if isinstance(i, slice):
            return [self[position] for position in range(len(self))[i]]
        position = range(len(self))[i]
        source, place = self._placed(position)
        line = self._own[place] if source is self._own else self._lines[place]
        return line.model_copy(update={"index": position})

    def _placed(self, i: int) -> tuple[LabelledImages, int]:
        """The images that a frame is of, and its position there."""
        position = range(len(self))[i]
        beyond = position - len(self._own)
        return (self._own, position) if beyond < 0 else (self._target, self._repeated[beyond])

    def position(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise InputError(f"{self.folder}: has no frame {index}")
        return index

    @property
    def camera(self) -> Camera:
        return self._own.camera

    @property
    def classes(self) -> Mapping[str, SpacecraftInfo]:
        return self._own.classes

    def loose_keypoints(self, name: str) -> list[str]:
        return self._own.loose_keypoints(name)

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of both, and of which images are learned from how often."""
        made_of = f"{self._own.sha256} {self._target.sha256} {self._repeated}"
        return hashlib.sha256(made_of.encode()).hexdigest()

    def part(self, name: str) -> list[int]:
        own = self._own.part(name)
        return [*own, *range(len(self._own), len(self))] if name == "train" else own

    def size_px(self, i: int) -> tuple[int, int]:
        source, place = self._placed(i)
        return source.size_px(place)

    def image(self, i: int) -> AnyArray:
        source, place = self._placed(i)
        if source is self._own:
            return source.image(place)
        if self._last is None or self._last[0] != place:
            self._last = place, source.image(place)
        return self._last[1]


def check_alike(own: LabelledImages, target: LabelledImages) -> None:
    """Check that images of a target domain can be learned from beside a dataset's own.

    Raises:
        InputError: they show other spacecraft, or their labels have other keypoints.
    """
    for name, theirs in target.classes.items():
        if name not in own.classes:
            raise InputError(
                f"{target.folder}: shows {name!r}, and the nets know {', '.join(own.classes)}; give"
                " images of that spacecraft, under that name"
            )
        ours = own.classes[name].keypoints_body_m
        if list(ours) != list(theirs.keypoints_body_m):
            raise InputError(
                f"{target.folder}: {name} has other keypoints than the recipe's; label the images with"
                " the keypoints of its package"
            )
        for point, place_m in ours.items():
            if not np.allclose(place_m, theirs.keypoints_body_m[point], rtol=0, atol=_SAME_PLACE_M):
                raise InputError(
                    f"{target.folder}: the keypoint {point} of {name} is elsewhere than the recipe's;"
                    " label the images with the keypoints of its package, from the same origin"
                )
