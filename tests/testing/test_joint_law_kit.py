"""The kit of joint laws catches what it is there for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from posse_core import ComponentError, JointLaw, JointSurroundings, NoOptions
from posse_core._arrays import FloatArray
from posse_core.testing import JointLawConformance

VALUES = "test_it_gives_a_value_within_the_limits_for_each_frame"
ROWS = "test_a_frame_does_not_depend_on_the_others"
BITS = "test_the_same_frames_give_the_same_bits"
UNTOUCHED = "test_the_surroundings_are_left_alone"
JUMPS = "test_the_value_has_no_jumps"
RATES = "test_rates_of_its_own_are_those_of_its_values"
TESTS = {VALUES, ROWS, BITS, UNTOUCHED, JUMPS, RATES}


def sweeping(around: JointSurroundings) -> FloatArray:
    """To and fro by 30° in 40 s, smoothly."""
    return np.asarray(np.radians(30) * np.sin(2 * np.pi * around.t_s / 40))


def spoiled(wrong: str) -> type[JointLaw[NoOptions]]:
    class Spoiled(JointLaw[NoOptions]):
        asked = 0

        def values(self, around: JointSurroundings) -> FloatArray:
            return FAULTS[wrong](self, around)

        def rates(self, around: JointSurroundings) -> object:
            return RATE_FAULTS[wrong](around) if wrong in RATE_FAULTS else None

    return Spoiled


def modifies(around: JointSurroundings) -> FloatArray:
    values = sweeping(around)
    around.sun_direction_carrier[:] *= -1
    return values


def remembers(law: JointLaw, around: JointSurroundings) -> FloatArray:
    law.asked += 1  # type: ignore[attr-defined]
    return around.t_s / 100 + law.asked  # type: ignore[attr-defined]


FAULTS: dict[str, Callable[[JointLaw, JointSurroundings], object]] = {
    "none": lambda law, around: sweeping(around),
    "triangular": lambda law, around: np.radians(30) * np.abs(around.t_s / 20 % 2 - 1),
    "whole turns": lambda law, around: np.mod(around.t_s / 3, 2 * np.pi),
    "column": lambda law, around: sweeping(around)[:, None],
    "not a number": lambda law, around: sweeping(around) + np.nan,
    "single precision": lambda law, around: sweeping(around).astype(np.float32),
    "mean time": lambda law, around: (around.t_s - around.t_s.mean()) / 100,
    "number of the row": lambda law, around: np.arange(len(around.t_s)) / 10,
    "unseeded": lambda law, around: np.random.default_rng().normal(size=len(around.t_s)),
    "counts": remembers,
    "modifies": lambda law, around: modifies(around),
    "one step": lambda law, around: 0.001 * (around.t_s > 1234.5),
    "half turns": lambda law, around: np.mod(around.t_s / 3, np.pi),
}
RATE_FAULTS: dict[str, Callable[[JointSurroundings], object]] = {
    "jumps with rates": lambda around: np.full(len(around.t_s), 0.1),
    "wrong rates": lambda around: np.full(len(around.t_s), 0.2),
    "one rate": lambda around: np.full(1, 0.1),
}
FAULTS |= dict.fromkeys(RATE_FAULTS, lambda law, around: np.mod(around.t_s / 10, 1.0))
CAUGHT: dict[str, set[str]] = {
    "none": set(),
    "triangular": set(),
    "whole turns": set(),
    "column": {VALUES},
    "not a number": {VALUES},
    "single precision": {VALUES},
    "mean time": {ROWS},
    "number of the row": {ROWS},
    "unseeded": {ROWS, BITS},
    "counts": {BITS},
    "modifies": {UNTOUCHED},
    "one step": {JUMPS},
    "half turns": {JUMPS},
    "jumps with rates": set(),
    "wrong rates": {RATES},
    "one rate": {RATES},
}


@pytest.mark.parametrize("wrong", FAULTS)
def test_a_wrong_law_fails(wrong: str) -> None:
    class Case(JointLawConformance):
        def law(self) -> JointLaw:
            return spoiled(wrong)(NoOptions())

    failed = set()
    for test in TESTS:
        try:
            getattr(Case(), test)()
        except (AssertionError, ComponentError, IndexError, ValueError):
            failed.add(test)
    assert failed >= CAUGHT[wrong]
    if not CAUGHT[wrong]:
        assert not failed
