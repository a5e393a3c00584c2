"""Rules by which frames are dropped (thesis, Section 3.5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from posse_core._dataset.remarks import (
    DARK_LEVEL_SHARE,
    DARK_PIXEL_SHARE,
    ECLIPSE_DISC_SHARE,
    in_eclipse,
    is_dark,
)
from posse_core._errors import InputError
from posse_core._model.label_line import LabelLine
from posse_core._model.labels import VISIBLE
from posse_core._plugins.options import nearest

if TYPE_CHECKING:
    from posse_core._dataset.dataset import Dataset

ENOUGH_KEYPOINTS = 3


@dataclass(frozen=True)
class Rule:
    """A rule that drops frames.

    Attributes:
        name: of the rule.
        why: the condition, in words.
        drops: says whether a frame is dropped, from its dataset and labels.
        needs: names of the labels that ``drops`` needs.
    """

    name: str
    why: str
    drops: Callable[[Dataset, LabelLine], bool]
    needs: Sequence[str]


def _eclipse(dataset: Dataset, labels: LabelLine) -> bool:
    return in_eclipse(labels)


def _dark(dataset: Dataset, labels: LabelLine) -> bool:
    craft = dataset.image(dataset.position(labels.index))[labels.mask_rle.mask()]
    return len(craft) == 0 or is_dark(craft)


def _few_keypoints(dataset: Dataset, labels: LabelLine) -> bool:
    seen = [name for name, point in labels.keypoints.items() if point.visibility == VISIBLE]
    return len(seen) < ENOUGH_KEYPOINTS


RULES = {
    rule.name: rule
    for rule in (
        Rule(
            "eclipse",
            f"less than {ECLIPSE_DISC_SHARE:.0%} of the Sun's disc is visible from the target or from"
            " the camera",
            _eclipse,
            ("sun_fraction_target", "sun_fraction_camera"),
        ),
        Rule(
            "few-keypoints",
            f"fewer than {ENOUGH_KEYPOINTS} of the target's keypoints are visible",
            _few_keypoints,
            ("keypoints",),
        ),
        Rule(
            "dark",
            f"{DARK_PIXEL_SHARE:.0%} of the target's pixels are below {DARK_LEVEL_SHARE:.0%} of the"
            " full scale",
            _dark,
            ("mask_rle",),
        ),
    )
}
"""All rules by name, fast ones first. A frame is counted for the first rule that drops it."""


def named(names: Sequence[str]) -> list[Rule]:
    """Return the rules of these names, in the order of :data:`RULES`.

    Raises:
        InputError: There is no rule of a name.
    """
    for name in names:
        if name not in RULES:
            raise InputError(f"no rule {name!r}{nearest(name, RULES)}; rules are {', '.join(RULES)}")
    return [rule for rule in RULES.values() if rule.name in names]


def first_that_drops(rules: Sequence[Rule], dataset: Dataset, labels: LabelLine) -> Rule | None:
    """Return the first rule that drops a frame, or None if the frame is kept.

    Raises:
        InputError: The labels lack what a rule needs.
    """
    for rule in rules:
        for key in rule.needs:
            if not labels.has(key):
                raise InputError(
                    f"{dataset.folder}: frame {labels.index} has no {key!r}, which the rule"
                    f" {rule.name!r} needs"
                )
        if rule.drops(dataset, labels):
            return rule
    return None
