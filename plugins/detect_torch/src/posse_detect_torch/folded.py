"""Weights from ONNX files, so that a network of which nothing else is left can be trained further.

In an exported file each batch norm is folded into its convolution: what is left of it is a bias. While a
network is trained, a batch norm divides by what it sees, so its scale is measured again on pictures.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm

from posse_core import InputError, ModelCard

_PREFIX = "net."
"""What an exported network is within, as an attribute of the module that decodes its outputs."""


def unfolded(path: Path, net: nn.Module) -> dict[str, Tensor]:
    """Return the tensors of an ONNX file by their names in ``net``, as far as they are there.

    With them ``net`` computes what the file does, while it is not trained.

    Raises:
        InputError: The file is no ONNX file of POSSE, or of a network whose batch norms cannot be found
            again.
    """
    try:
        model = onnx.load(path)
        held = {
            tensor.name.removeprefix(_PREFIX): torch.from_numpy(numpy_helper.to_array(tensor).copy())
            for tensor in model.graph.initializer
        }
    except Exception as error:  # protobuf's exceptions have no stubs
        raise InputError(f"{path}: is not an ONNX file: {' '.join(str(error).split())}") from None
    ModelCard.from_metadata({entry.key: entry.value for entry in model.metadata_props}, path)
    found = {name: held[name] for name in net.state_dict() if name in held}
    normed = list(_normed(net))
    for name, convolution, norm in normed:
        bias = held.get(f"{convolution}.weight_bias")
        if bias is not None:
            found |= {
                f"{name}.bias": bias,
                f"{name}.weight": torch.ones_like(bias),
                f"{name}.running_mean": torch.zeros_like(bias),
                f"{name}.running_var": torch.full_like(bias, 1 - norm.eps),
            }
    norms = sum(isinstance(module, _BatchNorm) for module in net.modules())
    if found and norms != sum(f"{name}.running_var" in found for name, _, _ in normed):
        raise InputError(
            f"{path}: cannot be trained further; give a .safetensors file of such a network"
        )
    return found


@torch.no_grad()
def measure_norms(net: nn.Module, pictures: Iterator[Tensor]) -> None:
    """Set the statistics of the batch norms of ``net`` to those of pictures (B, 1, S, S), 0 … 1.

    What ``net`` computes stays the same while it is not trained.
    """
    norms = [norm for _, _, norm in _normed(net)]
    sums: dict[nn.Module, Tensor] = {norm: torch.zeros(()) for norm in norms}

    def add(norm: nn.Module, inputs: tuple[Tensor]) -> None:
        x = inputs[0].double().transpose(0, 1).flatten(1)
        count = torch.full_like(x[:, 0], x.shape[1])
        sums[norm] = sums[norm] + torch.stack([x.sum(1), (x * x).sum(1), count])

    hooks = [norm.register_forward_pre_hook(add) for norm in norms]
    was_training = net.training
    net.eval()
    for batch in pictures:
        net(batch)
    net.train(was_training)
    for hook in hooks:
        hook.remove()
    for norm in norms:
        first, second, count = sums[norm]
        mean = first / count
        variance = (second / count - mean * mean).clamp(min=0)
        assert norm.running_mean is not None
        assert norm.running_var is not None
        scale = norm.weight / (norm.running_var + norm.eps).sqrt()
        norm.bias.copy_(norm.bias + scale * (mean - norm.running_mean))
        norm.weight.copy_(scale * (variance + norm.eps).sqrt())
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)


def _normed(net: nn.Module) -> Iterator[tuple[str, str, nn.BatchNorm2d]]:
    """Yield the batch norms behind a convolution, with their names and those of the convolutions."""
    modules = dict(net.named_modules())
    for name, module in modules.items():
        number = name.rpartition(".")[2]
        before = f"{name.removesuffix(number)}{int(number) - 1}" if number.isdigit() else ""
        if isinstance(module, nn.BatchNorm2d) and isinstance(modules.get(before), nn.Conv2d):
            yield name, before, module
