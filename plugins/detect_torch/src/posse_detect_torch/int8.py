"""ONNX files of eight bits, by onnxruntime's static quantisation: standard QuantizeLinear and
DequantizeLinear around convolutions and matrix products; decoding stays in float32."""

from __future__ import annotations

import contextlib
import logging
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import onnx
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static

from posse_core import Float32Array, atomic_file

_DENSE = ("Conv", "Gemm", "MatMul")


class _Pictures(CalibrationDataReader):  # type: ignore[misc]
    def __init__(self, pictures: Iterable[Float32Array]) -> None:
        self._pictures = iter(pictures)

    def get_next(self) -> dict[str, Any] | None:
        picture = next(self._pictures, None)
        return None if picture is None else {"picture": picture[None]}


def write_int8(path: Path, out: Path, pictures: Iterable[Float32Array]) -> None:
    """Write the net of ``path`` in eight bits to ``out``, with its metadata.

    The first convolution stays in float32: it sees faint light, of which eight bits keep too little.

    Args:
        pictures: (1, S, S) each, as the net takes them; they tell how far its activations reach.
    """
    exact = onnx.load(path)
    first = next(node.name for node in exact.graph.node if node.op_type == "Conv")
    with tempfile.TemporaryDirectory() as folder, _quiet():
        done = Path(folder) / "int8.onnx"
        quantize_static(
            path,
            done,
            _Pictures(pictures),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=[*_DENSE, "Relu"],  # which becomes a part of what is before it
            nodes_to_exclude=[first],
            per_channel=True,
            activation_type=QuantType.QInt8,
            weight_type=QuantType.QInt8,
        )
        model = onnx.load(done)
    del model.metadata_props[:]
    model.metadata_props.extend(exact.metadata_props)
    used = {node.domain for node in model.graph.node}
    imported = [entry for entry in model.opset_import if entry.domain in used]
    del model.opset_import[:]
    model.opset_import.extend(imported)
    onnx.checker.check_model(model)
    with atomic_file(out) as file:
        file.write(model.SerializeToString())


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without onnxruntime's advice to users of its quantiser, which goes to the root logger."""
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
