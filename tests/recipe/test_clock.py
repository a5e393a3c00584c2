"""The expected end of a recipe, and that nothing of it is shown where there is no terminal."""

from __future__ import annotations

import pytest

from posse_core._cli.recipe_clock import clock


def test_the_time_left_is_that_of_this_step_and_of_those_after_it(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    now = 1000.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    with clock("recipe") as shown:
        shown.begin("decision")
        assert shown.left_s(now) is None
        shown.expect({"frames": 100.0, "boxes": 50.0, "keypoints": 80.0})
        shown.begin("frames")
        assert shown.left_s(now) == 230.0
        assert shown.left_s(now + 30) == 200.0
        assert shown.left_s(now + 400) == 130.0  # it takes longer than expected: the rest is as it was
        shown.begin("boxes")
        assert shown.left_s(now + 10) == 120.0
        shown.say("boxes: done")
    seen = capfd.readouterr()
    assert seen.err == ""
    assert seen.out == "boxes: done\n"
