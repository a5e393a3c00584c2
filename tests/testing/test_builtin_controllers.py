"""The core's own controllers, held to what a third party's are; and that the kit finds faults."""

from __future__ import annotations

import numpy as np
import pytest

from posse_core._guidance.lqr import LqrController
from posse_core._guidance.options import LqrOptions
from posse_core._interfaces.controller import Controller, ControlProblem
from posse_core._interfaces.navigator import Estimate
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.registry import Registry
from posse_core.testing import ControllerConformance


def registry() -> Registry:
    return load_plugins().registry


class BuiltIn(ControllerConformance):
    name: str

    def __init_subclass__(cls) -> None:
        cls.capabilities = registry().spec("controller", cls.name).capabilities

    def controller(self) -> Controller:
        made: Controller = registry().create("controller", self.name)
        return made


class TestImpulsiveMpc(BuiltIn):
    name = "impulsive-mpc"


class TestLqr(BuiltIn):
    name = "lqr"


class TestHold(BuiltIn):
    name = "hold"


class TestPlan(BuiltIn):
    name = "plan"


def test_all_are_here() -> None:
    held = {case.name for case in BuiltIn.__subclasses__()}
    core = {s for s in registry().names("controller") if registry().is_core("controller", s)}
    assert held == core


class Spoiled(LqrController):
    """A regulator with one thing wrong with it."""

    def __init__(self, wrong: str) -> None:
        super().__init__(LqrOptions())
        self.wrong, self.dv = wrong, np.zeros(3)

    def start(self, problem: ControlProblem) -> None:
        super().start(problem)
        if self.wrong == "changes the problem":
            problem.burns_s[:] += 1.0

    def command(self, estimate: Estimate) -> np.ndarray:
        dv = super().command(estimate)
        if self.wrong == "no limit":
            return 2 * dv
        if self.wrong == "asleep":
            return 0 * dv
        if self.wrong == "remembers":
            self.dv = self.dv + dv
            return dv + 1e-3 * self.dv
        if self.wrong == "its own array":
            self.dv[:] = dv
            return self.dv
        if self.wrong == "changes the estimate":
            estimate.r_rtn_m[:] = 0.0
        if self.wrong == "needs the attitude":
            return dv + estimate.covariance[6, 6]
        return dv


@pytest.mark.parametrize(
    ("wrong", "test"),
    [
        ("no limit", "test_no_impulse_is_above_the_limit"),
        ("asleep", "test_it_brings_the_chaser_to_the_waypoint"),
        ("remembers", "test_the_same_flight_gives_the_same_bits"),
        ("its own array", "test_a_command_given_is_not_changed_later"),
        ("changes the estimate", "test_what_it_is_given_is_left_alone"),
        ("changes the problem", "test_what_it_is_given_is_left_alone"),
    ],
)
def test_a_wrong_controller_fails(wrong: str, test: str) -> None:
    class Case(ControllerConformance):
        def controller(self) -> Controller:
            return Spoiled(wrong)

    with pytest.raises(AssertionError):
        getattr(Case(), test)()


def test_a_controller_that_needs_the_attitude_fails() -> None:
    class Case(ControllerConformance):
        def controller(self) -> Controller:
            return Spoiled("needs the attitude")

    with pytest.raises(IndexError):
        Case().test_the_attitude_may_be_known_or_not()
