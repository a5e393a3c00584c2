"""What SDN learns from: anchors and regions sorted by overlap, and the thesis' losses (Section 4.1).

Class losses count the background and leave out padding, whose class is −2: the thesis' change.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from posse_detect_torch.regions import iou_matrix
from posse_detect_torch.sdn import Sdn, anchors, deltas_between, proposals

PADDING = -2
_ANCHORS = 256  # an image
_TRAIN_PROPOSALS = 2000


def losses(
    net: Sdn, picture: Tensor, boxes: Tensor, labels: Tensor, draw: int, regions: int
) -> dict[str, Tensor]:
    """The four losses.

    Args:
        picture: (B, 1, S, S).
        boxes: (B, M, 4) left, top, right, bottom; labels: (B, M), −1 where there is none.
        draw: seed of the choice among anchors and regions.
        regions: most that are looked at in a picture.
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
    told, moves = net.look_at(pyramid, rois)
    known = classes > PADDING
    positive = classes > 0
    move = torch.gather(moves, 2, classes.clamp(min=0)[..., None, None].expand(-1, -1, 1, 4))[:, :, 0]
    result["class"] = F.cross_entropy(told[known], classes[known]) if known.any() else told.sum() * 0
    result["box"] = _smooth(move[positive], goals[positive])
    return result


def anchor_targets(
    fixed: Tensor, boxes: Tensor, labels: Tensor, random: torch.Generator
) -> tuple[Tensor, Tensor]:
    """(B, A) 1, 0 or −1 (left out) of anchors (A, 4), and (B, A) the truth nearest to each.

    Positive above 0.7 and the best of each truth, negative below 0.3; 256 are kept, at most half of
    them positive.
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
    """Regions (B, R, 4) to learn from; classes (B, R): 1 + label, 0 background, −2 padding; deltas.

    Positive above an overlap of 0.5, at most a quarter of ``most_regions``; three negatives to each.
    """
    real = labels >= 0
    overlap = iou_matrix(found, boxes).masked_fill(~real[:, None], 0.0)
    most, mine = overlap.max(dim=2)
    there = found[..., 2] > found[..., 0]
    positive = (most >= 0.5) & there
    positive = _some(positive, torch.full_like(labels[:, 0], most_regions // 4), random)
    negative = (most < 0.5) & there
    negative = _some(negative, 3 * positive.sum(dim=1), random)
    rank = torch.argsort(2 * positive.int() + negative.int(), dim=1, descending=True, stable=True)
    fullest = int((positive | negative).sum(dim=1).max())
    rank = rank[
        :, : min(max(fullest, 1), most_regions)
    ]  # what is padding in every picture is not looked at
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
    """At most ``most`` (B,) of each row of a mask (B, N), at random."""
    draw = torch.rand(chosen.shape, generator=random, device=chosen.device) + chosen
    rank = torch.argsort(torch.argsort(draw, dim=1, descending=True), dim=1)
    return chosen & (rank < most[:, None])


def _smooth(told: Tensor, goal: Tensor) -> Tensor:
    return F.smooth_l1_loss(told, goal) if len(told) else told.sum() * 0
