"""Damaged input of every kind ends as docs/running.md says: an exit code of 0 to 3, and one line.

Each case damages a copy of a sound input, by a seed and its number, and runs a command on it in a forked
process of limited time and memory. By default a few cases of each kind are tried, and others every day::

    POSSE_FUZZ_SECONDS=3600 POSSE_FUZZ_SEED=7 python -m pytest tests/fuzz

tries cases for an hour in all; ``POSSE_FUZZ_CASE=12`` repeats one case of each kind.
"""

from __future__ import annotations

import contextlib
import datetime
import os
import random
import re
import shlex
import shutil
import stat
import time
from pathlib import Path

import pytest
from damage import copied
from forked import MOST_BYTES, Ended, Origin
from inputs import crafts, datasets, learning, models, pictures, scenarios, tables
from inputs.kind import Kind

from posse_core._files.atomic import sha256

SEED = os.environ.get("POSSE_FUZZ_SEED", datetime.date.today().isoformat())
SECONDS = float(os.environ.get("POSSE_FUZZ_SECONDS", "0"))
CASE = os.environ.get("POSSE_FUZZ_CASE")
CASES = 4
"""Cases of each kind where no time is given."""
SHOWN = 15
PACKAGE = "spacecraft.yaml"
"""The file that a folder lacks which is no package."""
CACHES = (".ses", "torchinductor_")
"""Temporary files that onnxruntime and torch keep between processes."""
LONGEST = 1500
"""The most characters of a clear line: a value that is longer is shown in part."""
PART = 200
"""Characters of a long word by which a line that shows a part of it names it."""
KINDS: dict[str, Kind] = {
    **scenarios.KINDS,
    **datasets.KINDS,
    **tables.KINDS,
    **crafts.KINDS,
    **models.KINDS,
    **learning.KINDS,
    **pictures.KINDS,
}
PYTHON = re.compile(
    r"\b[A-Z][A-Za-z]+Error\b|\bNoneType\b|object is not|has no attribute|<class |encountered in "
)
"""Words of Python and NumPy that tell a user nothing."""
ENDS = re.compile(
    r"--out \S+: (is a file; choose|its folder does not exist|cannot be created)|--trust \S+: no pose"
)
"""How a sound input is refused that would be worked on for long."""


@pytest.fixture(scope="module")
def origin():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "1")
        with contextlib.closing(Origin()) as origin:
            yield origin


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_input_ends_in_one_line(kind, tmp_path, origin):
    sound = tmp_path / "sound"
    sound.mkdir()
    KINDS[kind].write(sound)
    check_sound(KINDS[kind], origin, sound, tmp_path / f"{kind}-sound")
    until = time.monotonic() + SECONDS / len(KINDS)
    number = int(CASE or 0)
    failures = []
    while (
        number < CASES if not (SECONDS or CASE) else time.monotonic() < until or number == int(CASE or 0)
    ):
        folder = copied(sound, tmp_path / f"{kind}-{number}")
        arguments = KINDS[kind].case(folder, random.Random(f"{SEED} {kind} {number}"))
        faults, error = tried(KINDS[kind], origin, folder, arguments)
        if faults:
            failures.append(
                f"case {number}: posse {' '.join(arguments)[:300]}: {'; '.join(faults)}\n{error[-2000:]}"
            )
            print(kind, failures[-1])  # a run of an hour shows them as they come
        else:
            shutil.rmtree(folder)
        number += 1
        if CASE:
            break
    print(f"{kind}: {number} cases, {len(failures)} failures")
    assert not failures, "\n".join([f"seed {SEED}, {len(failures)} of {number}", *failures[:SHOWN]])


def check_sound(kind: Kind, origin: Origin, sound: Path, folder: Path) -> None:
    """Check that the input is sound: were it refused, its damage would show nothing."""
    for command in kind.sound:
        copied(sound, folder)
        ended = origin.run(folder, shlex.split(command))
        assert ended.code == 0 or (ended.code == 2 and ENDS.search(ended.error)), (
            f"posse {command}: {ended}"
        )
        shutil.rmtree(folder)


def tried(kind: Kind, origin: Origin, folder: Path, arguments: list[str]) -> tuple[list[str], str]:
    """What is wrong with how a case ends, and what it said."""
    before = files_in(folder)
    ended = origin.run(folder, arguments)
    after = files_in(folder)
    changed = [
        name for name in after if after[name] != before.get(name) and not name.startswith(kind.keeps)
    ]
    changed += [name for name in before if name not in after]
    return faults_of(ended, changed, words_of(arguments, before)), ended.error


def files_in(folder: Path) -> dict[str, str]:
    """Every file and folder, and what is seen of its change: its kind, and the bytes of a file."""
    found = {}
    for path in folder.rglob("*"):
        kind = stat.filemode(path.lstat().st_mode)[0]
        found[str(path.relative_to(folder))] = kind + (sha256(path) if kind == "-" else "")
    return found


def words_of(arguments: list[str], files: dict[str, str]) -> set[str]:
    """Words by which a line may name what is at fault: of the command, or files."""
    words = {re.split("[=#]", word)[0] for word in arguments[1:]} | {PACKAGE}
    return {word for word in words | {Path(name).name for name in files} if word}


def faults_of(ended: Ended, changed: list[str], words: set[str]) -> list[str]:
    """What is wrong with the end of a command."""
    faults = []
    if ended.code not in (0, 1, 2, 3):
        faults.append(f"exit code {ended.code} after {ended.seconds:.0f} s")
    if ended.most_bytes > MOST_BYTES:
        faults.append(f"{ended.most_bytes / 2**30:.1f} GiB of memory")
    if ended.alive:
        faults.append(f"processes that go on: {', '.join(ended.alive)}")
    left = [name for name in ended.temporary if not name.startswith(CACHES)]
    if left and ended.code != 4:
        faults.append(f"left the temporary files {', '.join(left[:5])}")
    if "Traceback" in ended.error:
        faults.append("a traceback")
    lines = [line for line in ended.error.split("\n") if line.strip() and not is_progress(line)]
    strange = [line for line in lines if not line.startswith("posse: ")]
    if strange:
        faults.append(f"{strange[0][:100]!r}, which no message begins with")
    errors = [line for line in lines if not line.startswith("posse: warning: ")]
    if ended.code in (1, 2) and len(errors) != 1:
        faults.append(f"{len(errors)} lines of error")
    if ended.code == 2 and changed:
        faults.append(f"left or changed {', '.join(changed[:5])}")
    named = "|".join(
        re.escape(word[:PART]) + ("" if len(word) > PART else r"(?!\w)") for word in sorted(words)
    )
    if ended.code == 2 and not any(re.search(rf"(?<!\w)({named})", line) for line in errors):
        faults.append("a line that names no input")
    for line in lines:
        if len(line) > LONGEST:
            faults.append(f"a line of {len(line)} characters")
        if ended.code != 3 and (found := PYTHON.search(line)):  # of 3, a component may be any program
            faults.append(f"a line that says {found[0]!r}")
    return faults


def is_progress(line: str) -> bool:
    """A bar, or the curve of a training and the words that explain it."""
    return "%|" in line or "frame/s" in line or "0frame [" in line or line.startswith(("epoch ", "  "))
