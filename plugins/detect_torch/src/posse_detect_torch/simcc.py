"""Keypoints by heat maps of stride 8, read axis by axis.

The net sees a square around a box. Each point has a map, whose sums along columns and rows are
distributions of x and of y over the map's places, as in SimCC (Li et al. 2022), which has dense layers
and finer steps instead of a map; mean and deviation of a distribution become a coordinate with its
uncertainty. The net tells the points of every class; those of the box's class count.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from posse_detect_torch.nano import STRIDE, WIDTH, Pyramid

SPREAD = 0.7 * STRIDE
"""Deviation of what is to be told, in pixels."""
_LEAST_SIGMA_PX = 0.5


class SimCC(nn.Module):
    """Grey squares (B, 1, S, S), 0 … 1 in linear light → logits over x and over y, (B, P, S/8) each.

    Args:
        points: of all classes together.
    """

    def __init__(self, points: int) -> None:
        super().__init__()
        self.pyramid = Pyramid()
        self.points = nn.Conv2d(WIDTH, points, 1)

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor]:
        heat = self.points(self.pyramid(picture))
        return torch.logsumexp(heat, dim=2), torch.logsumexp(heat, dim=3)


def steps(count: int, device: torch.device) -> Tensor:
    """(count,) coordinate of each place in pixels of the square, whose centres are whole numbers."""
    return (torch.arange(count, device=device, dtype=torch.float32) + 0.5) * STRIDE - 0.5


class Decoded(nn.Module):
    """The net with its decoding: squares (B, 1, S, S) → points (B, P, 2) and deviations (B, P) in pixels
    of the square, raw (B, P, S/4)."""

    def __init__(self, net: SimCC) -> None:
        super().__init__()
        self.net = net

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        logits = self.net(picture)
        at = steps(picture.shape[-1] // STRIDE, picture.device)
        means, variances = [], []
        for one in logits:
            share = torch.softmax(one, dim=-1)
            mean = (share * at).sum(dim=-1)
            means.append(mean)
            variances.append((share * (at - mean[..., None]) ** 2).sum(dim=-1))
        # What the net is taught has a spread of its own, which says nothing of the point.
        variance = (variances[0] + variances[1]) / 2 - SPREAD**2
        deviation = variance.clamp(min=_LEAST_SIGMA_PX**2).sqrt()
        return torch.stack(means, dim=-1), deviation, torch.cat(logits, dim=-1)


def losses(logits: tuple[Tensor, Tensor], points: Tensor, weights: Tensor) -> dict[str, Tensor]:
    """Cross-entropy to a normal distribution around each true coordinate, less its least value; and how
    far the mean is off, in strides.

    Args:
        logits: of :class:`SimCC`.
        points: (B, P, 2) pixels of the square.
        weights: (B, P); 0 for points of other classes and those outside the square.
    """
    at = steps(logits[0].shape[-1], points.device)
    total = weights.sum().clamp(min=1)
    result = {}
    for axis, name in enumerate("xy"):
        true = points[..., axis, None]
        goal = torch.softmax(-(((at - true) / SPREAD) ** 2) / 2, dim=-1)
        told = torch.log_softmax(logits[axis], dim=-1)
        apart = (torch.xlogy(goal, goal) - goal * told).sum(dim=-1)
        off = ((told.exp() * at).sum(dim=-1, keepdim=True) - true).abs()[..., 0] / STRIDE
        result[name] = (weights * apart).sum() / total
        result[f"{name} off"] = (weights * off).sum() / total
    return result
