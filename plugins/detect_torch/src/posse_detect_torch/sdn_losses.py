"""Targets of anchors and regions by their overlap with the truth, and the thesis' losses (Section 4.1).

The class losses include the background and exclude padding, whose class is −2, as in the thesis.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from posse_detect_torch.regions import iou_matrix
from posse_detect_torch.sdn import Sdn, anchors, deltas_between, proposals

PADDING = -2
_ANCHORS = 256  # per picture
_TRAIN_PROPOSALS = 2000


def losses(
    net: Sdn, picture: Tensor, boxes: Tensor, labels: Tensor, draw: int, regions: int
) -> dict[str, Tensor]:
    """Return the four losses by name.

    Args:
        net: the network.
        picture: (B, 1, S, S).
        boxes: (B, M, 4) left, top, right, bottom.
        labels: (B, M), −1 where there is no box.
        draw: seed of the random choice among anchors and regions.
        regions: largest number of regions to learn from in a picture.
    """
    random = torch.Generator(device=picture.device).manual_seed(draw)
    size = picture.shape[-1]
    pyramid, logits, deltas = net.features(picture)
    fixed = anchors(size, picture.device)
    sort, mine = anchor_targets(fixed, boxes, labels, random)
    goal = deltas_between(fixed, torch.gather(boxes, 1, mine[..., None].expand(-1, -1, 4)))
    result = {
        "proposal class": F.cross_entropy(logits[sort >= 0], sort[sort >= 0]),
        "proposal box": _smooth(deltas[sort == 1], goal[sort == 1]),
    }
    with torch.no_grad():
        found = proposals(logits, deltas, size, _TRAIN_PROPOSALS)
        rois, classes, goals = region_targets(found, boxes, labels, random, regions)
    predicted, moves = net.classify_regions(pyramid, rois)
    known = classes > PADDING
    positive = classes > 0
    move = torch.gather(moves, 2, classes.clamp(min=0)[..., None, None].expand(-1, -1, 1, 4))[:, :, 0]
    result["class"] = (
        F.cross_entropy(predicted[known], classes[known]) if known.any() else predicted.sum() * 0
    )
    result["box"] = _smooth(move[positive], goals[positive])
    return result


def anchor_targets(
    fixed: Tensor, boxes: Tensor, labels: Tensor, random: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Return the targets (B, A) of anchors (A, 4) and the index (B, A) of the best box of each.

    A target is 1 (positive), 0 (negative) or −1 (not used). Anchors whose IoU is 0.7 or more are
    positive, as is the best anchor of each box; those below 0.3 are negative. 256 are used, of which at
    most half are positive.
    """
    real = labels >= 0
    overlap = iou_matrix(fixed, boxes).masked_fill(~real[:, None], 0.0)  # (B, A, M)
    most, mine = overlap.max(dim=2)
    best_of_truth = overlap.amax(dim=1, keepdim=True)
    favourite = ((overlap == best_of_truth) & (best_of_truth > 0)).any(dim=2)
    positive = (most >= 0.7) | favourite
    positive = _some(positive, torch.full_like(labels[:, 0], _ANCHORS // 2), random)
    negative = (most < 0.3) & ~favourite
    negative = _some(negative, _ANCHORS - positive.sum(dim=1), random)
    sort = torch.full_like(mine, -1)
    sort[negative] = 0
    sort[positive] = 1
    return sort, mine


def region_targets(
    found: Tensor, boxes: Tensor, labels: Tensor, random: torch.Generator, most_regions: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Choose regions to learn from, and return them with their classes and deltas.

    Regions whose IoU is 0.5 or more are positive; at most a quarter of ``most_regions`` are, and three
    negatives are taken for each.

    Returns:
        Regions (B, R, 4); classes (B, R), which are 1 + label, 0 for background or −2 for padding; and
        deltas (B, R, 4).
    """
    real = labels >= 0
    overlap = iou_matrix(found, boxes).masked_fill(~real[:, None], 0.0)
    most, mine = overlap.max(dim=2)
    is_region = found[..., 2] > found[..., 0]
    positive = (most >= 0.5) & is_region
    positive = _some(positive, torch.full_like(labels[:, 0], most_regions // 4), random)
    negative = (most < 0.5) & is_region
    negative = _some(negative, 3 * positive.sum(dim=1), random)
    rank = torch.argsort(2 * positive.int() + negative.int(), dim=1, descending=True, stable=True)
    fullest = int((positive | negative).sum(dim=1).max())
    rank = rank[:, : min(max(fullest, 1), most_regions)]  # drops what is padding in every picture
    classes = torch.full_like(mine, PADDING)
    classes[negative] = 0
    classes = torch.where(positive, 1 + torch.gather(labels, 1, mine), classes)
    goal = torch.gather(boxes, 1, mine[..., None].expand(-1, -1, 4))
    goals = deltas_between(found, torch.where(positive[..., None], goal, found))
    return (
        torch.gather(found, 1, rank[..., None].expand(-1, -1, 4)),
        torch.gather(classes, 1, rank),
        torch.gather(goals, 1, rank[..., None].expand(-1, -1, 4)),
    )


def _some(chosen: Tensor, most: Tensor, random: torch.Generator) -> Tensor:
    """Keep at most ``most`` (B,) entries of each row of a mask (B, N), chosen at random."""
    draw = torch.rand(chosen.shape, generator=random, device=chosen.device) + chosen
    rank = torch.argsort(torch.argsort(draw, dim=1, descending=True), dim=1)
    return chosen & (rank < most[:, None])


def _smooth(predicted: Tensor, goal: Tensor) -> Tensor:
    return F.smooth_l1_loss(predicted, goal) if len(predicted) else predicted.sum() * 0
