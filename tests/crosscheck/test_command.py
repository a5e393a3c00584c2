"""``posse crosscheck`` with a renderer whose every fault is known, in worker processes."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

PACKAGES = Path(__file__).parents[1] / "packages"
Crosscheck = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for PYTHONPATH that holds ``posse-render-crooked``, as pip lays it."""
    folder = tmp_path_factory.mktemp("site")
    source = PACKAGES / "crooked" / "posse_crooked.py"
    (folder / "posse_crooked.py").write_text(source.read_text())
    info = folder / "posse_render_crooked-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: posse-render-crooked\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[posse]\nrender_crooked = posse_crooked\n")
    return folder


def run(site: Path, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.fixture(scope="module")
def crosscheck(site: Path) -> Crosscheck:
    """The command, in a process of its own."""
    code = "from posse_core._cli.main import main; main()"
    return lambda *arguments: run(site, code, "crosscheck", *map(str, arguments))


def last_line(done: subprocess.CompletedProcess[str]) -> str:
    return re.split(r"[\r\n]", done.stderr.strip())[-1]


def test_upright_passes_and_every_fault_of_crooked_is_measured_and_named(
    crosscheck: Crosscheck, tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    done = crosscheck(
        *("fiducials", "lambert-plate", "--renderers", "upright,crooked", "--json", "--out", page),
        *("-o", "crooked.gain=1.08", "-o", "crooked.shift_px=0.4", "-o", "crooked.depth_offset_m=0.25"),
    )
    assert done.returncode == 1, done.stderr
    said = json.loads(done.stdout)
    assert not said["passed"]
    fiducials, plate = said["cases"]

    good, bad = fiducials["renderers"]["upright"], fiducials["renderers"]["crooked"]
    assert good["iou"] > 0.99
    assert good["edge_worst_px"] < 0.06
    assert good["landmark_worst_px"] < 0.06
    assert good["depth_p99_m"] == 0.0
    assert bad["landmark_worst_px"] == pytest.approx(0.4, abs=0.06)
    # A contour moved to the right by d: |d cos| on average, which on squares is between 1/2 and 0.71.
    assert 0.19 < bad["edge_px"] < 0.3
    for frame in fiducials["frames"]:
        assert frame["renderers"]["crooked"]["shift_right_px"] == pytest.approx(0.4, rel=0.3)
        assert abs(frame["renderers"]["crooked"]["shift_down_px"]) < 0.05
    assert bad["depth_median_m"] == pytest.approx(0.25, abs=1e-6)

    ratios = {name: values["expected_ratio"] for name, values in plate["renderers"].items()}
    assert ratios == {"upright": pytest.approx(1, abs=1e-5), "crooked": pytest.approx(1.08, rel=1e-5)}
    pair = "upright / crooked"
    assert plate["pairs"][pair]["radiance_ratio"] == pytest.approx(1 / 1.08, rel=1e-5)
    assert plate["materials"][pair] == {"clay": pytest.approx(1 / 1.08, rel=1e-5)}
    assert plate["parts"][pair] == {"plate": pytest.approx(1 / 1.08, rel=1e-5)}
    assert plate["renderers"]["upright"]["noise"] == 0.0

    broken = {(c["case"], c["who"], c["what"]) for c in said["checks"] if not c["passed"]}
    assert ("fiducials", "crooked", "edge distance (px)") in broken
    assert ("lambert-plate", "crooked", "Lambertian radiance error") in broken
    assert ("lambert-plate", pair, "mean radiance difference") in broken
    assert not any(who == "upright" and what != "silhouette IoU" for _, who, what in broken)
    assert "lambert-plate: crooked: Lambertian radiance error is 0.08" in last_line(done)

    text = page.read_text("utf-8")
    assert text.count("data:image/jpeg;base64,") == 6 * 5
    assert not re.search(r"(src|href)\s*=\s*[\"'](?!data:)|https?://|@import|<script", text)


def test_thresholds_are_options(crosscheck: Crosscheck) -> None:
    arguments = ("lambert-plate", "--renderers", "crooked", "-o", "crooked.gain=1.02")
    assert crosscheck(*arguments).returncode == 1
    eased = crosscheck(*arguments, "--max-lambert", 0.03)
    assert eased.returncode == 0, eased.stderr
    assert "lambert-plate" in eased.stdout


def test_a_crash_of_one_is_one_line_and_the_others_are_still_compared(crosscheck: Crosscheck) -> None:
    done = crosscheck(
        *("lambert-plate", "--renderers", "upright,crooked", "--json"),
        *("-o", "crooked.dies_in_frame=1"),
    )
    assert done.returncode == 3
    assert (
        "lambert-plate: crooked failed: frame 1: its worker died (exit code -9), 3 times"
        in last_line(done)
    )
    case = json.loads(done.stdout)["cases"][0]
    assert case["renderers"]["upright"]["frames"] == 3
    assert case["renderers"]["crooked"]["frames"] == 2


BAD_INPUT = [
    ("aqua --renderers uprigt", "no renderer named 'uprigt'; did you mean 'upright'?"),
    ("aqua --renderers upright,upright", "'upright' is given twice"),
    ("aqua --renderers upright -o renderer.gain=2", "as in -o upright.gain"),
    ("aqua --renderers upright -o crooked.gain=2", "not among --renderers upright"),
    ("aqua --renderers upright -o upright.gian=2", "did you mean 'gain'?"),
    ("lambert-spere --renderers upright", "did you mean 'lambert-sphere'?"),
    ("aqua --renderers upright --min-iou 2", "--min-iou"),
    ("checker --renderers upright --out /nowhere/p.html", "--out /nowhere/p.html"),
]


def test_bad_input_is_one_line(site: Path) -> None:
    code = (
        "import sys\nfrom posse_core._cli.main import main\n"
        "for line in sys.argv[1:]:\n"
        "    try:\n        main(['crosscheck', *line.split()])\n"
        "    except SystemExit as end:\n        print(end.code)\n"
    )
    done = run(site, code, *(line for line, _ in BAD_INPUT))
    assert done.stdout.split() == ["2"] * len(BAD_INPUT), done.stderr
    for said, (_, words) in zip(done.stderr.splitlines(), BAD_INPUT, strict=True):
        assert words in said
