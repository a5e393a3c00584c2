"""Keypoints by SimCC (Li et al. 2022): each coordinate is a distribution over half pixels of the square.

The net sees a square around a box; its mean and deviation per coordinate become a point with its
uncertainty. It tells the points of every class; those of the box's class count.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from posse_detect_torch.nano import Separable, Stem

SPLIT = 2
"""Steps of a distribution for each pixel."""
_WIDTHS = (48, 96, 160, 256)
_DEPTHS = (2, 3, 3)
_TARGET_STEPS = 2.0  # deviation of what is to be told, in steps


class SimCC(nn.Module):
    """Grey squares (B, 1, S, S), 0 … 1 in linear light → logits over x and over y, (B, P, 2 S) each.

    Args:
        points: of all classes together.
        size: S.
    """

    def __init__(self, points: int, size: int) -> None:
        super().__init__()
        self.size = size
        self.stem = Stem(_WIDTHS[0])
        blocks: list[nn.Module] = []
        for depth, inward, outward in zip(_DEPTHS, _WIDTHS[:-1], _WIDTHS[1:], strict=True):
            blocks.append(Separable(inward, outward, 2))
            blocks += [Separable(outward, outward) for _ in range(depth)]
        self.blocks = nn.Sequential(*blocks)
        self.points = nn.Conv2d(_WIDTHS[-1], points, 1)
        cells = (size // 32) ** 2
        self.mix = nn.Sequential(nn.Linear(cells, 128), nn.ReLU())
        self.along_x = nn.Linear(128, SPLIT * size)
        self.along_y = nn.Linear(128, SPLIT * size)

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor]:
        light = torch.sqrt(picture)
        level = light.mean(dim=(2, 3), keepdim=True)
        spread = (light - level).square().mean(dim=(2, 3), keepdim=True).sqrt()
        x = self.stem((light - level) / (spread + 0.02))  # exposure matters little to shape
        x = self.mix(self.points(self.blocks(x)).flatten(2))
        return self.along_x(x), self.along_y(x)


def steps(size: int, device: torch.device) -> Tensor:
    """(2 S,) coordinate of each step in pixels, whose centres are whole numbers."""
    return (torch.arange(SPLIT * size, device=device, dtype=torch.float32) + 0.5) / SPLIT - 0.5


class Decoded(nn.Module):
    """The net with its decoding: squares (B, 1, S, S) → points (B, P, 2) and deviations (B, P) in pixels
    of the square, raw (B, P, 4 S)."""

    def __init__(self, net: SimCC) -> None:
        super().__init__()
        self.net = net

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        logits = self.net(picture)
        at = steps(self.net.size, picture.device)
        means, variances = [], []
        for one in logits:
            share = torch.softmax(one, dim=-1)
            mean = (share * at).sum(dim=-1)
            means.append(mean)
            variances.append((share * (at - mean[..., None]) ** 2).sum(dim=-1))
        deviation = ((variances[0] + variances[1]) / 2).sqrt().clamp(min=0.1)
        return torch.stack(means, dim=-1), deviation, torch.cat(logits, dim=-1)


def losses(logits: tuple[Tensor, Tensor], points: Tensor, weights: Tensor) -> dict[str, Tensor]:
    """Cross-entropy to a narrow normal distribution around each true coordinate, less its least value.

    Args:
        logits: of :class:`SimCC`.
        points: (B, P, 2) pixels of the square.
        weights: (B, P); 0 for points of other classes and those outside the square.
    """
    at = steps(logits[0].shape[-1] // SPLIT, points.device)
    total = weights.sum().clamp(min=1)
    result = {}
    for axis, name in enumerate("xy"):
        away = (at - points[..., axis, None]) * SPLIT / _TARGET_STEPS
        goal = torch.softmax(-(away**2) / 2, dim=-1)
        told = torch.log_softmax(logits[axis], dim=-1)
        apart = (torch.xlogy(goal, goal) - goal * told).sum(dim=-1)
        result[name] = (weights * apart).sum() / total
    return result
