"""The examples of the documentation: what pages show as code, and the commands a shell makes of it."""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [
    path.relative_to(ROOT).as_posix()
    for pattern in (
        "README.md",
        "CONTRIBUTING.md",
        "docs/*.md",
        "docs/tutorials/*.md",
        "packaging/*.md",
        "packaging/*/README.md",
        "plugins/*/README.md",
        "plugins/*/docs/*.md",
    )
    for path in sorted(ROOT.glob(pattern))
]
PROGRAMS = ("posse", "python", "make", "pip", "jupytext", "copier", "cd", "pytest", ".")
"""What a line of a shell begins with, in blocks whose language is not named."""
_FENCE = re.compile(r"^```(?P<language>[\w{}-]*)[^\n]*\n(?P<text>.*?)^```", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"(?:^ {4}\S[^\n]*\n)(?:^ {4,}[^\n]*\n|^\n(?= {4}\S))*", re.MULTILINE)
_STARTS = re.compile(rf"(?:{'|'.join(map(re.escape, PROGRAMS))}) ")
_SPAN = re.compile(r"`((?:[A-Z_]+=\S+ )*(?:posse|python|make) [^`\n]+)`")
_SYNOPSIS = re.compile(r"[\[\]…]|\.\.\.|(?<![\w/$.-])[A-Z]+(?![\w.-])")


@dataclass(frozen=True)
class Block:
    """What a page shows as code: its first line, the fence's language ("" without), the text."""

    page: str
    line: int
    language: str
    text: str

    @property
    def name(self) -> str:
        return f"{self.page}:{self.line}"


def read(page: str) -> str:
    return (ROOT / page).read_text("utf-8")


def fenced(page: str, language: str) -> list[Block]:
    """The fenced blocks of a language."""
    text = read(page)
    return [
        Block(page, text.count("\n", 0, found.start()) + 2, found["language"], found["text"])
        for found in _FENCE.finditer(text)
        if found["language"] == language
    ]


def shell(page: str) -> list[Block]:
    """What a shell is to run: fenced blocks of sh, and indented lines that begin with a program."""
    text = read(page)
    without = _FENCE.sub(lambda found: "\n" * found[0].count("\n"), text)
    indented = []
    for found in _INDENTED.finditer(without):
        lines = found[0].splitlines()
        joined = [
            (number, line)
            for number, line in enumerate(lines)
            if _STARTS.match(line.strip()) or (number and lines[number - 1].endswith("\\"))
        ]
        if joined and "⇥" not in found[0]:
            first = text.count("\n", 0, found.start()) + 1 + joined[0][0]
            indented.append(Block(page, first, "", "".join(f"{line.strip()}\n" for _, line in joined)))
    return sorted([*fenced(page, "sh"), *indented], key=lambda block: block.line)


def spans(page: str) -> list[Block]:
    """Commands within sentences that are complete, such as `posse run aqua --frames 9`."""
    return [block for block in _all_spans(page) if not _SYNOPSIS.search(block.text)]


def synopses(page: str) -> list[Block]:
    """Commands within sentences that have words to fill in: `posse export DATASET [--out FOLDER]`."""
    return [block for block in _all_spans(page) if _SYNOPSIS.search(block.text)]


def _all_spans(page: str) -> list[Block]:
    text = _FENCE.sub(lambda found: "\n" * found[0].count("\n"), read(page))
    return [
        Block(page, text.count("\n", 0, found.start()) + 1, "", found[1] + "\n")
        for found in _SPAN.finditer(text)
    ]


_RECORDER = """
exec 3>&1 1>&2
for program in posse python make pip jupytext copier cd pytest ln chromium ffmpeg; do
  eval "$program() { printf '%s\\0' '$program' \\"\\$@\\" >&3; printf '\\1\\0' >&3; }"
done
source() { :; }
.() { :; }
…() { :; }
"""


def commands(block: Block, home: Path) -> list[list[str]]:
    """The words of each program that bash starts for a block, with variables, loops and functions
    expanded; the programs themselves do not run. Files that it redirects to are made in ``home``."""
    for folder in (".local/share/bash-completion/completions", ".config/fish/completions"):
        (home / folder).mkdir(parents=True, exist_ok=True)
    done = subprocess.run(
        ["bash", "-c", f"{_RECORDER}\n{block.text}"],
        capture_output=True,
        stdin=subprocess.DEVNULL,
        cwd=home,
        env={**os.environ, "HOME": str(home)},
        text=True,
        check=False,
    )
    assert not done.stderr.strip(), f"{block.name}: {done.stderr}"
    return [run.split("\0")[:-1] for run in done.stdout.split("\1\0") if run]
