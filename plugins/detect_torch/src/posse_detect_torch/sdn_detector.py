"""The component of SDN, trained as in the thesis.

It uses SGD at a constant learning rate, and batch norms keep their statistics in small batches.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from posse_core import LabelledImages, ModelCard
from posse_detect_torch.batches import Batch
from posse_detect_torch.box_detector import BoxDetector, BoxLesson
from posse_detect_torch.imagenet import load_imagenet
from posse_detect_torch.options import SdnOptions, trained_with
from posse_detect_torch.regions import iou_matrix
from posse_detect_torch.sdn import PROPOSALS, Decoded, Sdn, proposals
from posse_detect_torch.sdn_losses import losses

_MOMENTUM = 0.9
_SMALL_BATCH = 32  # largest batch with which batch norms keep their statistics (thesis, Section 4.1)


class SdnLesson(BoxLesson):
    """The lesson of :class:`posse_detect_torch.sdn.Sdn`."""

    net: Sdn
    options: SdnOptions
    clip = 5.0
    average = 0.0

    def __init__(
        self, dataset: LabelledImages, folder: Path, classes: Sequence[str], options: SdnOptions
    ) -> None:
        super().__init__(dataset, folder, classes, options)
        means = [float(self.train.linear(position).mean()) for position in range(len(self.train))]
        self.net.mean_pixel.fill_(float(np.mean(means)) if means else 0.0)

    def untrained(self) -> Sdn:
        net = _net(len(self.classes), self.options)
        if self.options.backbone_weights is not None:
            load_imagenet(net.backbone, self.options.backbone_weights)
        return net

    def optimizer(self, net: nn.Module) -> torch.optim.Optimizer:
        return torch.optim.SGD(
            net.parameters(), momentum=_MOMENTUM, weight_decay=self.options.weight_decay
        )

    def rate(self, step: int, steps: int) -> float:
        return 1.0

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        if self.options.batch <= _SMALL_BATCH:
            for module in self.net.modules():
                if isinstance(module, nn.BatchNorm2d | nn.BatchNorm1d):
                    module.eval()
        draw = int(batch["draw"][0])
        truth = batch["boxes"], batch["labels"]
        return losses(self.net, batch["picture"], *truth, draw, self.options.regions)

    def decoded(self, net: nn.Module) -> nn.Module:
        assert isinstance(net, Sdn)
        return Decoded(net, self.options.least_score)

    @torch.inference_mode()
    def judge(self, net: nn.Module) -> dict[str, float]:
        """Return metrics of the detections, and the recall of the proposals with and without NMS."""
        metrics = super().judge(net)
        if not metrics:
            return metrics
        assert isinstance(net, Sdn)
        device = next(net.parameters()).device
        for suppress, words in ((True, ""), (False, " without NMS")):
            found, true = [], []
            for position in range(len(self.valid)):
                picture = torch.from_numpy(self.valid.linear(position))[None, None].to(device)
                _, logits, deltas = net.features(picture)
                boxes = proposals(logits, deltas, self.options.input_px, PROPOSALS, suppress)[0]
                found.append(boxes[boxes[:, 2] > boxes[:, 0]].cpu())
                true.append(torch.from_numpy(self.target(self.valid, position)[0]).float())
            recall = proposal_recall(found, true)
            metrics |= {f"valid {name}{words}": value for name, value in recall.items()}
        return metrics


def proposal_recall(proposals: Sequence[Tensor], true: Sequence[Tensor]) -> dict[str, float]:
    """Return AR100 and AR1k at an IoU of 0.5, as in the thesis' Table 5.2.

    They are the shares of true boxes with an IoU of at least 0.5 with one of the best 100, or 1000,
    proposals; 0 where there are no true boxes.

    Args:
        proposals: (K, 4) of each image, left, top, right, bottom, best first.
        true: (M, 4) of each image.
    """
    count = sum(map(len, true))
    return {
        name: sum(
            int((iou_matrix(found[:most], boxes) >= 0.5).any(dim=0).sum())
            for found, boxes in zip(proposals, true, strict=True)
        )
        / max(count, 1)
        for name, most in (("AR100", 100), ("AR1k", 1000))
    }


class SdnDetector(BoxDetector[SdnOptions]):
    """Finds spacecraft with :class:`posse_detect_torch.sdn.Sdn`."""

    name = "sdn"

    def lesson(self, dataset: LabelledImages, folder: Path, card: ModelCard) -> SdnLesson:
        return SdnLesson(dataset, folder, card.classes, self.options)

    def net(self, card: ModelCard) -> Sdn:
        return _net(len(card.classes), trained_with(card, SdnOptions))

    def decoded(self, net: nn.Module) -> nn.Module:
        assert isinstance(net, Sdn)
        return Decoded(net, self.options.least_score)


def _net(classes: int, options: SdnOptions) -> Sdn:
    return Sdn(classes, options.depth, options.sampling)
