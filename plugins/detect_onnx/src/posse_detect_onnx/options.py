"""Options of detectors from ONNX files."""

from __future__ import annotations

from pydantic import Field

from posse_core import Options


class OnnxOptions(Options):
    """How onnxruntime runs a model."""

    threads: int = Field(1, ge=1, description="CPU threads")
