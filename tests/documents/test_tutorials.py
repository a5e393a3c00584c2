"""The tutorials run as notebooks, as they are but for smaller numbers: your-spacecraft, fly-it and
synthetic-to-real."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from documents import PAGES, ROOT

TUTORIALS = ROOT / "docs/tutorials"
SMALLER = {
    "your-spacecraft": {
        "count: 300": "count: 16",
        "--frame 30": "--frame 3",
        "epochs=40": "epochs=1",
        "epochs=50": "epochs=1",
        "input_px=160": "input_px=64",
        "input_px=128": "input_px=64",
        "[300, 1500, 4700, 5500]": "[300, 1500, 1600, 1700]",
    },
    "fly-it": {
        "range(20)": "range(2)",
        '"flight.period_s": 10': '"flight.period_s": 90',
        "period_s: 10": "period_s: 80",
    },
    "synthetic-to-real": {
        "--frames 40": "--frames 6",
        "times.count=240": "times.count=12",
        "epochs=45": "epochs=1",
        "input_px=160": "input_px=64",
    },
}
"""Tutorial → text of it → the same with another number."""
RUN = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import run
made = run.notebook(Path(sys.argv[1]) / f"{sys.argv[2]}.md", json.loads(sys.argv[3]))
run.execute(made, Path.cwd())
"""


def test_every_tutorial_is_run() -> None:
    pages = {Path(page).stem for page in PAGES if page.startswith("docs/tutorials/")}
    assert pages == SMALLER.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALLER)
def test_a_tutorial_runs(name: str, tmp_path: Path) -> None:
    pytest.importorskip("posse_render_raster")
    pytest.importorskip("posse_detect_torch")
    pytest.importorskip("jupytext")
    import json

    done = subprocess.run(
        [sys.executable, "-c", RUN, str(TUTORIALS), name, json.dumps(SMALLER[name])],
        cwd=tmp_path,
        env={**os.environ, "POSSE_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    # what it shows on the page has been made, by its name or from a page of it
    made = {path.stem for path in tmp_path.rglob("*") if path.suffix in (".png", ".html")}
    shown = re.findall(r"images/tutorials/([\w-]+)\.jpg", (TUTORIALS / f"{name}.md").read_text("utf-8"))
    assert shown
    assert len(made) >= len(shown)
