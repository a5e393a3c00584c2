"""The core's own navigators, held to what a third party's are held to; and that the kit finds faults."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posse_core import Burn, Estimate, Innovation, Navigator, Readings
from posse_core._navigation.kalman import EkfNavigator
from posse_core._navigation.options import KalmanOptions
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.registry import Registry
from posse_core.testing import NavigatorConformance


def registry() -> Registry:
    return load_plugins().registry


class BuiltIn(NavigatorConformance):
    name: str

    def __init_subclass__(cls) -> None:
        cls.capabilities = registry().spec("navigator", cls.name).capabilities

    def navigator(self) -> Navigator:
        made: Navigator = registry().create("navigator", self.name)
        return made


class TestEkf(BuiltIn):
    name = "ekf"


class TestUkf(BuiltIn):
    name = "ukf"


class TestTruth(BuiltIn):
    name = "truth"


class TestDeadReckoning(BuiltIn):
    name = "dead-reckoning"


def test_all_are_here() -> None:
    held = {case.name for case in BuiltIn.__subclasses__()}
    core = {s for s in registry().names("navigator") if registry().owner("navigator", s) == "core"}
    assert held == core


class Spoiled(EkfNavigator):
    """The filter with one thing wrong with it."""

    def __init__(self, wrong: str) -> None:
        super().__init__(KalmanOptions())
        self.wrong = wrong

    def burned(self, burn: Burn) -> None:
        if self.wrong == "impulse ignored":
            return
        if self.wrong == "impulse early":
            burn = Burn(burn.t_s - 5.0, burn.dv_rtn_m_s)
        if self.wrong == "impulse twice":
            super().burned(burn)
        super().burned(burn)

    def start(self, problem) -> None:
        kept = getattr(self, "_burns", [])
        super().start(problem)
        if self.wrong == "impulses of the last flight":
            self._burns = kept

    def update(self, readings: Readings) -> Innovation | None:
        innovation = super().update(readings)
        if self.wrong == "impulses forgotten by readings":
            self._burns = []
        if self.wrong == "readings changed":
            readings.keypoints.points_px[0] += 1.0
        if self.wrong == "innovation" and innovation is not None:
            return replace(innovation, rejected=innovation.dof + 1)
        return innovation

    def estimate(self, t_s: float) -> Estimate | None:
        estimate = super().estimate(t_s)
        covariance = estimate.covariance.copy()
        match self.wrong:
            case "asking moves":
                self._bank.replace(
                    [self._at(h.belief, t_s, with_last=True) for h in self._bank.hypotheses]
                )
            case "time":
                return replace(estimate, t_s=self._bank.best.at.t_s)
            case "frozen":
                last = super().estimate(self._bank.best.at.t_s)
                return replace(last, t_s=t_s)
            case "asymmetric":
                covariance[0, 1] += covariance[0, 0]
                return replace(estimate, covariance=covariance)
            case "negative":
                covariance[3, 3] *= -1
                return replace(estimate, covariance=covariance)
            case "overconfident":
                return replace(estimate, covariance=covariance * 1e-4)
            case "quaternion" if estimate.q_eci_from_body is not None:
                return replace(estimate, q_eci_from_body=1.01 * estimate.q_eci_from_body)
            case "scalar last" if estimate.q_eci_from_body is not None:
                return replace(estimate, q_eci_from_body=np.roll(estimate.q_eci_from_body, -1))
            case "inertial velocity":
                spin = np.cross([0.0, 0.0, 1.06e-3], estimate.r_rtn_m)
                return replace(estimate, v_rtn_m_s=estimate.v_rtn_m_s + spin)
            case "half an estimate":
                return replace(estimate, omega_body_rad_s=None)
        return estimate


@pytest.mark.parametrize(
    ("wrong", "test"),
    [
        ("impulse ignored", "an_impulse_changes_the_velocity_from_its_instant_on"),
        ("impulse early", "an_impulse_changes_the_velocity_from_its_instant_on"),
        ("impulse twice", "an_impulse_changes_the_velocity_from_its_instant_on"),
        (
            "impulses forgotten by readings",
            "readings_that_arrive_after_a_later_impulse_count_as_if_in_time",
        ),
        ("impulses of the last flight", "a_flight_begins_anew"),
        ("readings changed", "what_it_is_given_is_left_alone"),
        ("innovation", "innovations_are_well_formed"),
        ("asking moves", "asking_changes_nothing"),
        ("time", "an_estimate_is_of_the_instant_asked_for_and_well_formed"),
        ("frozen", "the_error_is_as_small_as_the_covariance_says"),
        ("frozen", "what_is_not_seen_is_known_less_and_less"),
        ("asymmetric", "an_estimate_is_of_the_instant_asked_for_and_well_formed"),
        ("negative", "an_estimate_is_of_the_instant_asked_for_and_well_formed"),
        ("overconfident", "the_error_is_as_small_as_the_covariance_says"),
        ("quaternion", "an_estimate_is_of_the_instant_asked_for_and_well_formed"),
        ("scalar last", "the_error_is_as_small_as_the_covariance_says"),
        ("inertial velocity", "the_error_is_as_small_as_the_covariance_says"),
        ("half an estimate", "an_estimate_is_of_the_instant_asked_for_and_well_formed"),
    ],
)
def test_a_wrong_navigator_fails(wrong: str, test: str) -> None:
    class Case(NavigatorConformance):
        def navigator(self) -> Navigator:
            return Spoiled(wrong)

    with pytest.raises(AssertionError):
        getattr(Case(), f"test_{test}")()
