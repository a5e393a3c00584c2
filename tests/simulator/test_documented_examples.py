"""The examples of docs/simulator.md, docs/joints.md and of the README, each as a plain script of its
own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GUIDE = "".join((ROOT / "docs" / f"{page}.md").read_text("utf-8") for page in ("simulator", "joints"))
EXAMPLES = re.findall(r"```python\n(.*?)```", GUIDE, flags=re.S)


@pytest.fixture(autouse=True)
def raster() -> None:
    """The examples ask for the raster renderer, which needs OpenGL."""
    pytest.importorskip("posse_render_raster")


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_an_example_runs_without_a_guard(number: int, tmp_path: Path) -> None:
    (tmp_path / "example.py").write_text(EXAMPLES[number], encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", "example.py"],
        cwd=tmp_path,
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_first_example_finds_the_pose(tmp_path: Path) -> None:
    """Its two positions, the labelled one and the one found in the image, are within 3 %."""
    script = EXAMPLES[0] + (
        "import numpy as np\n"
        "away = np.linalg.norm(pose.t_body_cam_m - np.array(shot.labels.t_body_cam_m))\n"
        "assert away < 0.03 * shot.labels.range_m, away\n"
        "assert abs(shot.labels.range_m - np.sqrt(6**2 + 22**2 + 9**2)) < 1e-9\n"
    )
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True, timeout=300)


def test_the_readme_has_the_first_example() -> None:
    assert EXAMPLES[0] in (ROOT / "README.md").read_text(encoding="utf-8")
