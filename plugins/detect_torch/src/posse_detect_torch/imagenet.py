"""Initialises SDN's backbone from an ImageNet ResNet with the tensor names of torchvision or timm."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import safetensors
import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from posse_core import InputError
from posse_detect_torch.sdn import Backbone

_DEVIATION = (
    0.229,
    0.224,
    0.225,
)  # ImageNet's standard deviations of R, G, B, which its networks divide by
_EPS = 1e-5  # epsilon of their batch norms
_CONVERT = (
    "python -c \"import torch, safetensors.torch as s; s.save_file(torch.load('IN.pth',"
    " weights_only=True), 'OUT.safetensors')\""
)


@torch.no_grad()
def load_imagenet(backbone: Backbone, path: Path) -> None:
    """Load the weights and statistics of an ImageNet ResNet into ``backbone``; the pyramid is unchanged.

    The file's convolutions have no bias, so biases become 0. In a grey picture all three colours are
    equal, so the weights of the first convolution are summed over the colours, each divided by its
    standard deviation and by the 255 by which SDN scales its input. The scales of the batch norms are
    adapted to SDN's other epsilon. ResNet-18 therefore gives the same features for grey pictures as
    before; in ResNet-50 the stride is in another convolution than torchvision's.

    Raises:
        InputError: The file is not a safetensors file, or does not hold a ResNet of this depth.
    """
    tensors = _read(path)
    for name, module in _counterparts(backbone):
        weight = _taken(tensors, f"{name}.weight", path)
        if isinstance(module, nn.Conv2d):
            if name == "conv1":
                weight = _grey(weight, path)
            _put(module.weight, weight, name, path)
            assert module.bias is not None
            module.bias.zero_()
        else:
            for key in ("bias", "running_mean", "running_var"):
                _put(getattr(module, key), _taken(tensors, f"{name}.{key}", path), name, path)
            assert isinstance(module, nn.BatchNorm2d)
            variance = module.running_var
            assert variance is not None
            _put(module.weight, weight, name, path)
            module.weight.mul_(((variance + module.eps) / (variance + _EPS)).sqrt())


def _read(path: Path) -> dict[str, Tensor]:
    try:
        return load_file(path)
    except (safetensors.SafetensorError, OSError):
        hint = f"; nothing is loaded by pickle: {_CONVERT}" if path.suffix in (".pth", ".pt") else ""
        raise InputError(f"option backbone_weights: {path}: not a safetensors file{hint}") from None


def _counterparts(backbone: Backbone) -> Iterator[tuple[str, nn.Module]]:
    """Yield torchvision's name and our layer for every convolution and batch norm of the ResNet."""
    yield from (("conv1", backbone.stem[0]), ("bn1", backbone.stem[1]))
    for number, stage in enumerate(backbone.stages, 1):
        assert isinstance(stage, nn.Sequential)
        for position, block in enumerate(stage):
            base = f"layer{number}.{position}"
            assert isinstance(block.body, nn.Sequential)
            layers = [m for m in block.body if not isinstance(m, nn.ReLU)]
            for i, layer in enumerate(layers):
                yield f"{base}.{'bn' if i % 2 else 'conv'}{i // 2 + 1}", layer
            if isinstance(block.shortcut, nn.Sequential):
                yield from ((f"{base}.downsample.{i}", layer) for i, layer in enumerate(block.shortcut))


def _grey(weight: Tensor, path: Path) -> Tensor:
    if weight.ndim != 4 or weight.shape[1] != 3:
        raise InputError(
            f"option backbone_weights: {path}: its 'conv1.weight' does not have three input colours"
        )
    deviation = weight.new_tensor(_DEVIATION)[:, None, None]
    return (weight / (255 * deviation)).sum(dim=1, keepdim=True)


def _taken(tensors: dict[str, Tensor], name: str, path: Path) -> Tensor:
    if name not in tensors:
        raise InputError(
            f"option backbone_weights: {path}: has no {name!r}; give a ResNet with the tensor names of"
            " torchvision or timm and the depth of the option depth"
        )
    return tensors[name]


def _put(ours: Tensor, theirs: Tensor, name: str, path: Path) -> None:
    if ours.shape != theirs.shape:
        raise InputError(
            f"option backbone_weights: {path}: {name!r} has shape {tuple(theirs.shape)}, but the option"
            f" depth needs {tuple(ours.shape)}; set the option depth to that of the file"
        )
    ours.copy_(theirs)
