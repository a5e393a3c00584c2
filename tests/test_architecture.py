"""The map of imports within the core: no cycles, every arrow to a room listed before, no heavy library.

A room is a private package or module at the top of ``posse_core``. What a function imports when it is
called, and what only a type checker imports, count as much as what stands at the head of a module.
"""

from __future__ import annotations

import ast
from collections.abc import Container, Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import metadata
from pathlib import Path

import pytest

import posse_core

ROOT = Path(posse_core.__file__).parent
ROOMS = (
    "_errors",
    "_constants",
    "_arrays",
    "_frames",
    "_randomness",
    "_threads",
    "_model",
    "_plugins",
    "_environment",
    "_dynamics",
    "_files",
    "_dataset",
    "_scenario",
    "_geometry",
    "_interfaces",
    "_attitude",
    "_joints",
    "_propagators",
    "_annotators",
    "_spacecraft",
    "_trajectory",
    "_guidance",
    "_sky",
    "_imaging",
    "_sensors",
    "_simulator",
    "_formats",
    "_run",
    "testing",
    "_selection",
    "_evaluation",
    "_refinement",
    "_detection",
    "_photos",
    "_navigation",
    "_view",
    "_recipe",
    "_adaptation",
    "_flight",
    "_api",
    "_cli",
)
"""Each room imports from itself and from those before it."""
BACKENDS = {"torch", "bpy", "mitsuba", "drjit", "OpenGL", "pyrender", "moderngl", "onnxruntime", "ray"}
"""Libraries of renderers, detectors and executors: only the plugins that need one import it."""


@cache
def imports() -> Mapping[str, frozenset[str]]:
    """Module of the core → every module that it imports, by the full names."""
    paths = {_name_of(path): path for path in ROOT.rglob("*.py")}
    return {
        name: frozenset(imported(path.read_text(encoding="utf-8"), paths))
        for name, path in paths.items()
    }


def _name_of(path: Path) -> str:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(source: str, ours: Container[str]) -> Iterator[str]:
    """Every import in a module's text, wherever it stands; ``from posse_core import x`` gives the module
    of that name or, where there is none, the face's name ``posse_core.x``."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports within the core are absolute"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full in ours or node.module == "posse_core" else str(node.module)


def within() -> Mapping[str, set[str]]:
    """Module of the core → modules of the core that it imports."""
    ours = imports()
    return {name: {other for other in found if other in ours} for name, found in ours.items()}


def room(module: str) -> str:
    return module.split(".")[1] if "." in module else module


def cycle(graph: Mapping[str, set[str]]) -> list[str] | None:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return None


def test_every_room_is_listed():
    assert {room(module) for module in imports()} == {*ROOMS, "posse_core"}


def test_modules_import_each_other_in_no_cycle():
    assert cycle(within()) is None


def test_rooms_import_each_other_in_no_cycle():
    rooms: dict[str, set[str]] = {}
    for module, others in within().items():
        rooms.setdefault(room(module), set()).update(map(room, others))
    assert cycle({name: others - {name} for name, others in rooms.items()}) is None


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_imports_only_rooms_before_it(name):
    allowed = {*ROOMS[: ROOMS.index(name) + 1], "posse_core"}
    up = [
        f"{module} imports {other}"
        for module, others in within().items()
        for other in others
        if room(module) == name and room(other) not in allowed
    ]
    assert up == []


def test_the_core_takes_nothing_from_its_own_face():
    """The face imports its names lazily: a room that took one would hide an arrow from these tests."""
    names = {f"posse_core.{name}" for name in posse_core.__all__} - set(imports())
    assert names
    assert [module for module, others in imports().items() if others & names] == []


def test_the_core_imports_no_plugin_and_none_of_their_libraries():
    plugins = {entry.value.split(":")[0].split(".")[0] for entry in metadata.entry_points(group="posse")}
    assert "posse_render_raster" in plugins
    for module, others in imports().items():
        assert not {other.split(".")[0] for other in others} & (BACKENDS | plugins), module


def test_imports_are_seen_wherever_they_stand():
    source = """
import torch.nn
from posse_core import Camera, _frames as frames
if TYPE_CHECKING:
    from posse_core._run import plan
def f():
    from posse_core._errors import InputError
"""
    assert set(imported(source, {"posse_core._frames", "posse_core._run.plan"})) == {
        "torch.nn",
        "posse_core.Camera",
        "posse_core._frames",
        "posse_core._run.plan",
        "posse_core._errors",
    }


def test_a_cycle_is_found():
    assert cycle({"a": {"b"}, "b": {"c"}, "c": set()}) is None
    assert cycle({"a": {"b"}, "b": {"c"}, "c": {"a"}}) is not None
