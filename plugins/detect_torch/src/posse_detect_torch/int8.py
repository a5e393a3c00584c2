"""8-bit ONNX files by onnxruntime's static quantisation.

Standard QuantizeLinear and DequantizeLinear operations surround the convolutions and matrix products;
the decoding stays in float32.
"""

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
    """Write an 8-bit version of an ONNX model, with its metadata.

    The first convolution stays in float32, since eight bits would lose faint parts of its input.

    Args:
        path: the float32 model.
        out: the file to write.
        pictures: inputs of the network, (1, S, S) each, from which the ranges of its activations are
            measured.
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
            op_types_to_quantize=[*_DENSE, "Relu"],  # onnxruntime merges a Relu into the layer before it
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
    """Silence the advice that onnxruntime's quantiser writes to the root logger."""
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
