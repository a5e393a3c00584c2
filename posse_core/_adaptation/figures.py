"""What came of carrying nets on: figures before and after, on what the nets have not learned from."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from pathlib import Path

from posse_core._adaptation.photographs import Found
from posse_core._dataset.images import LabelledImages
from posse_core._detection.evaluate import evaluate
from posse_core._detection.groups import groups
from posse_core._detection.known import target_shapes
from posse_core._detection.models import open_models
from posse_core._files.reading import FileRecord
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice


class Trusting(FileRecord):
    """How many photographs have a trusted pose.

    Attributes:
        photographs: number of all of them.
        before: number of those with the recipe's nets.
        after: with the nets that have learned from these.
        kept: both before and after.
    """

    photographs: int
    before: int
    after: int
    kept: int


class Compared(FileRecord):
    """The accuracy on frames that the nets have not learned from.

    Attributes:
        name: of the frames.
        frames: number of them.
        before: metric → value of the recipe's nets, as of ``posse eval``.
        after: of the nets that were carried on.
    """

    name: str
    frames: int
    before: dict[str, float]
    after: dict[str, float]


class Figures(FileRecord):
    """What came of it.

    Attributes:
        learned: number of images of the target domain that the nets have learned from.
        trusting: of photographs; None of labelled images.
        compared: accuracy before and after.
    """

    learned: int
    trusting: Trusting | None
    compared: list[Compared]


def trusting(before: Sequence[Found], after: Sequence[Found], least: float) -> Trusting:
    """Count the photographs with trusted poses.

    Args:
        before: what was found in each photograph.
        after: likewise, in the same order.
        least: trust of a trusted pose.
    """
    pairs = [(a.is_trusted(least), b.is_trusted(least)) for a, b in zip(before, after, strict=True)]
    return Trusting(
        photographs=len(pairs),
        before=sum(a for a, _ in pairs),
        after=sum(b for _, b in pairs),
        kept=sum(a and b for a, b in pairs),
    )


def accuracy(
    dataset: LabelledImages,
    positions: Iterable[int],
    models: Sequence[Path],
    spacecraft: Spacecraft,
    refiner: ComponentChoice | None,
    registry: Registry,
) -> dict[str, float]:
    """The metrics of ``posse eval`` on all of some frames.

    Args:
        dataset: of the frames.
        positions: of the frames in it.
        models: files of the nets for boxes and for keypoints.
        spacecraft: that they know.
        refiner: of poses; None refines none.
        registry: the installed components.
    """
    detector, finder = open_models(models[0], models[1], registry, {})
    with contextlib.closing(target_shapes(spacecraft, registry, refiner)) as shapes:
        judged = evaluate(dataset, positions, detector, finder, shapes)
    return dict(groups(dataset, judged)[0].metrics)
