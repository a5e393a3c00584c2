"""The light detector: depthwise convolutions, one map of stride 8, an anchor-free head.

Each class has a map of where its craft's middle is (Zhou, Wang and Krähenbühl 2019); each place tells
its distance to the box's four sides, learned at many places around the middle (Liu et al. 2020, TTFNet).
A craft is a local maximum of the map, found by pooling: the graph has no NMS.
"""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor, nn

STRIDE = 8
_WIDTHS = (48, 96, 192, 320)
_DEPTHS = (2, 3, 3)
WIDTH = 112
"""Channels of the features."""
_PRIOR = 0.01  # what the class maps say before any training
_SPREAD = 0.54 / 6  # deviation of the target around a middle, in sides of the box (TTFNet)


def conv(inward: int, outward: int, kernel: int, stride: int = 1, groups: int = 1) -> nn.Sequential:
    """Convolution and batch norm."""
    return nn.Sequential(
        nn.Conv2d(inward, outward, kernel, stride, kernel // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outward),
    )


class Separable(nn.Module):
    """Depthwise 5 × 5, then 1 × 1; with a shortcut where shapes allow."""

    def __init__(self, inward: int, outward: int, stride: int = 1) -> None:
        super().__init__()
        self.depthwise = conv(inward, inward, 5, stride, groups=inward)
        self.pointwise = conv(inward, outward, 1)
        self.shortcut = inward == outward and stride == 1

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu(self.pointwise(F.relu(self.depthwise(x))))
        return x + y if self.shortcut else y


class Stem(nn.Sequential):
    """Grey pictures (B, 1, S, S) → (B, C, S/4, S/4) at once: maps of a greater size would cost more time
    than all that follows."""

    def __init__(self, width: int) -> None:
        super().__init__(conv(1, width, 7, stride=4), nn.ReLU(), Separable(width, width))


class Pyramid(nn.Module):
    """Grey pictures (B, 1, S, S), 0 … 1 in linear light → features (B, :data:`WIDTH`, S/8, S/8)."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = Stem(_WIDTHS[0])
        stages = []
        for depth, inward, outward in zip(_DEPTHS, _WIDTHS[:-1], _WIDTHS[1:], strict=True):
            blocks = [Separable(inward, outward, 2)]
            blocks += [Separable(outward, outward) for _ in range(depth)]
            stages.append(nn.Sequential(*blocks))
        self.stages = nn.ModuleList(stages)
        self.lateral = nn.ModuleList(conv(width, WIDTH, 1) for width in _WIDTHS[1:])
        self.merge = nn.ModuleList(Separable(WIDTH, WIDTH) for _ in _WIDTHS[2:])
        self.head = nn.Sequential(Separable(WIDTH, WIDTH), Separable(WIDTH, WIDTH))

    def forward(self, picture: Tensor) -> Tensor:
        x = self.stem(torch.sqrt(picture))
        levels = []
        for stage in self.stages:
            x = stage(x)
            levels.append(x)
        pyramid = [lateral(level) for lateral, level in zip(self.lateral, levels, strict=True)]
        y = pyramid[-1]
        for merge, level in zip(self.merge, reversed(pyramid[:-1]), strict=True):
            y = merge(level + F.interpolate(y, scale_factor=2.0, mode="nearest"))
        return self.head(y)  # type: ignore[no-any-return]


class Nano(nn.Module):
    """Grey pictures (B, 1, S, S), 0 … 1 in linear light → class logits (B, C, S/8, S/8), and the
    logarithms of distances to left, top, right, bottom in strides (B, 4, S/8, S/8)."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.pyramid = Pyramid()
        self.classify = nn.Conv2d(WIDTH, classes, 1)
        self.measure = nn.Conv2d(WIDTH, 4, 1)
        nn.init.constant_(self.classify.bias, -math.log(1 / _PRIOR - 1))  # type: ignore[arg-type]
        nn.init.constant_(self.measure.bias, 1.0)  # type: ignore[arg-type]

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor]:
        y = self.pyramid(picture)
        return self.classify(y), self.measure(y)


def centres(size: int, device: torch.device) -> Tensor:
    """(size², 2) x, y of the places of a map, in pixels of the picture, row by row."""
    along = (torch.arange(size, device=device, dtype=torch.float32) + 0.5) * STRIDE
    y, x = torch.meshgrid(along, along, indexing="ij")
    return torch.stack([x, y], dim=-1).reshape(-1, 2)


def boxes_at(distances: Tensor) -> Tensor:
    """(B, 4, s, s) of :class:`Nano` → (B, s², 4) left, top, right, bottom in pixels."""
    size = distances.shape[-1]
    away = STRIDE * torch.exp(torch.clamp(distances, max=math.log(4 * size))).flatten(2).transpose(1, 2)
    middle = centres(size, distances.device)
    return torch.cat([middle - away[..., :2], middle + away[..., 2:]], dim=-1)


