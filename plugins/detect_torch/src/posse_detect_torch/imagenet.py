"""SDN's backbone from an ImageNet ResNet of torchvision's or timm's naming, in a safetensors file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import safetensors
import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from posse_core import InputError
from posse_detect_torch.sdn import Backbone

_DEVIATION = (0.229, 0.224, 0.225)  # of ImageNet's red, green and blue, which its nets divide by
_EPS = 1e-5  # of their batch norms
_CONVERT = (
    "python -c \"import torch, safetensors.torch as s; s.save_file(torch.load('IN.pth',"
    " weights_only=True), 'OUT.safetensors')\""
)


@torch.no_grad()
def load_imagenet(backbone: Backbone, path: Path) -> None:
    """Put the weights and statistics of an ImageNet net into ``backbone``; the pyramid stays as it is.

    Its convolutions have no bias. A grey picture is one whose three colours are alike, so the first
    convolution is the sum over its colours, each over its deviation, and over the 255 of SDN's light.
    Scales of batch norms make up for the other epsilon. So ResNet-18 tells what the net told of grey
    pictures; in ResNet-50 the stride is in another convolution than torchvision's.

    Raises:
        InputError: not a safetensors file, or not of a ResNet of this depth.
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
    """Torchvision's name → our layer, of all convolutions and batch norms of the ResNet."""
    yield from (("conv1", backbone.stem[0]), ("bn1", backbone.stem[1]))
    for number, stage in enumerate(backbone.stages, 1):
        assert isinstance(stage, nn.Sequential)
        for place, block in enumerate(stage):
            base = f"layer{number}.{place}"
            assert isinstance(block.body, nn.Sequential)
            layers = [m for m in block.body if not isinstance(m, nn.ReLU)]
            for i, layer in enumerate(layers):
                yield f"{base}.{'bn' if i % 2 else 'conv'}{i // 2 + 1}", layer
            if isinstance(block.shortcut, nn.Sequential):
                yield from ((f"{base}.downsample.{i}", layer) for i, layer in enumerate(block.shortcut))


def _grey(weight: Tensor, path: Path) -> Tensor:
    if weight.ndim != 4 or weight.shape[1] != 3:
        raise InputError(f"option backbone_weights: {path}: its 'conv1.weight' is not of three colours")
    deviation = weight.new_tensor(_DEVIATION)[:, None, None]
    return (weight / (255 * deviation)).sum(dim=1, keepdim=True)


def _taken(tensors: dict[str, Tensor], name: str, path: Path) -> Tensor:
    if name not in tensors:
        raise InputError(
            f"option backbone_weights: {path}: has no {name!r}; give a ResNet of torchvision's or timm's"
            " naming, of the option's depth"
        )
    return tensors[name]


def _put(mine: Tensor, theirs: Tensor, name: str, path: Path) -> None:
    if mine.shape != theirs.shape:
        raise InputError(
            f"option backbone_weights: {path}: {name!r} is of shape {tuple(theirs.shape)} where depth"
            f" has {tuple(mine.shape)}; set the option depth to the file's"
        )
    mine.copy_(theirs)
