"""The public face is recorded, documented, all that our plugins use, and quick to import."""

from __future__ import annotations

import ast
import difflib
import importlib.util
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import GenericAlias

import pytest

import posse_core

ROOT = Path(__file__).parents[1]
REGENERATE = ROOT / "tests" / "authorities" / "regenerate_public_face.py"
PLUGIN_FILES = sorted(
    [
        *ROOT.glob("plugins/*/src/**/*.py"),
        *ROOT.glob("examples/*/src/**/*.py"),
        *ROOT.glob("examples/*/tests/*.py"),
    ]
)
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
_PRIVATE = re.compile(r"posse_core\._\w+")


def private_names(source: str) -> Iterator[str]:
    """What a module uses of posse_core that is not public, be it imported or named in a string."""
    public = {*posse_core.__all__, "__version__"}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names = _PRIVATE.findall(node.value)
        else:
            continue
        for name in names:
            package, _, rest = name.partition(".")
            if package == "posse_core" and rest and rest.split(".")[0] not in public:
                yield name


def test_what_is_private_is_seen() -> None:
    source = """
import posse_core._files
import posse_core._frames as frames
from posse_core._model.camera import Camera
from posse_core import Dataset, _files, testing
from posse_core.testing import scenes
def late():
    from posse_core import absent
    return "posse_core._run.attempts:PoolOptions", "posse_core:PoolOptions"
"""
    assert sorted(private_names(source)) == [
        "posse_core._files",
        "posse_core._files",
        "posse_core._frames",
        "posse_core._model.camera.Camera",
        "posse_core._run",
        "posse_core.absent",
    ]


@pytest.mark.parametrize("path", PLUGIN_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_our_plugins_use_the_public_face_alone(path: Path) -> None:
    used = sorted(private_names(path.read_text(encoding="utf-8")))
    assert not used, (
        f"{path.relative_to(ROOT)} uses {', '.join(used)}; import public names of posse_core"
    )


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_documented_examples_use_the_public_face_alone(path: Path) -> None:
    code = re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), flags=re.S)
    used = [name for block in code for name in _PRIVATE.findall(block)]
    assert not used, (
        f"{path.relative_to(ROOT)} uses {', '.join(used)}; import public names of posse_core"
    )


def test_the_face_is_the_recorded_one() -> None:
    spec = importlib.util.spec_from_file_location("regenerate_public_face", REGENERATE)
    assert spec is not None
    assert spec.loader is not None
    recorder = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(recorder)
    recorded, found = (
        recorder.RECORD.read_text(encoding="utf-8").splitlines(),
        recorder.face().splitlines(),
    )
    changes = "\n".join(difflib.unified_diff(recorded, found, "recorded", "found", lineterm="", n=0))
    assert recorded == found, (
        f"the public names of posse_core or their signatures have changed:\n{changes}\nIf this is meant,"
        f" record it by: python {REGENERATE.relative_to(ROOT)}"
    )


@pytest.mark.parametrize("name", posse_core.__all__)
def test_every_public_name_is_documented(name: str) -> None:
    value = getattr(posse_core, name)
    if isinstance(value, GenericAlias):  # of numpy's arrays, which have their own
        return
    text = value.__doc__
    assert text, f"{name} has no docstring"
    assert not text.startswith(f"{name}("), f"{name} has no docstring but its signature"


def test_the_import_brings_no_heavy_library() -> None:
    code = "import json, sys, posse_core; print(json.dumps(list(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"scipy", "cv2", "torch", "mitsuba", "bpy", "casadi", "trimesh", "matplotlib"}
    assert not heavy & set(json.loads(done.stdout))
