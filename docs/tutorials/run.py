"""Runs the tutorials as notebooks: ``python docs/tutorials/run.py FOLDER [PAGE.md]...``.

The pages are the notebooks' only source, in jupytext's Markdown: blocks of python and sh are cells, the
rest is text. Each is executed in FOLDER/PAGE, where what it makes is left, with the notebook and its
outputs. For each heading the minutes on the clock and those of processor time are printed. Then
``python docs/page_pictures.py FOLDER`` makes the pages' pictures.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import jupytext
import nbformat
import psutil
from jupyter_client import AsyncKernelManager
from nbclient import NotebookClient

HERE = Path(__file__).resolve().parent
PAGES = sorted(HERE.glob("*.md"))
_LINK = re.compile(r"\]\((?P<path>[^)#:\s]+)(?P<rest>#[^)\s]*)?\)")
_HEADING = re.compile(r"^#+ (.*)", re.MULTILINE)


@dataclass
class Step:
    """What the cells below a heading took, in seconds: on the clock, and of all processes together."""

    heading: str
    clock_s: float = 0.0
    processor_s: float = 0.0


def notebook(page: Path, numbers: Mapping[str, str] | None = None) -> Any:
    """The notebook of a page.

    Args:
        page: its Markdown.
        numbers: text with a number in it → the same with another number, for a quicker run.

    Raises:
        ValueError: a text is not in the page, or more than numbers differ.
    """
    text = page.read_text("utf-8")
    for before, after in (numbers or {}).items():
        if before not in text or re.sub(r"[\d.]+", "", before) != re.sub(r"[\d.]+", "", after):
            raise ValueError(f"{page.name}: {before!r} → {after!r}")
        text = text.replace(before, after)
    # a notebook lies elsewhere than its page, whose pictures and pages it links
    text = _LINK.sub(
        lambda found: f"]({(page.parent / found['path']).resolve()}{found['rest'] or ''})", text
    )
    made = jupytext.reads(text, fmt="md")
    for cell in made.cells:
        if cell.cell_type == "code" and cell.source.startswith("%%sh\n"):
            cell.source = cell.source.replace("%%sh\n", "%%sh -e\n", 1)  # the first failure ends a cell
    return made


def execute(made: Any, folder: Path) -> list[Step]:
    """Execute a notebook in a folder, with ``posse`` of this Python, and write it there.

    Raises:
        nbclient.exceptions.CellExecutionError: a cell failed.
    """
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    steps = [Step("before the first heading")]
    sockets = tempfile.TemporaryDirectory()
    manager = AsyncKernelManager(kernel_name="python3", transport="ipc", ip=f"{sockets.name}/kernel")
    client = NotebookClient(
        made, manager, timeout=1800, startup_timeout=300, resources={"metadata": {"path": str(folder)}}
    )
    before_s = 0.0

    def started(cell: Any, cell_index: int) -> None:
        steps.extend(map(Step, _HEADING.findall(cell.source) if cell.cell_type == "markdown" else ()))

    def executed(cell: Any, cell_index: int, execute_reply: Any) -> None:
        nonlocal before_s
        times = psutil.Process(manager.provisioner.pid).cpu_times()
        now_s = sum(times[:4])
        steps[-1].processor_s += now_s - before_s
        before_s = now_s
        timing = cell.metadata["execution"]
        steps[-1].clock_s += _seconds(timing["iopub.execute_input"], timing["shell.execute_reply"])

    client.on_cell_start = started
    client.on_cell_executed = executed
    try:
        with sockets:
            client.execute(env={**os.environ, "PATH": path, "MPLBACKEND": "Agg"})
    finally:
        nbformat.write(made, folder / "notebook.ipynb")
    return [step for step in steps if step.clock_s]


def _seconds(start: str, end: str) -> float:
    return (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()


def main(out: str, *names: str) -> None:
    for page in [HERE / name for name in names] or PAGES:
        folder = Path(out) / page.stem
        folder.mkdir(parents=True)
        steps = execute(notebook(page), folder.resolve())
        print(f"{page.name}: {sum(step.clock_s for step in steps) / 60:.1f} min")
        for step in steps:
            minutes = f"{step.clock_s / 60:5.1f} min, {step.processor_s / 60:5.1f} of processor time"
            print(f"  {minutes}: {step.heading}")


if __name__ == "__main__":
    main(*sys.argv[1:])
