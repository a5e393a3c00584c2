"""Whether the exports beside a dataset are what its writers write from its label lines now.

The readers of :mod:`posse_core._evaluation.exports` prove what an export means; this proves what they do
not read: images, cameras, models, lists, and numbers that only another program takes.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_image
from posse_core._errors import ComponentError, InputError
from posse_core._evaluation.result import Fault, Result
from posse_core._files.atomic import sha256
from posse_core._files.reading import parsed_json, read_bytes, read_text
from posse_core._formats.hf import FOLDER as HF_FOLDER
from posse_core._formats.hf import options_of
from posse_core._plugins.loading import load_plugins
from posse_core._simulator.returned import written

SAME = 1e-12
"""Relative difference of two numbers that are the same."""
_FILES = {
    "bop": "bop/camera.json",
    "coco": "coco.json",
    "colmap": "colmap",
    "hf": "hf/croissant.json",
    "nerfstudio": "nerfstudio",
    "posse": "posse/annotations.json",
    "speed": "speed.json",
    "yolo": "yolo/data.yaml",
}
"""A file of each format, by which an export is known."""
_UNREAD = frozenset({"posse export", "hf export"})
"""Exports that no reader proves: what their writers write is all that they are compared with."""
_PROSE = frozenset({"hf/README.md", "hf/checksums.sha256"})
"""A card names the libraries of a run, which the run itself does not know before it has ended."""
_VERSION = ("info", "version")
_NUMBER_OR_WORD = re.compile(r"[^\s,;:\[\]{}]+")


class _Undivided(Dataset):
    """A dataset as it was before it was divided into parts."""

    is_divided = False


def check_exports_again(dataset: Dataset, sound: frozenset[str]) -> list[Result]:
    """A result for each export that is there; ``sound`` are the names of those that say what the label
    lines say, and others are not compared."""
    results = []
    for name, file in _FILES.items():
        if not (dataset.folder / file).exists() or f"{name} export" not in sound | _UNREAD:
            continue
        result = Result(f"{name} files", "every file is what the writer writes")
        results.append(result)
        try:
            # An export may be older than the partition.
            sources = [dataset, _Undivided(dataset.folder)] if dataset.is_divided else [dataset]
            faults = [_faults(name, source, result) for source in sources]
            result.faults = [Fault(None, text) for text in min(faults, key=len)]
        except (InputError, ComponentError) as error:
            result.faults.append(Fault(None, str(error)))
    return results


def _faults(name: str, dataset: Dataset, result: Result) -> list[str]:
    """What is wrong with the files of an export; their number becomes the result's."""
    faults = []
    result.checked = 0
    registry = load_plugins().registry
    given = options_of(dataset.folder / HF_FOLDER) if name == "hf" else {}
    with tempfile.TemporaryDirectory() as folder:
        writer = registry.create("writer", name, registry.options("writer", name, given))
        written(writer, name, dataset, Path(folder))
        for fresh in sorted(Path(folder).rglob("*")):
            shown = fresh.relative_to(folder).as_posix()
            if fresh.is_dir() or shown in _PROSE:
                continue
            result.checked += 1
            there = dataset.folder / shown
            if not there.is_file():
                faults.append(f"{shown}: missing")
            elif sha256(there) != sha256(fresh):
                difference = _difference(there, fresh)
                if difference is not None:
                    faults.append(f"{shown}: {difference}")
    return faults


def _difference(there: Path, fresh: Path) -> str | None:
    """Where a file differs from what it should be; None if it does not."""
    if fresh.suffix == ".png":
        same = np.array_equal(read_image(there), read_image(fresh))
        return None if same else "it is another image"
    if fresh.suffix == ".ply":
        return "it is another mesh"
    if fresh.suffix == ".json":
        return _unlike(
            parsed_json(read_bytes(there), str(there)), parsed_json(read_bytes(fresh), "it"), ()
        )
    if fresh.suffix in (".yaml", ".yml"):
        return _unlike(yaml.safe_load(read_text(there)), yaml.safe_load(read_text(fresh)), ())
    lines = [read_text(path).splitlines() for path in (there, fresh)]
    if len(lines[0]) != len(lines[1]):
        return f"it has {len(lines[0])} lines instead of {len(lines[1])}"
    for number, texts in enumerate(zip(*lines, strict=True), 1):
        words = [[_value(word) for word in _NUMBER_OR_WORD.findall(text)] for text in texts]
        if _unlike(words[0], words[1], ()) is not None:
            return f"line {number} is not that of the labels"
    return None


def _value(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word


def _unlike(value: Any, wanted: Any, path: tuple[str | int, ...]) -> str | None:
    """The first place at which two values differ."""
    if path == _VERSION:
        return None
    at = ".".join(map(str, path)) or "it"
    if isinstance(value, dict) and isinstance(wanted, dict):
        if value.keys() != wanted.keys():
            others = sorted(map(str, value.keys() ^ wanted.keys()))
            return f"{at} has other keys: {', '.join(others)}"
        pairs = [(key, value[key], wanted[key]) for key in wanted]
    elif isinstance(value, list) and isinstance(wanted, list):
        if len(value) != len(wanted):
            return f"{at} has {len(value)} entries instead of {len(wanted)}"
        pairs = [(i, a, b) for i, (a, b) in enumerate(zip(value, wanted, strict=True))]
    else:
        return None if _equal(value, wanted) else f"{at} is {_short(value)} instead of {_short(wanted)}"
    return next(filter(None, (_unlike(a, b, (*path, key)) for key, a, b in pairs)), None)


def _equal(value: Any, wanted: Any) -> bool:
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in (value, wanted))
    if numbers:
        return bool(abs(value - wanted) <= SAME * max(1.0, abs(wanted)))
    return type(value) is type(wanted) and bool(value == wanted)


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
