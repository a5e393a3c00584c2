"""Damage to input files, drawn at random: bytes, text, JSON and YAML, tables, arrays, links."""

from __future__ import annotations

import copy
import csv
import io
import json
import os
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

NESTED = 10_000
"""Levels of a list that no parser should follow by recursion."""
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 3, 255, 256, 2**31, 2**53, 2**63, 10**9, 10**30, -(10**30)),
    *(0.0, -0.5, 0.3, 1e-300, 1e300, float("nan"), float("inf"), float("-inf")),
    *(
        "",
        "x",
        "1",
        "1e5",
        "\0",
        "a\0b",
        "../x",
        "/etc/passwd",
        "/dev/zero",
        ".",
        "a/b",
        "é",
        "x" * 5000,
    ),
    *([], {}, [[]], [0, 0, 0], [0, 0, 0, 0], [1, 2], ["a", "b", "c"], {"": 0}, {"x": {"y": []}}, [None]),
)
NUMBERS = ("0", "-1", "nan", "inf", "-inf", "1e308", "1e-308", "1e400", "", "x", "99999999999999999999")
YAML_SNIPPETS = (
    "a: &a [*a]\n",
    "x: *none\n",
    "? [a, b]\n: 1\n",
    "<<: 5\n",
    "seed: !!int abc\n",
    "seed: !!bool maybe\n",
    "seed: !!binary x\n",
    "seed: !!python/object:os.system x\n",
    'seed: "\\0"\n',
    "\t- x\n",
    "{[\n",
    "%YAML 9.9\n",
    "--- 1\n--- 2\n",
    "seed: " + "9" * 5000 + "\n",
    "t: " + "[" * NESTED + "\n",
    "a0: &a0 [x, x]\n"
    + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)),
)


