"""Model files and their cards, and the folders of recipes."""

from __future__ import annotations

import random
from pathlib import Path

import cv2
import numpy as np
import pytest
from damage import damage, damaged_json, damaged_safetensors

from inputs.kind import Kind
from posse_core import ModelCard
from posse_core._detection.card import KEY


def write_boxes_model(path: Path, name: str = "brick") -> None:
    """A graph that finds the same box of a spacecraft in every picture."""
    onnx = pytest.importorskip("onnx")
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    outputs = {
        "boxes": np.array([[[16, 24, 8, 4]]], np.float32),
        "scores": np.array([[0.5]], np.float32),
        "labels": np.array([[0]], np.int64),
    }
    nodes, values = [], []
    for output, array in outputs.items():
        nodes.append(helper.make_node("Constant", [], [output], value=numpy_helper.from_array(array)))
        kind = helper.np_dtype_to_tensor_dtype(array.dtype)
        values.append(helper.make_tensor_value_info(output, kind, array.shape))
    picture = helper.make_tensor_value_info("picture", onnx.TensorProto.FLOAT, ("B", 1, 64, 64))
    graph = helper.make_graph(nodes, "g", [picture], values)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    for key, value in card("boxes", "by-hand", name).metadata().items():
        model.metadata_props.add(key=key, value=value)
    onnx.save(model, path)


def card(task: str, net: str, name: str = "brick") -> ModelCard:
    points = {"B1": [0.0, 0.0, 1.0], "B2": [1.0, 0.0, 1.0]}
    return ModelCard(
        *(net, task, (name,), 64, "", "", "0", {name: points}),
        loose_keypoints={name: ["B2"]},
        symmetries={name: [np.eye(3).tolist()]},
        options={"size": "small"} if net == "heatmap" else {},
    )


def write_models(folder: Path) -> None:
    write_boxes_model(folder / "m.onnx")
    cv2.imwrite(str(folder / "a.png"), np.full((48, 64), 90, np.uint8))
    torch = pytest.importorskip("torch")
    from posse_detect_torch.checkpoint import write_model
    from posse_detect_torch.heatmap import HeatMaps
    from posse_detect_torch.nano import Nano

    torch.set_num_threads(1)
    torch.manual_seed(0)  # of some weights, two peaks are so alike that rounding tells them
    write_model(folder / "nano.safetensors", Nano(1).state_dict(), card("boxes", "nano"))
    write_model(folder / "heatmap.safetensors", HeatMaps(2).state_dict(), card("keypoints", "heatmap"))


def model(folder: Path, draw: random.Random) -> list[str]:
    name = draw.choice(("m.onnx", "nano.safetensors", "heatmap.safetensors"))
    path = folder / name
    if draw.random() < 0.2:
        damage(path, draw)
    elif name == "m.onnx":
        import onnx

        loaded = onnx.load(path)
        (entry,) = loaded.metadata_props
        entry.value = damaged_json(entry.value, draw)
        if draw.random() < 0.2:
            shape = loaded.graph.input[0].type.tensor_type.shape
            shape.dim[draw.randrange(4)].dim_value = draw.choice((0, 1, 3, 65, 2**40))
        path.write_bytes(loaded.SerializeToString())
    else:
        path.write_bytes(damaged_safetensors(path.read_bytes(), KEY, draw))
    if name == "heatmap.safetensors":
        return ["detect", "a.png", "--model", "m.onnx", "--keypoints", name]
    return ["detect", "a.png", "--model", name]


KINDS = {
    "model": Kind(
        write_models,
        model,
        (
            "detect a.png --model m.onnx",
            "detect a.png --model nano.safetensors",
            "detect a.png --model m.onnx --keypoints heatmap.safetensors",
        ),
    ),
}
