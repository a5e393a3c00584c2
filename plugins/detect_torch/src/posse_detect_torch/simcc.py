"""The keypoint network ``simcc``: heat maps of stride 8 that are read one axis at a time.

The network's input is a square around a box. It computes a heat map for each keypoint; the sums over
columns and over rows give distributions of x and y, whose mean and standard deviation are the coordinate
and its uncertainty. This follows SimCC (Li et al. 2022), which has dense layers and finer steps in place
of a map. The network predicts the keypoints of all classes; those of the box's class are used.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from posse_detect_torch.nano import STRIDE, WIDTH, Pyramid

SPREAD = 0.7 * STRIDE
"""Standard deviation of the target distributions, in pixels."""
_LEAST_SIGMA_PX = 0.5


class SimCC(nn.Module):
    """The network: grey squares (B, 1, S, S) → logits over x and over y, (B, P, S/8) each.

    Squares are 0 … 1 and linear in radiance.

    Args:
        points: number P of keypoints of all classes together.
    """

    def __init__(self, points: int) -> None:
        super().__init__()
        self.pyramid = Pyramid()
        self.points = nn.Conv2d(WIDTH, points, 1)

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor]:
        heat = self.points(self.pyramid(picture))
        return torch.logsumexp(heat, dim=2), torch.logsumexp(heat, dim=3)


def steps(count: int, device: torch.device) -> Tensor:
    """Return the coordinates (count,) of the map's cells in pixels, whose centres are at integers."""
    return (torch.arange(count, device=device, dtype=torch.float32) + 0.5) * STRIDE - 0.5


class Decoded(nn.Module):
    """The network with its decoding, as it is exported.

    Squares (B, 1, S, S) → points (B, P, 2) and standard deviations (B, P) in pixels of the square, and
    raw (B, P, S/4).
    """

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
        # The targets have a variance of their own, which is no uncertainty of the point.
        variance = (variances[0] + variances[1]) / 2 - SPREAD**2
        deviation = variance.clamp(min=_LEAST_SIGMA_PX**2).sqrt()
        return torch.stack(means, dim=-1), deviation, torch.cat(logits, dim=-1)


def losses(logits: tuple[Tensor, Tensor], points: Tensor, weights: Tensor) -> dict[str, Tensor]:
    """Return the losses of x and y: the distributions' divergence and the error of the mean in strides.

    The divergence is the cross-entropy with a normal distribution around the true coordinate, minus its
    smallest possible value.

    Args:
        logits: outputs of :class:`SimCC`.
        points: (B, P, 2) pixels of the square.
        weights: (B, P); 0 for points of other classes and those outside the square.
    """
    at = steps(logits[0].shape[-1], points.device)
    total = weights.sum().clamp(min=1)
    result = {}
    for axis, name in enumerate("xy"):
        true = points[..., axis, None]
        goal = torch.softmax(-(((at - true) / SPREAD) ** 2) / 2, dim=-1)
        predicted = torch.log_softmax(logits[axis], dim=-1)
        apart = (torch.xlogy(goal, goal) - goal * predicted).sum(dim=-1)
        off = ((predicted.exp() * at).sum(dim=-1, keepdim=True) - true).abs()[..., 0] / STRIDE
        result[name] = (weights * apart).sum() / total
        result[f"{name} off"] = (weights * off).sum() / total
    return result
