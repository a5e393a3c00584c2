"""What takes seconds is said on a terminal, and only there."""

import ast
import os
import pty
import re
import subprocess
import sys
import termios
from pathlib import Path

from small_run import BOX_OBJ, SCENARIO

import posse_core

CORE = Path(posse_core.__file__).parent
POSSE = "from posse_core._cli.main import main; main()"


def on_terminal(*arguments: object, path: Path | None = None) -> tuple[str, str]:
    """What posse writes to a pipe as stdout and to a terminal as stderr; plugins are in ``path``."""
    paths = [str(path or ""), os.environ.get("PYTHONPATH", "")]
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 100))
    with subprocess.Popen(
        [sys.executable, "-c", POSSE, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=theirs,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
    ) as process:
        os.close(theirs)
        seen = b""
        while chunk := _read(ours):
            seen += chunk
        assert process.stdout is not None
        out = process.stdout.read().decode()
    os.close(ours)
    assert process.returncode == 0, seen.decode()
    return out, seen.decode()


def _read(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 4096)
    except OSError:  # Linux says so when the other end has closed
        return b""


def last_row(shown: str) -> str:
    """What stays visible of one row of a terminal that a program has written over."""
    row: list[str] = []
    for piece in shown.replace("\x1b[A", "").split("\r"):
        row[: len(piece)] = piece
    return "".join(row).strip()


PROPAGATE = ("propagate", "aqua", "--frames", "2", "--out")


def test_a_phase_is_said_on_a_terminal_and_wiped_away(tmp_path):
    out, shown = on_terminal(*PROPAGATE, tmp_path / "t.npz")
    assert "computing the trajectory ..." in shown
    assert last_row(shown) == ""
    assert out == f"{tmp_path / 't.npz'}: 2 states\n"


def test_nothing_is_said_where_there_is_no_terminal(posse_in, tmp_path):
    done = posse_in(tmp_path, *PROPAGATE, "t.npz")
    assert (done.returncode, done.stderr) == (0, "")


def test_doctor_says_what_it_checks_and_writes_findings_as_they_come():
    out, shown = on_terminal("doctor")
    said = re.findall(r"checking ([a-z -]+) \.\.\.", shown)
    assert said[:2] == ["libraries", "plugins"]
    assert {"propagators", "detectors", "executors"} <= set(said)
    assert out.startswith("ok   python: ")


def test_a_run_says_that_the_renderer_is_being_opened(flat_renderer_path, tmp_path):
    (tmp_path / "box.obj").write_text(BOX_OBJ)
    (tmp_path / "small.yaml").write_text(SCENARIO)
    _, shown = on_terminal(
        *("run", tmp_path / "small.yaml", "--frames", 2, "--out", tmp_path / "d"),
        path=flat_renderer_path,
    )
    assert "preparing the trajectory and the spacecraft ..." in shown
    assert shown.index("opening the renderer:   0%") < shown.index("50%")
    assert "2/2" in shown
    _, again = on_terminal("run", "--resume", "--out", tmp_path / "d", path=flat_renderer_path)
    assert "looking for frames that are there ..." in again
    out, checked = on_terminal("validate", tmp_path / "d")
    assert "comparing checksums ..." in checked
    assert checked.index("comparing checksums") < checked.index("2/2")
    assert "checksums" in out


def test_bars_are_written_by_the_modules_for_them_alone():
    writing = {
        path.relative_to(CORE)
        for path in CORE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Import | ast.ImportFrom)
        and "tqdm" in [getattr(node, "module", ""), *(alias.name for alias in node.names)]
    }
    assert writing == {Path("_cli/progress.py"), Path("_cli/recipe_clock.py")}
