"""The component of the light detector ``nano``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from posse_core import AnyArray, LabelledImages, ModelCard
from posse_detect_torch.batches import Batch
from posse_detect_torch.box_detector import BoxDetector, BoxLesson
from posse_detect_torch.export import Outputs, compare_detections
from posse_detect_torch.nano import Decoded, Nano, losses
from posse_detect_torch.options import NanoOptions, trained_with


class NanoLesson(BoxLesson):
    """The lesson of :class:`posse_detect_torch.nano.Nano`."""

    net: Nano
    options: NanoOptions

    def untrained(self) -> Nano:
        return Nano(len(self.classes), self.options.size)

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        logits, distances = self.net(batch["picture"])
        return losses(logits, distances, batch["boxes"], batch["labels"])

    def decoded(self, net: nn.Module) -> nn.Module:
        assert isinstance(net, Nano)
        return Decoded(net, self.options.detections)


class NanoDetector(BoxDetector[NanoOptions]):
    """Finds spacecraft with :class:`posse_detect_torch.nano.Nano`."""

    name = "nano"

    def lesson(self, dataset: LabelledImages, folder: Path, card: ModelCard) -> NanoLesson:
        return NanoLesson(dataset, folder, card.classes, self.options)

    def net(self, card: ModelCard) -> Nano:
        return Nano(len(card.classes), trained_with(card, NanoOptions).size)

    def decoded(self, net: nn.Module) -> nn.Module:
        assert isinstance(net, Nano)
        return Decoded(net, self.options.detections)

    def compare(self, ours: Outputs, theirs: Outputs) -> Mapping[str, tuple[float, float]]:
        """Compare the outputs, allowing for detections that a tie between scores decides."""
        logits = ours["raw"][0, : len(self.classes)]
        return compare_detections(ours, theirs, tied_scores(logits, self.options.detections))


def tied_scores(logits: AnyArray, count: int) -> list[float]:
    """Return the scores of detections that depend on rounding, because cells tie within 10⁻⁴.

    These are the peaks of the maps (C, h, w) beside an almost equal peak, and all peaks that tie with
    the last of the ``count`` best if there are more.
    """
    maps = torch.from_numpy(logits).double()
    peak = maps >= F.max_pool2d(maps, 3, stride=1, padding=1) - 1e-4
    around = 9 * F.avg_pool2d(peak.double(), 3, stride=1, padding=1)  # number of peaks, including itself
    tied = maps[peak & (around > 1.5)]
    best = maps[peak].sort(descending=True).values
    if len(best) > count and best[count - 1] - best[count] <= 1e-4:
        tied = torch.cat([tied, best[(best - best[count]).abs() <= 1e-4]])
    scores: list[float] = torch.sigmoid(tied).tolist()
    return scores