class Decoded(nn.Module):
    """The net with its decoding: what is exported.

    Pictures (B, 1, S, S) → boxes (B, K, 4) x, y, width, height in pixels of the picture; scores
    (B, K), falling; labels (B, K) int64; raw (B, C + 4, S/8, S/8).
    """

    def __init__(self, net: Nano, detections: int) -> None:
        super().__init__()
        self.net, self.detections = net, detections

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        logits, distances = self.net(picture)
        peak = F.max_pool2d(logits, 3, stride=1, padding=1) == logits
        places = logits.shape[-1] * logits.shape[-2]
        found = torch.where(peak, torch.sigmoid(logits), 0.0).flatten(1)
        scores, chosen = torch.topk(found, self.detections, dim=1)
        labels, place = chosen // places, chosen % places
        boxes = torch.gather(boxes_at(distances), 1, place[..., None].expand(-1, -1, 4))
        boxes = torch.cat([boxes[..., :2], boxes[..., 2:] - boxes[..., :2]], dim=-1)
        return boxes, scores, labels, torch.cat([logits, distances], dim=1)


def losses(logits: Tensor, distances: Tensor, boxes: Tensor, labels: Tensor) -> dict[str, Tensor]:
    """Focal loss of the maps; of the boxes, generalised overlap and the logarithms of their sides.

    Args:
        logits, distances: of :class:`Nano`.
        boxes: (B, M, 4) left, top, right, bottom in pixels.
        labels: (B, M) int64, −1 where a picture has fewer than M.
    """
    near, at_middle = _nearness(logits.shape[-1], boxes)  # (B, M, places)
    real = (labels >= 0)[..., None]
    classes = F.one_hot(labels.clamp(min=0), logits.shape[1]).bool()  # (B, M, C)
    mine = (classes & real)[..., None]  # (B, M, C, 1)
    target = torch.where(mine, near[:, :, None], 0.0).amax(dim=1)
    positive = (mine & at_middle[:, :, None]).any(dim=1)
    flat = logits.flatten(2)
    p = torch.sigmoid(flat)
    for_peak = (1 - p) ** 2 * F.logsigmoid(flat)
    for_rest = (1 - target) ** 4 * p**2 * F.logsigmoid(-flat)
    count = real.sum().clamp(min=1)
    heat = -torch.where(positive, for_peak, for_rest).sum() / count

    weight = torch.where(near > 0.1, near, 0.0) * real
    weight = weight / weight.sum(dim=2, keepdim=True).clamp(min=1e-6)
    overlap = generalised_iou(boxes_at(distances)[:, None], boxes[:, :, None])
    place = centres(logits.shape[-1], boxes.device)
    away = torch.cat([place - boxes[:, :, None, :2], boxes[:, :, None, 2:] - place], dim=-1)
    wanted = torch.log(away.clamp(min=1.0) / STRIDE)  # (B, M, places, 4)
    told = distances.flatten(2).transpose(1, 2)[:, None].expand_as(wanted)
    off = F.smooth_l1_loss(told, wanted, reduction="none", beta=0.1).sum(dim=-1)
    return {
        "heat": heat,
        "overlap": 2.0 * (weight * (1 - overlap)).sum() / count,
        "sides": (weight * off).sum() / count,  # still pulls where a box has shrunk to a point
    }


def _nearness(size: int, boxes: Tensor) -> tuple[Tensor, Tensor]:
    """(B, M, size²): 1 at the place that holds a box's middle, falling off with its sides; and
    whether a place is that one."""
    place = centres(size, boxes.device)
    middle = (boxes[..., :2] + boxes[..., 2:]) / 2
    cell = (torch.clamp((middle / STRIDE).floor(), 0, size - 1) + 0.5) * STRIDE
    away = place - cell[..., None, :]
    sides = (boxes[..., 2:] - boxes[..., :2]).clamp(min=1.0)
    deviation = (_SPREAD * sides).clamp(min=STRIDE / 4)[..., None, :]
    near = torch.exp(-0.5 * ((away / deviation) ** 2).sum(dim=-1))
    return near, (away == 0).all(dim=-1)


def generalised_iou(a: Tensor, b: Tensor) -> Tensor:
    """Generalised intersection over union (Rezatofighi et al. 2019) of boxes (..., 4) left, top, right,
    bottom, pair by pair."""
    common = (torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])).clamp(min=0)
    hull = torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])
    both, around = common.prod(dim=-1), hull.prod(dim=-1)
    union = (a[..., 2:] - a[..., :2]).prod(dim=-1) + (b[..., 2:] - b[..., :2]).prod(dim=-1) - both
    return both / union.clamp(min=1e-6) - (around - union) / around.clamp(min=1e-6)
