"""The training loop of all networks: resumable, and reproducible for a given number of threads."""

from __future__ import annotations

import copy
import itertools
import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from posse_core import ComponentError, InputError, ModelCard, atomic_file, random_generator
from posse_detect_torch.batches import Batch, Batches
from posse_detect_torch.checkpoint import (
    AVERAGE,
    ONNX,
    below,
    read_like,
    read_state,
    write_model,
    write_state,
)
from posse_detect_torch.curves import MEANINGS, page
from posse_detect_torch.folded import measure_norms
from posse_detect_torch.options import TrainOptions

MODEL, LAST, CURVES = "model.safetensors", "last.safetensors", "curves.html"
_WARM_UP = 0.03  # share of all steps during which the learning rate rises
_MEASURED = 16  # batches on which the batch norms of an exported network are measured
_JUDGED = 20  # so many epochs of a training are judged on the valid part, evenly spread

NetT = TypeVar("NetT", bound=nn.Module)


class Lesson(ABC):
    """Defines what a network learns and from which samples."""

    net: nn.Module
    options: TrainOptions
    clip = 10.0  # largest norm of a gradient
    average = 0.998  # decay of the averaged weights, which become the model; 0 takes the last weights

    @abstractmethod
    def __len__(self) -> int:
        """Number of training samples."""

    @abstractmethod
    def sample(self, position: int, random: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the sample at a position as arrays; it is called from several threads or
        processes.

        All samples have arrays of the same shapes.
        """

    @abstractmethod
    def losses(self, batch: Batch) -> dict[str, Tensor]:
        """Return scalar losses by name; training minimises their sum."""

    @abstractmethod
    def judge(self, net: nn.Module) -> dict[str, float]:
        """Return the metrics of ``net`` on the valid part, or none where that part is empty."""

    def optimizer(self, net: nn.Module) -> torch.optim.Optimizer:
        """Return the optimiser."""
        return torch.optim.AdamW(net.parameters(), weight_decay=self.options.weight_decay)

    def rate(self, step: int, steps: int) -> float:
        """Return the factor on the learning rate: it rises quickly, then falls along a cosine."""
        return min((step + 1) / max(_WARM_UP * steps, 1), 0.5 * (1 + math.cos(math.pi * step / steps)))


def first_net(options: TrainOptions, make: Callable[[], NetT]) -> NetT:
    """Make a network on the device with initial weights given by the seed, and load ``start`` into it.

    Torch's global random state is unchanged. A lesson makes its network before it cuts pictures, so that
    a training that cannot start leaves no files behind.

    Raises:
        ComponentError: The device does not exist.
        InputError: The file ``start`` does not fit the network.
    """
    device = device_of(options)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(int(random_generator(options.seed, -1, "weights").integers(2**31)))
        net = make()
    if options.start is not None:
        read_like(options.start, net)
    # torch's stub of Module.to leaves memory_format out of every overload that takes a device
    return net.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]


def device_of(options: TrainOptions) -> torch.device:
    """Set the number of threads and return the device.

    Raises:
        ComponentError: The device does not exist.
    """
    torch.set_num_threads(options.threads)
    if options.device == "cuda" and not torch.cuda.is_available():
        raise ComponentError("option device: this machine or its build of torch has no CUDA; use cpu")
    return torch.device(options.device)


def computes_in_bfloat16(options: TrainOptions) -> bool:
    """Whether convolutions and matrix products are computed in bfloat16 while training.

    By default they are where the processor multiplies such numbers by instructions of its own, which is
    two to four times as fast; weights and last layers have 32 bits all the same.
    """
    if options.precision == "auto":
        if options.device == "cuda":
            return bool(torch.cuda.is_bf16_supported(including_emulation=False))
        # Torch has no public way to ask.
        return bool(torch.cpu._is_amx_tile_supported() or torch.cpu._is_avx512_bf16_supported())
    return options.precision == "bfloat16"


def learn(make_lesson: Callable[[], Lesson], card: ModelCard, folder: Path) -> Path:
    """Train up to the last epoch, resuming from the checkpoint in ``folder`` if there is one.

    Args:
        make_lesson: called after checking that ``folder`` holds no other training.
        card: the model card, without the number of epochs.
        folder: where the checkpoint, the model and the learning curves are written.

    Returns:
        The model file, which holds the averaged weights.

    Raises:
        InputError: The folder holds a training with other options or data, or there are no samples.
    """
    last = folder / LAST
    kept = _read_last(last, card) if last.exists() else None
    lesson = make_lesson()
    if len(lesson) == 0:
        raise InputError("no frame of the train part shows a spacecraft; partition the dataset again")
    options, net = lesson.options, lesson.net
    device = next(net.parameters()).device
    steps = math.ceil(len(lesson) / options.batch)
    in_bfloat16 = computes_in_bfloat16(options)
    with Batches(lesson, in_processes=device.type == "cuda") as batches:
        if kept is None and options.start is not None and options.start.suffix == ONNX:
            first = itertools.islice(batches.of_epoch(0), _MEASURED)
            measure_norms(net, (batch["picture"].to(device) for batch in first))
        average = copy.deepcopy(net).eval()
        optimizer = lesson.optimizer(net)
        history: list[dict[str, float]] = []
        if kept is not None:
            tensors, history = kept
            try:
                _resume(tensors, net, average, optimizer)
            except (RuntimeError, ValueError, KeyError) as error:  # of torch, where they do not fit
                raise InputError(
                    f"{last}: does not fit this network ({str(error).splitlines()[0]}); remove it to"
                    " begin anew"
                ) from None
        for epoch in range(len(history), options.epochs):
            sums: dict[str, Tensor] = {}
            net.train()
            bar = tqdm(
                batches.of_epoch(epoch), f"epoch {epoch + 1}/{options.epochs}", steps, disable=None
            )
            for number, batch in enumerate(bar):
                step = epoch * steps + number
                for group in optimizer.param_groups:
                    group["lr"] = options.learning_rate * lesson.rate(step, steps * options.epochs)
                with torch.autocast(device.type, torch.bfloat16, enabled=in_bfloat16):
                    losses = lesson.losses({k: v.to(device) for k, v in batch.items()})
                total = torch.stack(list(losses.values())).sum()
                optimizer.zero_grad()
                total.backward()  # type: ignore[no-untyped-call]
                nn.utils.clip_grad_norm_(net.parameters(), lesson.clip)
                optimizer.step()
                _follow(average, net, min(lesson.average, (1 + step) / (10 + step)))
                # They are read at the epoch's end, since reading waits for the device.
                for name, value in losses.items():
                    sums[name] = sums.get(name, torch.zeros(())) + value.detach().double() / steps
            means = {name: float(total) for name, total in sums.items()}
            if not all(map(math.isfinite, means.values())):
                raise ComponentError("the loss is no longer finite; lower the option learning_rate")
            judged: dict[str, float] = {}
            if _is_judged(epoch, options.epochs):
                with tqdm(desc="valid part", bar_format="{desc} ...", leave=False, disable=None):
                    judged = lesson.judge(average)
            history.append({"epoch": epoch + 1, **means, **judged})
            card = replace(card, epochs=epoch + 1)
            _save(last, net, average, optimizer, card, history)
            text = page(f"{card.net}: {epoch + 1} epochs on {card.dataset_sha256[:12]}", history)
            with atomic_file(folder / CURVES) as file:
                file.write(text.encode())
            tqdm.write(", ".join(f"{k} {v:.4g}" for k, v in history[-1].items()), file=sys.stderr)
            if epoch == 0:
                for name in [name for name in history[0] if name != "epoch"]:
                    tqdm.write(f"  {name}: {MEANINGS[name]}", file=sys.stderr)
    write_model(folder / MODEL, average.state_dict(), replace(card, epochs=len(history)))
    return folder / MODEL


def _is_judged(epoch: int, epochs: int) -> bool:
    """Whether an epoch, counted from 0, is judged: the first, the last, and others evenly spread."""
    return epoch in (0, epochs - 1) or (epoch + 1) % math.ceil(epochs / _JUDGED) == 0


@torch.no_grad()
def _follow(average: nn.Module, net: nn.Module, decay: float) -> None:
    theirs = net.state_dict()
    for name, value in average.state_dict().items():
        if value.is_floating_point():
            value.lerp_(theirs[name], 1 - decay)
        else:
            value.copy_(theirs[name])


def _save(
    path: Path,
    net: nn.Module,
    average: nn.Module,
    optimizer: torch.optim.Optimizer,
    card: ModelCard,
    history: Sequence[Mapping[str, float]],
) -> None:
    tensors = {f"net.{k}": v for k, v in net.state_dict().items()}
    tensors |= {f"{AVERAGE}{k}": v for k, v in average.state_dict().items()}
    for i, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{i}.{k}": torch.as_tensor(v) for k, v in state.items()}
    write_state(path, tensors, card, [dict(epoch) for epoch in history])


def _read_last(path: Path, card: ModelCard) -> tuple[dict[str, Tensor], list[dict[str, float]]]:
    tensors, theirs, history = read_state(path)
    for what in ("net", "options", "dataset_sha256"):
        if getattr(theirs, what) != getattr(card, what):
            raise InputError(
                f"{path.parent}: holds a training with other {what.replace('_sha256', '')}; choose"
                " another folder with --out"
            )
    return tensors, list(history)


def _resume(
    tensors: Mapping[str, Tensor],
    net: nn.Module,
    average: nn.Module,
    optimizer: torch.optim.Optimizer,
) -> None:
    net.load_state_dict(below("net.", tensors))
    average.load_state_dict(below(AVERAGE, tensors))
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in below("optimizer.", tensors).items():
        number, key = name.split(".", 1)
        state.setdefault(int(number), {})[key] = value
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
