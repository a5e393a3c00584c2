"""The network of the light detector ``nano``: one map of stride 8, no anchors.

The network computes a map for each class whose maxima are the centres of the spacecraft (Zhou, Wang and
Krähenbühl 2019). Each cell of the map also predicts its distances to the four sides of the box, which
are learned at many cells around the centre (TTFNet, Liu et al. 2020). Local maxima are found by max
pooling, so the graph needs no non-maximum suppression.
"""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from posse_detect_torch.features import STRIDE, Features, exact
from posse_detect_torch.options import Size

_PRIOR = 0.01  # value of the class maps before training
_SPREAD = (
    0.54 / 6
)  # standard deviation of the target around a centre, as a share of the box's side (TTFNet)


class Nano(nn.Module):
    """The network: grey pictures (B, 1, S, S) → class logits and distances.

    Pictures are 0 … 1 and linear in radiance. The class logits are (B, C, S/8, S/8). The distances
    (B, 4, S/8, S/8) are the logarithms of those to the left, top, right and bottom side of the box, in
    strides.
    """

    def __init__(self, classes: int, size: Size = "nano") -> None:
        super().__init__()
        self.features = Features(size)
        self.classify = nn.Conv2d(self.features.width, classes, 1)
        self.measure = nn.Conv2d(self.features.width, 4, 1)
        nn.init.constant_(self.classify.bias, -math.log(1 / _PRIOR - 1))  # type: ignore[arg-type]
        nn.init.constant_(self.measure.bias, 1.0)  # type: ignore[arg-type]

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor]:
        y = self.features(picture)
        return exact(self.classify, y), exact(self.measure, y)


def centres(size: int, device: torch.device) -> Tensor:
    """Return the centres (size², 2) x, y of a map's cells in pixels of the picture, row by row."""
    along = (torch.arange(size, device=device, dtype=torch.float32) + 0.5) * STRIDE
    y, x = torch.meshgrid(along, along, indexing="ij")
    return torch.stack([x, y], dim=-1).reshape(-1, 2)


def boxes_at(distances: Tensor) -> Tensor:
    """Convert distances (B, 4, s, s) of :class:`Nano` to boxes (B, s², 4): left, top, right, bottom."""
    size = distances.shape[-1]
    away = STRIDE * torch.exp(torch.clamp(distances, max=math.log(4 * size))).flatten(2).transpose(1, 2)
    middle = centres(size, distances.device)
    return torch.cat([middle - away[..., :2], middle + away[..., 2:]], dim=-1)


class Decoded(nn.Module):
    """The network with its decoding, as it is exported.

    Pictures (B, 1, S, S) → boxes (B, K, 4) x, y, width, height in pixels of the picture; scores
    (B, K), in descending order; labels (B, K) int64; raw (B, C + 4, S/8, S/8).
    """

    def __init__(self, net: Nano, detections: int) -> None:
        super().__init__()
        self.net, self.detections = net, detections

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        logits, distances = self.net(picture)
        peak = F.max_pool2d(logits, 3, stride=1, padding=1) == logits
        cells = logits.shape[-1] * logits.shape[-2]
        found = torch.where(peak, torch.sigmoid(logits), 0.0).flatten(1)
        scores, chosen = torch.topk(found, self.detections, dim=1)
        labels, cell = chosen // cells, chosen % cells
        boxes = torch.gather(boxes_at(distances), 1, cell[..., None].expand(-1, -1, 4))
        boxes = torch.cat([boxes[..., :2], boxes[..., 2:] - boxes[..., :2]], dim=-1)
        return boxes, scores, labels, torch.cat([logits, distances], dim=1)


def losses(logits: Tensor, distances: Tensor, boxes: Tensor, labels: Tensor) -> dict[str, Tensor]:
    """Return the focal loss of the maps, and of the boxes the generalised IoU and log distance losses.

    Args:
        logits, distances: outputs of :class:`Nano`.
        boxes: (B, M, 4) left, top, right, bottom in pixels.
        labels: (B, M) int64, −1 where a picture has fewer than M boxes.
    """
    near, at_centre = _nearness(logits.shape[-1], boxes)  # (B, M, cells)
    real = (labels >= 0)[..., None]
    classes = F.one_hot(labels.clamp(min=0), logits.shape[1]).bool()  # (B, M, C)
    mine = (classes & real)[..., None]  # (B, M, C, 1)
    target = torch.where(mine, near[:, :, None], 0.0).amax(dim=1)
    positive = (mine & at_centre[:, :, None]).any(dim=1)
    flat = logits.flatten(2)
    p = torch.sigmoid(flat)
    for_peak = (1 - p) ** 2 * F.logsigmoid(flat)
    for_rest = (1 - target) ** 4 * p**2 * F.logsigmoid(-flat)
    count = real.sum().clamp(min=1)
    heat = -torch.where(positive, for_peak, for_rest).sum() / count

    weight = torch.where(near > 0.1, near, 0.0) * real
    weight = weight / weight.sum(dim=2, keepdim=True).clamp(min=1e-6)
    overlap = generalised_iou(boxes_at(distances)[:, None], boxes[:, :, None])
    cell = centres(logits.shape[-1], boxes.device)
    away = torch.cat([cell - boxes[:, :, None, :2], boxes[:, :, None, 2:] - cell], dim=-1)
    wanted = torch.log(away.clamp(min=1.0) / STRIDE)  # (B, M, cells, 4)
    predicted = distances.flatten(2).transpose(1, 2)[:, None].expand_as(wanted)
    off = F.smooth_l1_loss(predicted, wanted, reduction="none", beta=0.1).sum(dim=-1)
    return {
        "heat": heat,
        "overlap": 2.0 * (weight * (1 - overlap)).sum() / count,
        "sides": (weight * off).sum() / count,  # has a gradient even where a box has shrunk to a point
    }


def _nearness(size: int, boxes: Tensor) -> tuple[Tensor, Tensor]:
    """Return the targets of the class maps, and which cell contains the centre of each box.

    The targets (B, M, size²) are Gaussians in proportion to the boxes' sides, with 1 at the cell that
    contains a box's centre; the second result is true at that cell.
    """
    centre = centres(size, boxes.device)
    middle = (boxes[..., :2] + boxes[..., 2:]) / 2
    cell = (torch.clamp((middle / STRIDE).floor(), 0, size - 1) + 0.5) * STRIDE
    away = centre - cell[..., None, :]
    sides = (boxes[..., 2:] - boxes[..., :2]).clamp(min=1.0)
    deviation = (_SPREAD * sides).clamp(min=STRIDE / 4)[..., None, :]
    near = torch.exp(-0.5 * ((away / deviation) ** 2).sum(dim=-1))
    return near, (away == 0).all(dim=-1)


def generalised_iou(a: Tensor, b: Tensor) -> Tensor:
    """Return the generalised intersection over union (Rezatofighi et al. 2019) of pairs of boxes.

    Boxes are (..., 4): left, top, right, bottom.
    """
    common = (torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])).clamp(min=0)
    hull = torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])
    both, around = common.prod(dim=-1), hull.prod(dim=-1)
    union = (a[..., 2:] - a[..., :2]).prod(dim=-1) + (b[..., 2:] - b[..., :2]).prod(dim=-1) - both
    return both / union.clamp(min=1e-6) - (around - union) / around.clamp(min=1e-6)
