"""The benchmarks are run by hand; what they import must not have moved meanwhile."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
PLUGINS = ("posse_detect_onnx", "posse_detect_torch", "onnxruntime", "torch")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_a_benchmark_finds_all_that_it_imports(path: Path) -> None:
    words = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='benchmark')"
    done = subprocess.run([sys.executable, "-c", words, path], capture_output=True, text=True)
    missing = [name for name in PLUGINS if f"No module named '{name}'" in done.stderr]
    if missing:
        pytest.skip(f"{missing[0]} is not installed")
    assert done.returncode == 0, done.stderr
