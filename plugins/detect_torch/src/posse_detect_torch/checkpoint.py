"""Weights and training state in safetensors files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import safetensors
from safetensors.torch import load_file, save
from torch import Tensor, nn

from posse_core import InputError, ModelCard, atomic_file

_STATE = "posse_training"


def write_model(path: Path, tensors: Mapping[str, Tensor], card: ModelCard) -> None:
    """Write a net's tensors with its card, atomically."""
    with atomic_file(path) as file:
        file.write(save(_plain(tensors), card.metadata()))


def write_state(path: Path, tensors: Mapping[str, Tensor], card: ModelCard, state: Any) -> None:
    """Write what a training needs to go on; ``state`` is JSON."""
    with atomic_file(path) as file:
        file.write(save(_plain(tensors), {**card.metadata(), _STATE: json.dumps(state)}))


def read_state(path: Path) -> tuple[dict[str, Tensor], ModelCard, Any]:
    """What :func:`write_state` wrote.

    Raises:
        InputError: not such a file.
    """
    card = ModelCard.read(path)
    with safetensors.safe_open(str(path), framework="pt") as file:
        metadata = file.metadata()
    if _STATE not in metadata:
        raise InputError(f"{path}: holds no training; name another folder by --out")
    return load_file(path), card, json.loads(metadata[_STATE])


def read_weights(path: Path, net: nn.Module) -> None:
    """Put a model file's tensors into ``net``.

    Raises:
        InputError: damaged, or of another net.
    """
    try:
        tensors = load_file(path)
    except (safetensors.SafetensorError, OSError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    wanted = {name: value.shape for name, value in net.state_dict().items()}
    if wanted != {name: value.shape for name, value in tensors.items()}:
        raise InputError(f"{path}: its tensors are not those of this net; train it anew")
    net.load_state_dict(tensors)


def read_like(path: Path, net: nn.Module) -> None:
    """Put those of a model file's tensors into ``net`` whose name and shape it has too.

    Raises:
        InputError: not a model file, or none agrees.
    """
    ModelCard.read(path)
    own = net.state_dict()
    tensors = {k: v for k, v in load_file(path).items() if k in own and own[k].shape == v.shape}
    if not tensors:
        raise InputError(f"{path}: none of its tensors is one of this net; name another by start")
    net.load_state_dict(tensors, strict=False)


def _plain(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
