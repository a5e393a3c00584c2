"""Export of networks to ONNX: opset 18, standard operations only, with the model card as metadata.

Every exported file is compared with torch on real frames before it is written.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from torch import nn

from posse_core import AnyArray, ComponentError, Float32Array, ModelCard, atomic_file

_SCORE_ERROR = 1e-4  # largest allowed difference of raw tensors and scores
OPSET = 18  # with a higher one, some runtimes lack RoiAlign or fall back to the CPU
Outputs = Mapping[str, AnyArray]
Compare = Callable[[Outputs, Outputs], Mapping[str, tuple[float, float]]]
"""Takes the outputs of torch and of ONNX and returns name → (difference, allowed difference)."""


def export(
    net: nn.Module,
    names: Sequence[str],
    pictures: Float32Array,
    card: ModelCard,
    path: Path,
    compare: Compare,
    translations: Mapping[Any, Callable[..., Any]] | None = None,
) -> dict[str, float]:
    """Convert ``net`` to ONNX, compare both on ``pictures``, and write the file.

    Args:
        net: takes (B, 1, S, S) float32 and returns one tensor for each of ``names``.
        names: names of the outputs.
        pictures: (F, 1, S, S) made from real frames.
        card: the model card, which becomes the file's metadata.
        path: the file to write.
        compare: computes the differences between the outputs, and how large they may be.
        translations: custom torch operation → its ONNX function.

    Returns:
        Name → largest difference.

    Raises:
        ComponentError: A difference is larger than ``compare`` allows; nothing is written.
    """
    net = net.eval().cpu()
    model = _to_onnx(net, names, torch.from_numpy(pictures[:2].repeat(2, axis=0)[:2]), translations)
    for key, value in card.metadata().items():
        model.metadata_props.add(key=key, value=value)
    data = model.SerializeToString()
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    worst: dict[str, float] = {}
    for picture in pictures:
        with torch.no_grad():
            by_torch = net(torch.from_numpy(picture[None]))
        by_onnx = session.run(list(names), {"picture": picture[None]})
        ours = {name: value.numpy() for name, value in zip(names, by_torch, strict=True)}
        theirs = dict(zip(names, by_onnx, strict=True))
        for name, (difference, allowed) in compare(ours, theirs).items():
            if not difference <= allowed:
                raise ComponentError(
                    f"{path}: not written: {name} of ONNX and torch differ by {difference:.2g}; at most"
                    f" {allowed:g} is allowed"
                )
            worst[name] = max(worst.get(name, 0.0), difference)
    with atomic_file(path) as file:
        file.write(data)
    return worst


def _to_onnx(
    net: nn.Module,
    names: Sequence[str],
    pictures: torch.Tensor,
    translations: Mapping[Any, Callable[..., Any]] | None,
) -> onnx.ModelProto:
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it warns that torchvision is missing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch and onnxscript warn about their own code
        program = torch.onnx.export(
            net,
            (pictures,),
            dynamo=True,
            opset_version=OPSET,
            input_names=["picture"],
            output_names=list(names),
            dynamic_shapes=({0: torch.export.Dim("batch", min=1, max=1024)},),
            custom_translation_table=dict(translations or {}),
            verbose=False,
        )
    assert program is not None
    model = program.model_proto
    _strip(model.graph)
    for function in model.functions:
        del function.metadata_props[:]
        for node in function.node:
            _strip_node(node)
    onnx.checker.check_model(model)
    foreign = {node.domain for node in model.graph.node} - {"", "ai.onnx"}
    assert not foreign, foreign
    return model


def _strip(graph: onnx.GraphProto) -> None:
    """Remove stack traces, which contain paths of this machine."""
    graph.doc_string = ""
    del graph.metadata_props[:]
    for node in graph.node:
        _strip_node(node)
    for value in [*graph.value_info, *graph.input, *graph.output, *graph.initializer]:
        del value.metadata_props[:]


def _strip_node(node: onnx.NodeProto) -> None:
    node.doc_string = ""
    del node.metadata_props[:]
    for attribute in node.attribute:
        if attribute.HasField("g"):
            _strip(attribute.g)


def difference(a: AnyArray, b: AnyArray) -> float:
    """Return the largest absolute difference, or infinity where the shapes differ."""
    if a.shape != b.shape:
        return float("inf")
    return float(np.max(np.abs(a.astype(np.float64) - b), initial=0.0))


def raw_difference(a: AnyArray, b: AnyArray) -> float:
    """Return the largest difference, divided by the largest absolute value where that is above 1.

    float32 rounds in proportion to the value, so large values need a relative measure.
    """
    return difference(a, b) / max(1.0, float(np.max(np.abs(a), initial=0.0)))


def compare_detections(
    ours: Outputs, theirs: Outputs, tied_scores: Sequence[float] = ()
) -> dict[str, tuple[float, float]]:
    """Compare detections: raw tensors and scores may differ by 10⁻⁴, boxes by 0.1 px.

    Every detection must have a counterpart of the same class. They are matched by box, since detections
    of equal score come in any order. Where a tie between scores decides which detections are reported,
    rounding decides it, so detections whose scores are among ``tied_scores`` need no counterpart.
    """
    result = {"raw": (raw_difference(ours["raw"], theirs["raw"]), _SCORE_ERROR)}
    box_px, score = 0.0, 0.0
    for a, b in ((ours, theirs), (theirs, ours)):
        for box, label, value in zip(a["boxes"][0], a["labels"][0], a["scores"][0], strict=True):
            if label < 0 or value <= _SCORE_ERROR:  # padding or a negligible score
                continue
            if np.isclose(value, tied_scores, rtol=0, atol=1e-6).any():
                continue
            same = b["labels"][0] == label
            away = np.abs(b["boxes"][0] - box).max(axis=-1, initial=0.0)
            away = np.where(same, away, np.inf)
            best = int(np.argmin(away))
            box_px = max(box_px, float(away[best]))
            score = max(score, abs(float(value - b["scores"][0][best])))
    return {**result, "boxes, px": (box_px, 0.1), "scores": (score, _SCORE_ERROR)}
