"""Reading and writing weights and training states in safetensors files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import safetensors
from pydantic import TypeAdapter, ValidationError
from safetensors.torch import load_file, save
from torch import Tensor, nn

from posse_core import InputError, ModelCard, atomic_file
from posse_detect_torch.folded import unfolded

ONNX = ".onnx"
_STATE = "posse_training"
AVERAGE = "average."
"""Begins the names of the averaged weights in a training's state."""

History = list[dict[str, float]]
"""The losses and metrics of each epoch by name."""
_HISTORY: TypeAdapter[History] = TypeAdapter(History)


def write_model(path: Path, tensors: Mapping[str, Tensor], card: ModelCard) -> None:
    """Write the tensors of a model with its card, atomically."""
    with atomic_file(path) as file:
        file.write(save(_plain(tensors), card.metadata()))


def write_state(path: Path, tensors: Mapping[str, Tensor], card: ModelCard, state: History) -> None:
    """Write everything that a training needs to resume, atomically."""
    with atomic_file(path) as file:
        file.write(save(_plain(tensors), {**card.metadata(), _STATE: json.dumps(state)}))


def read_state(path: Path) -> tuple[dict[str, Tensor], ModelCard, History]:
    """Read what :func:`write_state` wrote: tensors, card and state.

    Raises:
        InputError: The file is of another kind.
    """
    card, tensors, metadata = ModelCard.read(path), _tensors(path), _metadata(path)
    if _STATE not in metadata:
        raise InputError(f"{path}: is not the state of a training; choose another folder with --out")
    try:
        return tensors, card, _HISTORY.validate_json(metadata[_STATE])
    except ValidationError:
        raise InputError(f"{path}: the state of its training is damaged; remove the file") from None


def read_weights(path: Path, net: nn.Module) -> None:
    """Load all tensors of a model file into ``net``.

    Raises:
        InputError: The file is damaged or belongs to a network of another kind.
    """
    tensors = _tensors(path)
    wanted = {name: value.shape for name, value in net.state_dict().items()}
    if wanted != {name: value.shape for name, value in tensors.items()}:
        raise InputError(f"{path}: its tensors do not fit this network; train it again")
    net.load_state_dict(tensors)


def read_like(path: Path, net: nn.Module) -> None:
    """Load those tensors of a model file into ``net`` whose names and shapes agree.

    Of the state of a training, these are the averaged weights.

    Raises:
        InputError: The file is not a model file, or no tensor agrees.
    """
    own = net.state_dict()
    if path.suffix == ONNX:
        held = unfolded(path, net)
    else:
        ModelCard.read(path)
        held = _tensors(path)
        if _STATE in _metadata(path):
            held = below(AVERAGE, held)
    tensors = {k: v for k, v in held.items() if k in own and own[k].shape == v.shape}
    if not tensors:
        raise InputError(
            f"{path}: none of its tensors fits this network; choose another file for the option start"
        )
    net.load_state_dict(tensors, strict=False)


def below(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Those whose names begin with ``prefix``, by the rest of their names."""
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}


def _metadata(path: Path) -> dict[str, str]:
    with safetensors.safe_open(str(path), framework="pt") as file:
        return file.metadata() or {}


def _tensors(path: Path) -> dict[str, Tensor]:
    try:
        return load_file(path)
    except (safetensors.SafetensorError, OSError, KeyError, ValueError, RuntimeError) as error:
        # KeyError: a type of numbers that torch does not know
        raise InputError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None


def _plain(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
