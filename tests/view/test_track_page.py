"""The page of ``posse track`` in headless Chromium, driven by real events."""

from __future__ import annotations

import json

import numpy as np
import pytest
from browser import opened
from small_flight import NATURAL

from posse_core._files.flight import load_flight

NOT_OF_A_TRACK = ("waypoints", "keep_out", "cone", "impulses")
UNITS = {"m": 1, "mm": 1e-3, "% of frames": 0.01}
OPTIONS = ("measurement.source=truth", "navigator.bias_share=0")


@pytest.fixture(scope="module")
def tracked(posse_in, tmp_path_factory):
    """A natural motion that was tracked: the folder of its page, and what the command printed."""
    folder = tmp_path_factory.mktemp("tracked")
    (folder / "small.yaml").write_text(NATURAL)
    options = [word for each in OPTIONS for word in ("-o", each)]
    made = posse_in(folder, "run", "small.yaml", "--out", "d")
    assert made.returncode == 0, made.stderr
    done = posse_in(folder, "track", "d", "--out", "t", "--json", *options)
    assert done.returncode == 0, done.stderr
    return folder / "t", json.loads(done.stdout)


def test_it_shows_what_the_command_has_printed(tracked, tmp_path):
    folder, printed = tracked
    with opened(folder / "track.html", tmp_path, height=2500) as tab:
        assert tab.tell("byId('name').textContent") == "Tracking d"
        figures = tab.tell(
            "Object.fromEntries([...document.querySelectorAll('#figures div')].map((entry) =>"
            " [entry.querySelector('dt').textContent, entry.querySelector('dd').textContent]))"
        )
        for name, value in (
            ("Estimate's at the same frames", printed["position_m"]["median"]),
            ("Single frames' position error, median", printed["single_position_m"]["median"]),
            ("NEES in its 95 % band", printed["nees_share"]),
        ):
            number, unit = figures[name].split(" ", 1)
            assert float(number) * UNITS[unit] == pytest.approx(value, rel=6e-3), name
        for what in NOT_OF_A_TRACK:
            hidden = f"[...document.querySelectorAll('[data-of={what}]')].every((words) => words.hidden)"
            assert tab.tell(hidden) is True, what
        assert tab.errors == []


def test_frames_are_gone_through_and_shown_with_their_estimate(tracked, tmp_path):
    folder, _ = tracked
    record = load_flight(folder / "track.npz")
    with opened(folder / "track.html", tmp_path, height=2500) as tab:
        for _ in range(7):
            tab.key("ArrowRight", 39)
        facts = tab.tell(
            "Object.fromEntries([...byId('facts').rows].map(({ cells }) =>"
            " [...cells].map((cell) => cell.textContent)))"
        )
        truth, estimate = record.r_true_rtn_m[7], record.r_rtn_m[7]
        assert facts["Time"] == "70.0 s"
        for name, position in (("True position, RTN", truth), ("Estimate, RTN", estimate)):
            shown = [float(number) for number in facts[name].removesuffix(" m").split(", ")]
            assert shown == pytest.approx(position, abs=6e-4)
        error_m = float(facts["Its error"].removesuffix(" m"))
        assert error_m == pytest.approx(np.linalg.norm(truth - estimate), rel=6e-3)
        tab.key("End", 35)
        assert tab.tell("state.current") == len(record) - 1
        assert tab.errors == []
