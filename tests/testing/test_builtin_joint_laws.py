"""The core's own joint laws, held to what a third party's are held to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from posse_core import Joint, JointCurve, JointLaw
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.registry import Registry
from posse_core.testing import JointLawConformance
from posse_core.testing.joint_laws import WING


def registry() -> Registry:
    return load_plugins().registry


class BuiltIn(JointLawConformance):
    name: str
    options: ClassVar[dict[str, Any]] = {}

    def law(self) -> JointLaw:
        options = registry().options("joint-law", self.name, self.options)
        made: JointLaw = registry().create("joint-law", self.name, options)
        return made


class TestFixed(BuiltIn):
    name = "fixed"
    options: ClassVar = {"value_deg": 12.0}


class TestRate(BuiltIn):
    name = "rate"
    options: ClassVar = {"rate_deg_s": 0.5, "start_deg": -20.0}


class TestSliding(BuiltIn):
    name = "rate"
    joint = Joint("boom", "prismatic", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    options: ClassVar = {"rate_m_s": 0.001}


class TestSunTracking(BuiltIn):
    name = "sun-tracking"


class TestSunTrackingWithinLimits(BuiltIn):
    name = "sun-tracking"
    joint = replace(WING, limits=(-0.4, 0.5))

    @pytest.mark.xfail(strict=True, reason="it goes from one limit to the other when that gets nearer")
    def test_the_value_has_no_jumps(self) -> None:
        super().test_the_value_has_no_jumps()


class TestRandom(BuiltIn):
    name = "random"
    joint = replace(WING, limits=(-0.4, 0.5))


class TestRandomForTheRun(BuiltIn):
    name = "random"
    options: ClassVar = {"every": "run", "range_deg": (-30, 60)}


class TestBending(BuiltIn):
    name = "bending"
    options: ClassVar = {"amplitude_m": 0.1, "frequency_hz": 0.2, "damping_ratio": 0.001}


class TestTable(BuiltIn):
    name = "table"
    interpolation = "cubic"

    @pytest.fixture(autouse=True)
    def opening(self, tmp_path: Path) -> None:
        """A wing that opens within 90 s, in the middle of the orbit."""
        path = tmp_path / "opening.csv"
        path.write_text("t_s,value_deg\n2000,0\n2030,20\n2060,80\n2090,90\n", encoding="utf-8")
        self.options = {"path": path, "interpolation": self.interpolation}  # type: ignore[misc]


class TestLinearTable(TestTable):
    interpolation = "linear"


class TestAnimation(BuiltIn):
    name = "animation"
    options: ClassVar = {"animation": "beat", "start_s": 30.0, "repeat": True}
    joint = replace(
        WING,
        animations={
            "rest": JointCurve.steps(np.zeros(1), np.zeros(1), 0.0),
            "beat": JointCurve.spline(
                np.array([0.0, 3.0, 40.0]),
                np.exp(0.5j * np.array([0.1, 0.4, -0.2])),
                np.array([0.0, 0.02j, 0.01 - 0.01j]),
                np.array([0.03j, -0.02j, 0.0]),
                np.array([0.1, 0.4, -0.2]),
                60.0,
            ),
        },
    )


def test_all_are_here() -> None:
    held = {case.name for case in BuiltIn.__subclasses__()}
    assert held == {s for s in registry().names("joint-law") if registry().is_core("joint-law", s)}