def paths_of(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of every value within a value of JSON."""
    yield path
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from paths_of(inner, (*path, key))


def damaged_value(value: Any, draw: random.Random) -> Any:
    """A value of JSON with one part replaced, removed, doubled, wrapped, or under another key."""
    *above, last = draw.choice(list(paths_of({"": value}))[1:])
    root = {"": value}
    holder: Any = root
    for key in above:
        holder = holder[key]
    match draw.choice(("replace", "replace", "replace", "remove", "double", "wrap", "rename", "nest")):
        case "remove" if last != "":
            del holder[last]
        case "double" if isinstance(holder, list):
            holder.insert(last, holder[last])
        case "wrap":
            holder[last] = [holder[last]]
        case "rename" if isinstance(holder, dict) and last != "":
            holder[f"{last}x"] = holder.pop(last)
        case "nest" if draw.random() < 0.1:
            holder[last] = "NESTED"
        case _:
            # A copy: what is damaged further must not become another value of later cases.
            holder[last] = copy.deepcopy(draw.choice(VALUES))
    return root[""]


def damaged_json(text: str, draw: random.Random) -> str:
    value = json.loads(text)
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        value = damaged_value(value, draw)
    return json.dumps(value).replace('"NESTED"', "[" * NESTED + "]" * NESTED)


def damaged_text(text: str, draw: random.Random) -> str:
    """Text with a line or a few characters removed, doubled, exchanged or replaced."""
    lines = text.splitlines(keepends=True) or [""]
    at = draw.randrange(len(lines))
    match draw.choice(("drop", "double", "swap", "cut", "character", "number", "number", "snippet")):
        case "drop":
            del lines[at]
        case "double":
            lines.insert(at, lines[at])
        case "swap":
            other = draw.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        case "cut":
            return text[: draw.randrange(len(text) + 1)]
        case "character":
            k = draw.randrange(len(text) + 1)
            return text[:k] + draw.choice("\0\t\n:-{}[]&*!|>'\"%@`,#é\ud7ff0") + text[k + 1 :]
        case "number":
            words = lines[at].split(" ")
            words[draw.randrange(len(words))] = draw.choice(NUMBERS)
            lines[at] = " ".join(words).rstrip("\n") + "\n"
        case "snippet":
            lines.insert(at, draw.choice(YAML_SNIPPETS))
    return "".join(lines)


def damaged_bytes(data: bytes, draw: random.Random) -> bytes:
    """Bytes flipped, cut, inserted or set; mostly near the start, where headers are."""
    changed = bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 5))):
        at = draw.randrange(min(len(changed), draw.choice((64, 4096, 10**9))) or 1)
        match draw.choice(("flip", "set", "cut", "insert", "drop", "word")):
            case "flip" if changed:
                changed[at] ^= 1 << draw.randrange(8)
            case "set" if changed:
                changed[at] = draw.choice((0, 1, 127, 128, 255))
            case "cut":
                del changed[at:]
            case "insert":
                changed[at:at] = draw.randbytes(draw.choice((1, 4, 100)))
            case "drop":
                del changed[at : at + draw.choice((1, 4, 100))]
            case _:
                changed[at : at + 4] = draw.choice(
                    (b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\0")
                )
    return bytes(changed)


def damaged_csv(text: str, draw: random.Random) -> str:
    """A table with a cell, a row or a column at fault."""
    rows = list(csv.reader(io.StringIO(text)))
    row = draw.randrange(len(rows))
    column = draw.randrange(len(rows[row]))
    match draw.choice(("cell", "cell", "row", "cut row", "column", "zeros", "header")):
        case "cell":
            rows[row][column] = draw.choice(NUMBERS)
        case "row":
            del rows[row]
        case "cut row":
            del rows[row][column:]
        case "column":
            for each in rows:
                del each[column : column + 1]
        case "zeros":
            name = rows[0][column].rstrip("wxyz")
            for each in rows[1:]:
                each[:] = ["0" if rows[0][k].startswith(name) else cell for k, cell in enumerate(each)]
        case "header":
            rows[0][column] = draw.choice(
                ("extra_x[999999999]", "extra_[0]", "t_s", "", "extra_y[0][1]")
            )
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def damage_npz(path: Path, draw: random.Random) -> None:
    """An array of another type, shape or value; or damaged bytes."""
    with np.load(path) as archive:
        arrays = dict(archive)
    name = draw.choice(sorted(arrays))
    array = np.atleast_1d(arrays[name])
    changes: list[Callable[[], Any]] = [
        lambda: np.zeros_like(array),
        lambda: array[:1],
        lambda: array[:0],
        lambda: array[..., None],
        lambda: array.astype(str),
        lambda: array.astype(object),
        lambda: array.astype(np.complex128) if array.dtype.kind in "fiu" else array,
        lambda: (
            np.full_like(array, draw.choice((np.nan, np.inf, 1e300, -1.0)))
            if array.dtype.kind == "f"
            else array
        ),
        lambda: np.full(array.shape, np.iinfo(np.int64).max),
        lambda: array[::-1],
    ]
    with np.errstate(over="ignore"):  # 1e300 in single precision is infinite
        arrays[name] = draw.choice(changes)()
    if draw.random() < 0.1:
        del arrays[name]
    np.savez(path, **arrays)


def damaged_glb(data: bytes, draw: random.Random) -> bytes:
    """Binary glTF of which the JSON is damaged, and whose lengths are right."""
    length = int.from_bytes(data[12:16], "little")
    text = damaged_json(data[20 : 20 + length].decode(), draw).encode()
    text += b" " * (-len(text) % 4)
    body = len(text).to_bytes(4, "little") + data[16:20] + text + data[20 + length :]
    return data[:8] + (12 + len(body)).to_bytes(4, "little") + body


def damaged_safetensors(data: bytes, key: str, draw: random.Random) -> bytes:
    """A file of tensors whose header is damaged, or the JSON under a key of its metadata."""
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    if draw.random() < 0.7:
        header["__metadata__"][key] = damaged_json(header["__metadata__"][key], draw)
    else:
        header = damaged_value(header, draw)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data[8 + length :]


def damage_place(path: Path, draw: random.Random) -> None:
    """Something else in place of a file: a folder, a pipe, a link, nothing."""
    path.unlink()
    match draw.choice(("folder", "pipe", "lost", "dangling", "loop", "device", "empty")):
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "dangling":
            path.symlink_to("nothing")
        case "loop":
            path.symlink_to(path.name)
        case "device":
            path.symlink_to("/dev/zero")
        case "empty":
            path.write_bytes(b"")


def damage(path: Path, draw: random.Random) -> None:
    """Damage a file in a way that suits its kind."""
    chance = draw.random()
    if chance < 0.04:
        return damage_place(path, draw)
    if chance < 0.2:
        path.write_bytes(damaged_bytes(path.read_bytes(), draw))
        return None
    match path.suffix:
        case ".json":
            path.write_text(damaged_json(path.read_text(), draw))
        case ".jsonl":
            lines = path.read_text().splitlines()
            at = draw.randrange(len(lines))
            lines[at] = damaged_json(lines[at], draw)
            path.write_text("\n".join(lines) + "\n")
        case ".csv":
            path.write_text(damaged_csv(path.read_text(), draw))
        case ".npz":
            damage_npz(path, draw)
        case ".glb" if draw.random() < 0.7:
            path.write_bytes(damaged_glb(path.read_bytes(), draw))
        case ".gltf":
            path.write_text(damaged_json(path.read_text(), draw))
        case ".yaml" | ".obj" | ".mtl" | ".txt" | ".oem" | ".aem" | ".sha256":
            text = damaged_text(path.read_text(), draw)
            path.write_bytes(text.encode("utf-8", "surrogatepass"))
        case _:
            path.write_bytes(damaged_bytes(path.read_bytes(), draw))
    return None


def copied(source: Path, target: Path) -> Path:
    shutil.copytree(source, target, symlinks=True)
    return target
