"""The benchmarks are run by hand; what they import must not have moved meanwhile."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
NEEDS = {"detectors": ("onnxruntime", "torch", "posse_detect_onnx", "posse_detect_torch")}
"""Packages that a machine with the core alone lacks; the other benchmarks need none."""


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_a_benchmark_finds_all_that_it_imports(path: Path) -> None:
    for package in NEEDS.get(path.stem, ()):
        pytest.importorskip(
            package, reason=f"{package}, which this benchmark measures, is not installed"
        )
    words = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='benchmark')"
    done = subprocess.run([sys.executable, "-c", words, path], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
