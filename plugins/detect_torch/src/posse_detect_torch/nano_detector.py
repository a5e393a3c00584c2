"""The light detector as a component."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from posse_core.dataset import Dataset
from posse_core.detection.card import ModelCard
from posse_core.model.arrays import AnyArray
from posse_detect_torch.box_detector import BoxDetector, BoxLesson
from posse_detect_torch.export import Outputs, compare_detections
from posse_detect_torch.learn import Batch, seeded
from posse_detect_torch.nano import Decoded, Nano, losses
from posse_detect_torch.options import NanoOptions


class NanoLesson(BoxLesson):
    """What :class:`posse_detect_torch.nano.Nano` learns."""

    net: Nano

    def __init__(
        self, dataset: Dataset, folder: Path, classes: Sequence[str], options: NanoOptions
    ) -> None:
        super().__init__(dataset, folder, classes, options)
        self._detections = options.detections
        self.net = seeded(options, lambda: Nano(len(classes)))

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        logits, distances = self.net(batch["picture"])
        return losses(logits, distances, batch["boxes"], batch["labels"])

    def decoded(self, net: nn.Module) -> nn.Module:
        assert isinstance(net, Nano)
        return Decoded(net, self._detections)


class NanoDetector(BoxDetector):
    """Finds spacecraft with :class:`posse_detect_torch.nano.Nano`."""

    name = "nano"
    options: NanoOptions

    def lesson(self, dataset: Dataset, folder: Path, card: ModelCard) -> NanoLesson:
        return NanoLesson(dataset, folder, card.classes, self.options)

    def net(self, card: ModelCard) -> Nano:
        return Nano(len(card.classes))

    def decoded(self, net: nn.Module) -> nn.Module:
        assert isinstance(net, Nano)
        return Decoded(net, self.options.detections)

    def compare(self, ours: Outputs, theirs: Outputs) -> Mapping[str, tuple[float, float]]:
        """As every detector; where neighbours tie, either is the peak."""
        return compare_detections(ours, theirs, tied_scores(ours["raw"][0, : len(self.classes)]))


def tied_scores(logits: AnyArray) -> list[float]:
    """Scores of those peaks of the maps (C, h, w) that have another within 10⁻⁴ beside them."""
    maps = torch.from_numpy(logits)
    peak = maps >= F.max_pool2d(maps, 3, stride=1, padding=1) - 1e-4
    around = 9 * F.avg_pool2d(peak.float(), 3, stride=1, padding=1)  # how many, itself included
    scores: list[float] = torch.sigmoid(maps[peak & (around > 1.5)].double()).tolist()
    return scores
