"""The keypoint network ``heatmap``: for each keypoint, a map of how likely it is at each place.

The network's input is a square around a box. A residual network with a feature pyramid
(:mod:`posse_detect_torch.features`) computes, for each keypoint, a map of stride 4 whose softmax is the
distribution of its place. A coordinate is the mean of the distribution around a high cell, so that a
second place where the keypoint may be does not draw it away; it is read too, and is less certain by what
the first takes of the distribution. The network predicts the keypoints of all classes; those of the
box's class are used.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from posse_detect_torch.features import Features, exact
from posse_detect_torch.options import Size

STRIDE = 4
"""Pixels of the input for each cell of a map."""
SPREAD_PX = float(STRIDE)
"""Standard deviation of the target distributions, in pixels."""
_WINDOW = 4
"""A coordinate is read from the highest cell and as many on each side of it: four standard deviations
of the targets."""
_LEAST_VARIANCE_PX2 = 0.01
PLACES = 4
"""Number M of places that are read from each distribution."""
_LEAST_SHARE = 1e-6


class HeatMaps(nn.Module):
    """The network: grey squares (B, 1, S, S) → logits (B, P, S/4, S/4).

    Squares are 0 … 1 and linear in radiance. S is a multiple of 32.

    Args:
        points: number P of keypoints of all classes together.
        size: number of channels.

    Attributes:
        calibration: (3,) a, b and c of the logarithm of a point's standard deviation, a + b log s +
            c log m, where s is the spread of the distribution at one of its places, in pixels, and m
            the share that is there (:func:`read`).
    """

    calibration: Tensor

    def __init__(self, points: int, size: Size = "small") -> None:
        super().__init__()
        self.features = Features(size)
        self.maps = nn.Conv2d(self.features.width, 4 * points, 1)  # four cells of stride 4 in each of 8
        self.register_buffer("calibration", torch.tensor([0.0, 1.0, -0.5]))

    def forward(self, picture: Tensor) -> Tensor:
        return F.pixel_shuffle(exact(self.maps, self.features(picture)), 2)


def cell_centres(count: int, device: torch.device) -> Tensor:
    """Return the coordinates (count,) of a map's cells in pixels, whose centres are at integers."""
    return (torch.arange(count, device=device, dtype=torch.float32) + 0.5) * STRIDE - 0.5


def read(logits: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Read the distributions around their highest cells: (B, P, s, s) → points, spread and share.

    A distribution is read around its highest cell, then around the highest of what is left, and so on,
    :data:`PLACES` times.

    Returns:
        (B, P, M, 2) coordinates x, y in pixels of the square; (B, P, M) standard deviation there, beyond
        that of the training targets, in pixels; (B, P, M) share of the distribution there, 0 … 1.
    """
    left = torch.softmax(logits.flatten(2), dim=-1).reshape(logits.shape)
    number = torch.arange(logits.shape[-1], device=logits.device)
    found = []
    for _ in range(PLACES):
        highest = left.flatten(2).argmax(dim=-1, keepdim=True)
        near_x = ((number - highest % len(number)).abs() <= _WINDOW).to(left.dtype)  # (B, P, s)
        near_y = ((number - highest // len(number)).abs() <= _WINDOW).to(left.dtype)
        around = left * near_x[..., None, :] * near_y[..., :, None]
        found.append(_moments(around))
        left = left - around
    points, spread, share = (torch.stack(values, dim=2) for values in zip(*found, strict=True))
    return points, spread, share


def _moments(around: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Mean (B, P, 2), spread (B, P) and sum (B, P) of a part (B, P, s, s) of the distributions."""
    at = cell_centres(around.shape[-1], around.device)
    there = around.sum(dim=(-2, -1)).clamp(min=_LEAST_SHARE)
    means, variances = [], []
    for axis in (-2, -1):  # sums over rows leave columns, and so x
        along = around.sum(dim=axis) / there[..., None]
        mean = (along * at).sum(dim=-1)
        means.append(mean)
        variances.append((along * (at - mean[..., None]) ** 2).sum(dim=-1))
    # The target's own variance is no uncertainty of the point.
    beyond = (variances[0] + variances[1]) / 2 - SPREAD_PX**2
    return torch.stack(means, dim=-1), beyond.clamp(min=_LEAST_VARIANCE_PX2).sqrt(), there


class Decoded(nn.Module):
    """The network with its decoding, as it is exported.

    Squares (B, 1, S, S) → points (B, P, M, 2), standard deviations (B, P, M), both in pixels of the
    square, shares (B, P, M), and raw (B, P, S/4, S/4).
    """

    def __init__(self, net: HeatMaps) -> None:
        super().__init__()
        self.net = net

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        logits = self.net(picture)
        points, spread, share = read(logits)
        a, b, c = self.net.calibration
        return points, torch.exp(a + b * spread.log() + c * share.log()), share, logits


def losses(logits: Tensor, points: Tensor, weights: Tensor) -> dict[str, Tensor]:
    """Return the divergence of the maps' distributions from the true ones.

    It is the cross-entropy with a normal distribution around the true place, minus its smallest possible
    value.

    Args:
        logits: outputs of :class:`HeatMaps`.
        points: (B, P, 2) pixels of the square.
        weights: (B, P); 0 for points of other classes and those outside the square.
    """
    at = cell_centres(logits.shape[-1], points.device)
    along_x, along_y = (
        torch.softmax(-(((at - points[..., axis, None]) / SPREAD_PX) ** 2) / 2, dim=-1)
        for axis in range(2)
    )
    goal = (along_y[..., :, None] * along_x[..., None, :]).flatten(2)
    apart = torch.xlogy(goal, goal) - goal * torch.log_softmax(logits.flatten(2), dim=-1)
    total = weights.sum().clamp(min=1)
    return {"place": (weights * apart.sum(dim=-1)).sum() / total}
