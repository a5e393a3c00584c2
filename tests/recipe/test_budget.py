"""What fits into the hours, and how frames are shared: properties of the decision."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_recipe import KEYS

from posse_core._recipe.budget import (
    LEAST_EPOCHS,
    LEAST_FRAMES,
    Learning,
    Speeds,
    decide,
    divided,
    epochs_in_time,
)
from posse_core._recipe.file import recipe_of
from posse_core._recipe.model import Recipe

SOURCES = ("plain", "noisy", "empty")


def recipe(hours: float | None, frames: int | None = None, epochs: Any = None, **data: Any) -> Recipe:
    keys = {**KEYS, "hours": hours, "data": {**KEYS["data"], "frames": frames, **data}}
    for task in ("boxes", "keypoints"):
        keys[task] = {"name": f"guess-{task}", **({} if epochs is None else {"epochs": epochs})}
    return recipe_of(keys, "recipe")


def speeds(frame_s: float, opening_s: float, picture_s: float, prepared_s: float = 0.0) -> Speeds:
    return Speeds(
        dict.fromkeys(SOURCES, frame_s),
        dict.fromkeys(SOURCES, opening_s),
        dict.fromkeys(("boxes", "keypoints"), Learning(prepared_s, picture_s)),
        10.0,
    )


@given(
    hours=st.floats(0.3, 100),
    frame_s=st.floats(1e-3, 1.0),
    opening_s=st.floats(0.0, 20.0),
    picture_s=st.floats(1e-3, 0.1),
    prepared_s=st.floats(0.0, 0.1),
)
def test_what_is_decided_fits_into_the_hours(
    hours: float, frame_s: float, opening_s: float, picture_s: float, prepared_s: float
) -> None:
    made = decide(recipe(hours), speeds(frame_s, opening_s, picture_s, prepared_s))
    frames = sum(made.frames.values())
    if frames > LEAST_FRAMES and min(made.epochs.values()) > 1:
        pictures = frames * 0.8 * (made.epochs["boxes"] + 0.75 * made.epochs["keypoints"])
        learning_s = pictures * picture_s + frames * 0.8 * 1.75 * prepared_s
        assert 10 + 3 * opening_s + frames * frame_s + learning_s <= 3600 * hours
        assert sum(made.expected_s.values()) <= 3600 * hours
        # Neither part of the training gets much more than its share, and none is left unused.
        assert made.epochs["boxes"] + 1 >= LEAST_EPOCHS / 2


@given(
    hours=st.floats(0.3, 50),
    slower=st.floats(0.3, 3.5),
    picture_s=st.floats(1e-3, 0.1),
    prepared_s=st.floats(0.0, 0.1),
)
def test_a_machine_that_has_become_slower_trains_less(
    hours: float, slower: float, picture_s: float, prepared_s: float
) -> None:
    """Frames took so many times as long as expected, and so do pictures, as a trial before each training
    tells: all ends within the hours, unless a dozen epochs take longer."""
    asked = recipe(hours)
    made = decide(asked, speeds(0.1, 1.0, picture_s, prepared_s))
    pictures = round(0.8 * sum(made.frames.values()))
    spent_s = 10.0 + slower * made.expected_s["frames"]
    for task in ("boxes", "keypoints"):
        learning = Learning(slower * prepared_s, slower * picture_s)
        epochs = epochs_in_time(asked, made, task, learning, pictures, spent_s)
        spent_s += learning.training_s(pictures, epochs)
        assert epochs >= min(12, made.epochs[task])
        assert epochs == min(12, made.epochs[task]) or spent_s <= 3600 * hours


def test_as_expected_the_epochs_are_those_of_the_decision() -> None:
    asked = recipe(2.0)
    made = decide(asked, speeds(0.1, 1.0, 0.01, 0.03))
    spent_s = 10.0 + made.expected_s["frames"]
    pictures = 0.8 * sum(made.frames.values())  # of the parts train and valid
    for task, share in (("boxes", 1.0), ("keypoints", 0.75)):
        learning = Learning(0.03, 0.01)
        epochs = epochs_in_time(asked, made, task, learning, round(share * pictures), spent_s)
        assert abs(epochs - made.epochs[task]) <= 1 + 0.02 * made.epochs[task]
        spent_s += made.expected_s[task]


@given(st.floats(0.5, 20), st.floats(1.5, 8))
def test_more_time_makes_no_less(hours: float, factor: float) -> None:
    short, long = (decide(recipe(h), speeds(0.1, 2.0, 0.02)) for h in (hours, factor * hours))
    assert sum(long.frames.values()) >= sum(short.frames.values())


def test_given_numbers_are_kept() -> None:
    made = decide(recipe(None, 100, 7), None)
    assert sum(made.frames.values()) == 100
    assert made.epochs == {"boxes": 7, "keypoints": 7}
    timed = decide(recipe(2.0, 100), speeds(0.1, 1.0, 0.01))
    assert sum(timed.frames.values()) == 100
    assert decide(recipe(2.0, None, 7), speeds(0.1, 1.0, 0.01)).epochs == made.epochs


@given(
    shares=st.lists(st.floats(0.01, 100), min_size=1, max_size=6),
    frames=st.integers(10, 100_000),
)
def test_frames_are_divided_by_the_shares(shares: list[float], frames: int) -> None:
    sources = {f"s{i}": {"share": share} for i, share in enumerate(shares)}
    parts = divided(recipe(None, frames, 1, sources=sources), frames)
    lifted = 0
    for source, share in zip(parts, shares, strict=True):
        exact = frames * share / sum(shares)
        lifted += exact < 1
        assert parts[source] == 1 or abs(parts[source] - exact) <= 1
    assert frames <= sum(parts.values()) <= frames + lifted


def test_a_probe_is_needed_only_where_something_follows_from_the_time() -> None:
    assert recipe(1.0).is_timed
    assert recipe(1.0, 50).is_timed
    assert not recipe(1.0, 50, 3).is_timed
    with pytest.raises(AssertionError):
        decide(recipe(None, 50, 3), speeds(1, 1, 1))
