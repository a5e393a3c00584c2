"""The residual network with a feature pyramid that ``nano`` and ``heatmap`` share.

Its convolutions are dense. Depthwise ones, which have fewer multiplications, are several times slower to
train on a CPU, whose units for matrices they leave idle.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from posse_detect_torch.options import Size

STRIDE = 8
"""Pixels of the input for each cell of the features."""
_WIDTHS: dict[Size, tuple[int, int, int, int]] = {
    "nano": (24, 48, 96, 160),
    "small": (32, 64, 128, 192),
    "base": (48, 96, 192, 256),
}
_DEPTHS = (1, 2, 2, 2)
_FEATURES: dict[Size, int] = {"nano": 64, "small": 96, "base": 128}


def _conv(inward: int, outward: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """Return a convolution followed by a batch norm."""
    return nn.Sequential(
        nn.Conv2d(inward, outward, kernel, stride, kernel // 2, bias=False), nn.BatchNorm2d(outward)
    )


class _Residual(nn.Module):
    """Two 3 × 3 convolutions beside a shortcut (He et al. 2016)."""

    def __init__(self, inward: int, outward: int, stride: int) -> None:
        super().__init__()
        self.first = _conv(inward, outward, 3, stride)
        self.second = _conv(outward, outward, 3)
        same = inward == outward and stride == 1
        self.shortcut = nn.Identity() if same else _conv(inward, outward, 1, stride)

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.second(F.relu(self.first(x))) + self.shortcut(x))


class Features(nn.Module):
    """Grey pictures (B, 1, S, S) → features (B, ``width``, S/8, S/8).

    Pictures are 0 … 1 and linear in radiance. S is a multiple of 32. The first convolution has stride 4,
    since larger maps would take more time than the rest of the network.

    Args:
        size: number of channels.
    """

    def __init__(self, size: Size) -> None:
        super().__init__()
        widths, self.width = _WIDTHS[size], _FEATURES[size]
        self.stem = _conv(1, widths[0], 7, 4)
        stages, before = [], widths[0]
        for number, (width, depth) in enumerate(zip(widths, _DEPTHS, strict=True)):
            blocks = [_Residual(before, width, 1 if number == 0 else 2)]
            blocks += [_Residual(width, width, 1) for _ in range(depth - 1)]
            stages.append(nn.Sequential(*blocks))
            before = width
        self.stages = nn.ModuleList(stages)
        self.lateral = nn.ModuleList(nn.Conv2d(width, self.width, 1) for width in widths[1:])
        self.merge = nn.ModuleList(_conv(self.width, self.width, 3) for _ in widths[2:])
        self.last = _conv(self.width, self.width, 3)

    def forward(self, picture: Tensor) -> Tensor:
        x = F.relu(self.stem(2 * torch.sqrt(picture) - 0.5))
        levels = []
        for stage in self.stages:
            x = stage(x)
            levels.append(x)
        pyramid = [lateral(level) for lateral, level in zip(self.lateral, levels[1:], strict=True)]
        y = pyramid[-1]
        for merge, level in zip(self.merge, reversed(pyramid[:-1]), strict=True):
            y = F.relu(merge(level + F.interpolate(y, scale_factor=2.0, mode="nearest")))
        return F.relu(self.last(y))


def exact(layer: nn.Module, x: Tensor) -> Tensor:
    """Apply a layer in float32, also where a training computes in bfloat16: a network's last layer."""
    result: Tensor
    if x.dtype == torch.bfloat16:
        with torch.autocast(x.device.type, enabled=False):
            result = layer(x.float())
    else:
        result = layer(x)
    return result
