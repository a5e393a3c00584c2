"""The built-in scenarios give the labels that they gave in the release before, to the bit."""

import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest

_SPEC = importlib.util.spec_from_file_location(
    "regenerate_built_in_labels", Path(__file__).with_name("regenerate_built_in_labels.py")
)
assert _SPEC is not None
assert _SPEC.loader is not None
recorder = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(recorder)
RECORDED: dict[str, Any] = json.loads(recorder.RECORD.read_text(encoding="utf-8"))


def numbers(value: Any) -> list[float]:
    """All numbers within, in order; run-lengths and names are left out."""
    if isinstance(value, dict):
        return [number for key in value for number in numbers(value[key])]
    if isinstance(value, list):
        return [number for item in value for number in numbers(item)]
    return [float(value)] if isinstance(value, int | float) else []


@pytest.mark.slow
@pytest.mark.parametrize("scenario", recorder.SCENARIOS)
def test_the_labels_are_the_recorded_ones(posse_in, tmp_path: Path, scenario: str) -> None:
    """To the bit where this machine rounds as the recording one did; else to nine digits."""
    done = posse_in(
        tmp_path, "run", scenario, "--renderer", "flat", "--frames", recorder.FRAMES, "--out", "d"
    )
    assert done.returncode == 0, done.stderr
    recorded, lines = RECORDED["labels"][scenario], recorder.label_lines(tmp_path / "d")
    if recorder.arithmetic() == RECORDED["arithmetic"]:
        assert lines == recorded["lines"]
        assert recorder.array_digests(tmp_path / "d") == recorded["arrays"]
    for line, old in zip(lines, recorded["lines"], strict=True):
        ours, theirs = json.loads(line), json.loads(old)
        assert list(ours) == list(theirs)
        # On another processor a pixel whose centre lies on an edge may be of the part beside it.
        for a, b in zip(numbers(ours), numbers(theirs), strict=True):
            is_count = float(b).is_integer() and b > 1
            assert a == pytest.approx(b, rel=1e-9, abs=1 if is_count else 1e-9)
