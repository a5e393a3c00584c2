"""The thesis' Spacecraft Detection Network, SDN (Chapter 4): Mask R-CNN without its mask head.

It consists of ResNet-18 or -50, a feature pyramid P2–P6, region proposals from anchors, RoIAlign and two
dense layers. Every convolution has a bias, as in the code that SDN was derived from. Counted with the
running statistics of the batch norms, as that code does, it has the thesis' numbers of parameters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from posse_detect_torch.features import exact
from posse_detect_torch.regions import BINS, nms_padded, pyramid_roi_align, roi_align

STRIDES = (4, 8, 16, 32, 64)
SCALES = (32.0, 64.0, 128.0, 256.0, 512.0)
RATIOS = (0.5, 1.0, 2.0)
DELTA_SCALE = (0.1, 0.1, 0.2, 0.2)  # standard deviations by which the predicted deltas are scaled
PROPOSALS = 1000
_BEFORE_NMS, _PROPOSAL_OVERLAP = 6000, 0.7
_DETECTION_OVERLAP, DETECTIONS = 0.3, 100
_WIDTH, _DENSE = 256, 1024
_EPS, _MOMENTUM = 1e-3, 0.01  # of the batch norms, as in Keras


def _norm(width: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(width, eps=_EPS, momentum=_MOMENTUM)


class _Basic(nn.Module):
    """A residual block of two 3 × 3 convolutions."""

    widening = 1

    def __init__(self, inward: int, width: int, stride: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(inward, width, 3, stride, 1),
            _norm(width),
            nn.ReLU(),
            nn.Conv2d(width, width, 3, 1, 1),
            _norm(width),
        )
        self.shortcut = _shortcut(inward, width, stride)

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.body(x) + self.shortcut(x))


class _Bottleneck(nn.Module):
    """A residual block of 1 × 1 (with the stride, He et al. 2015), 3 × 3 and 1 × 1 convolutions."""

    widening = 4

    def __init__(self, inward: int, width: int, stride: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(inward, width, 1, stride),
            _norm(width),
            nn.ReLU(),
            nn.Conv2d(width, width, 3, 1, 1),
            _norm(width),
            nn.ReLU(),
            nn.Conv2d(width, 4 * width, 1),
            _norm(4 * width),
        )
        self.shortcut = _shortcut(inward, 4 * width, stride)

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.body(x) + self.shortcut(x))


def _shortcut(inward: int, outward: int, stride: int) -> nn.Module:
    if inward == outward and stride == 1:
        return nn.Identity()
    return nn.Sequential(nn.Conv2d(inward, outward, 1, stride), _norm(outward))


class Backbone(nn.Module):
    """ResNet with a feature pyramid: pictures (B, 1, S, S) → P2 … P6.

    P2 is (B, 256, S/4, S/4), and each further level has half the size, down to S/64.
    """

    def __init__(self, depth: int) -> None:
        super().__init__()
        block: type[_Basic] | type[_Bottleneck] = _Basic if depth == 18 else _Bottleneck
        blocks = {18: (2, 2, 2, 2), 50: (3, 4, 6, 3)}[depth]
        self.stem = nn.Sequential(nn.Conv2d(1, 64, 7, 2, 3), _norm(64), nn.ReLU(), nn.MaxPool2d(3, 2, 1))
        stages, widths, inward = [], [], 64
        for number, count in enumerate(blocks):
            width, stage = 64 * 2**number, []
            for i in range(count):
                stage.append(block(inward, width, 2 if i == 0 and number > 0 else 1))
                inward = width * block.widening
            stages.append(nn.Sequential(*stage))
            widths.append(inward)
        self.stages = nn.ModuleList(stages)
        self.lateral = nn.ModuleList(nn.Conv2d(width, _WIDTH, 1) for width in widths)
        self.smooth = nn.ModuleList(nn.Conv2d(_WIDTH, _WIDTH, 3, 1, 1) for _ in widths)

    def forward(self, picture: Tensor) -> list[Tensor]:
        x = self.stem(picture)
        features = []
        for stage, lateral in zip(self.stages, self.lateral, strict=True):
            x = stage(x)
            features.append(lateral(x))
        for i in (2, 1, 0):
            features[i] = features[i] + F.interpolate(features[i + 1], scale_factor=2.0, mode="nearest")
        pyramid = [smooth(level) for smooth, level in zip(self.smooth, features, strict=True)]
        return [*pyramid, F.max_pool2d(pyramid[-1], 1, 2)]


class ProposalHead(nn.Module):
    """Takes the pyramid to the anchors' logits (B, A, 2), background first, and deltas (B, A, 4)."""

    def __init__(self) -> None:
        super().__init__()
        self.shared = nn.Conv2d(_WIDTH, 512, 3, 1, 1)
        self.classify = nn.Conv2d(512, 2 * len(RATIOS), 1)
        self.move = nn.Conv2d(512, 4 * len(RATIOS), 1)

    def forward(self, pyramid: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        shared = [F.relu(self.shared(level)) for level in pyramid]
        logits = [_by_anchor(exact(self.classify, x), 2) for x in shared]
        deltas = [_by_anchor(exact(self.move, x), 4) for x in shared]
        return torch.cat(logits, dim=1), torch.cat(deltas, dim=1)


def _by_anchor(maps: Tensor, numbers: int) -> Tensor:
    """Return what the maps (B, K n, h, w) of K anchors say of each: (B, h w K, n)."""
    return maps.permute(0, 2, 3, 1).reshape(maps.shape[0], -1, numbers)


class RegionHead(nn.Module):
    """Takes regions (N, 256, 7, 7) to class logits (N, C + 1) and deltas (N, C + 1, 4).

    The background is the first class.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.dense = nn.Sequential(
            nn.Flatten(),
            nn.Linear(_WIDTH * BINS**2, _DENSE),
            nn.BatchNorm1d(_DENSE, eps=_EPS, momentum=_MOMENTUM),
            nn.ReLU(),
            nn.Linear(_DENSE, _DENSE),
            nn.BatchNorm1d(_DENSE, eps=_EPS, momentum=_MOMENTUM),
            nn.ReLU(),
        )
        self.classify = nn.Linear(_DENSE, classes + 1)
        self.move = nn.Linear(_DENSE, 4 * (classes + 1))

    def forward(self, regions: Tensor) -> tuple[Tensor, Tensor]:
        x = self.dense(regions)
        return exact(self.classify, x), exact(self.move, x).reshape(x.shape[0], -1, 4)


class Sdn(nn.Module):
    """The network. Pictures are grey, 0 … 1; ``mean_pixel`` is the mean of the training data.

    Args:
        classes: number of spacecraft, without the background.
        depth: number of layers of the ResNet, 18 or 50.
        sampling: samples along each axis of a region's bin; the thesis' code has one.
    """

    mean_pixel: Tensor

    def __init__(self, classes: int, depth: int, sampling: int) -> None:
        super().__init__()
        self.sampling = sampling
        self.backbone = Backbone(depth)
        self.propose = ProposalHead()
        self.judge = RegionHead(classes)
        self.register_buffer("mean_pixel", torch.zeros(()))

    def features(self, picture: Tensor) -> tuple[list[Tensor], Tensor, Tensor]:
        """Return the pyramid, and the anchors' logits and deltas.

        The backbone's input is the picture minus the mean, scaled to 0 … 255.
        """
        levels = self.backbone(255 * (picture - self.mean_pixel))
        pyramid = [level.float() for level in levels]  # regions are cut from it in full precision
        return pyramid, *self.propose(pyramid)

    def classify_regions(self, pyramid: Sequence[Tensor], rois: Tensor) -> tuple[Tensor, Tensor]:
        """Return class logits (B, R, C + 1) and deltas (B, R, C + 1, 4) of regions (B, R, 4)."""
        regions = self.align(pyramid, rois)
        logits, deltas = self.judge(regions.flatten(0, 1))
        return logits.unflatten(0, rois.shape[:2]), deltas.unflatten(0, rois.shape[:2])

    def align(self, pyramid: Sequence[Tensor], rois: Tensor) -> Tensor:
        """Return features (B, R, 256, 7, 7); a region's size decides its level (Lin et al. 2017)."""
        p2, p3, p4, p5 = pyramid[:4]
        level = level_of(rois)
        if self.training:  # the operation that the exporter needs has no gradient
            return pyramid_roi_align((p2, p3, p4, p5), rois, level, self.sampling)
        aligned: Tensor = roi_align(p2, p3, p4, p5, rois, level, self.sampling)
        return aligned


def level_of(rois: Tensor) -> Tensor:
    """Return each region's pyramid level (B, R) int64, 0 for P2 … 3 for P5; 224 px belong to P4."""
    size = (rois[..., 2:] - rois[..., :2]).clamp(min=1e-3).prod(dim=-1).sqrt()
    return (4 + torch.round(torch.log2(size / 224))).clamp(2, 5).long() - 2


def anchors(size: int, device: torch.device) -> Tensor:
    """Return all anchors (A, 4): left, top, right, bottom.

    They are ordered by level, row, column, ratio (height by width), and centred on the corners of the
    map's cells, as in the code that SDN was derived from.
    """
    levels = []
    for stride, scale in zip(STRIDES, SCALES, strict=True):
        along = torch.arange(math.ceil(size / stride), device=device, dtype=torch.float32) * stride
        y, x = torch.meshgrid(along, along, indexing="ij")
        ratio = torch.tensor(RATIOS, device=device).sqrt()
        half = torch.stack([scale / ratio, scale * ratio], dim=-1) / 2
        middle = torch.stack([x, y], dim=-1)[:, :, None]
        levels.append(torch.cat([middle - half, middle + half], dim=-1).reshape(-1, 4))
    return torch.cat(levels)


def moved(boxes: Tensor, deltas: Tensor) -> Tensor:
    """Move boxes (..., 4) by deltas (..., 4) of y, x, log height and log width (thesis, eq. 4.1)."""
    dy, dx, dh, dw = (deltas * deltas.new_tensor(DELTA_SCALE)).unbind(dim=-1)
    left, top, right, bottom = boxes.unbind(dim=-1)
    width, height = right - left, bottom - top
    x, y = (left + right) / 2 + dx * width, (top + bottom) / 2 + dy * height
    half_w = width * torch.exp(dw.clamp(max=4.0)) / 2
    half_h = height * torch.exp(dh.clamp(max=4.0)) / 2
    return torch.stack([x - half_w, y - half_h, x + half_w, y + half_h], dim=-1)


def deltas_between(boxes: Tensor, goals: Tensor) -> Tensor:
    """Return the deltas (..., 4) by which :func:`moved` takes boxes to goals."""
    size, goal = (b[..., 2:] - b[..., :2] for b in (boxes, goals))
    away = ((goals[..., :2] + goals[..., 2:]) - (boxes[..., :2] + boxes[..., 2:])) / 2 / size
    both = torch.cat([away.flip(-1), torch.log(goal / size).flip(-1)], dim=-1)
    return both / both.new_tensor(DELTA_SCALE)


def proposals(logits: Tensor, deltas: Tensor, size: int, most: int, suppress: bool = True) -> Tensor:
    """Return the best regions (B, most, 4), best first, padded with empty boxes at 0.

    Args:
        logits, deltas: of the anchors, from :meth:`Sdn.features`.
        size: side of the picture, px.
        most: number of regions.
        suppress: whether to drop regions that overlap a better one (the thesis' Table 5.2 has both).
    """
    score = torch.softmax(logits, dim=-1)[..., 1]
    score, index = torch.topk(score, min(_BEFORE_NMS, score.shape[1]), dim=1)
    best = torch.gather(deltas, 1, index[..., None].expand(-1, -1, 4))
    boxes = moved(anchors(size, logits.device)[index], best).clamp(0, size)
    if not suppress:
        return boxes[:, :most]
    return _taken(boxes, nms_padded(boxes, score, _PROPOSAL_OVERLAP, most))


def _taken(values: Tensor, indices: Tensor) -> Tensor:
    """Return the rows (B, K, n) of values (B, M, n) at indices (B, K); zeros where an index is −1."""
    rows = torch.gather(values, 1, indices.clamp(min=0)[..., None].expand(-1, -1, values.shape[-1]))
    padded: Tensor = rows * (indices >= 0)[..., None]
    return padded


class Decoded(nn.Module):
    """The network with proposals and detections, as it is exported.

    Pictures (B, 1, S, S) → boxes (B, 100, 4) x, y, width, height; scores (B, 100), in descending order;
    labels (B, 100) int64, −1 after the last; raw (B, A, 6), logits and deltas of the anchors.
    """

    def __init__(self, net: Sdn, least_score: float) -> None:
        super().__init__()
        self.net, self.least_score = net, least_score

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        size = picture.shape[-1]
        pyramid, logits, deltas = self.net.features(picture)
        rois = proposals(logits, deltas, size, PROPOSALS)
        classes, moves = self.net.classify_regions(pyramid, rois)
        score, label = torch.softmax(classes, dim=-1).max(dim=-1)
        move = torch.gather(moves, 2, label[..., None, None].expand(-1, -1, 1, 4))[:, :, 0]
        boxes = moved(rois, move).clamp(0, size)
        real = (label > 0) & (score >= self.least_score) & (rois[..., 2] > rois[..., 0])
        score = torch.where(real, score, 0.0)
        apart = boxes + (2.0 * size * label)[..., None]  # so that classes do not suppress each other
        kept = nms_padded(apart, score, _DETECTION_OVERLAP, DETECTIONS)
        found = _taken(torch.cat([boxes, score[..., None]], dim=-1), kept)
        labels = torch.gather(label, 1, kept.clamp(min=0)) - 1
        labels = torch.where(kept >= 0, labels, -1)
        ends = found[..., :4]
        sides = torch.cat([ends[..., :2], ends[..., 2:] - ends[..., :2]], dim=-1)
        return sides, found[..., 4], labels, torch.cat([logits, deltas], dim=-1)
