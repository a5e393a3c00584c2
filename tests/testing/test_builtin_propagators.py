"""The core's own propagators, held to what a third party's are held to."""

from __future__ import annotations

import pytest

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics.domain import DomainWarning
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.registry import Registry
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._trajectory.problem import resolve
from posse_core.testing import PropagatorConformance

AQUA = (
    "1 27424U 02022A   22031.08504144  .00000000  00000-0  00000-0 0  9999",
    "2 27424  98.2300 334.4000 0000898  52.4400 318.1000 14.57112000 53087",
)


def registry() -> Registry:
    return load_plugins().registry


class BuiltIn(PropagatorConformance):
    name: str

    def __init_subclass__(cls) -> None:
        cls.capabilities = registry().spec("propagator", cls.name).capabilities

    def propagator(self) -> Propagator:
        made: Propagator = registry().create("propagator", self.name)
        return made


class TestRoe(BuiltIn):
    name = "roe"


@pytest.mark.filterwarnings(f"ignore::{DomainWarning.__module__}.DomainWarning")
class TestThesis(BuiltIn):
    name = "thesis"


class TestHcw(BuiltIn):
    name = "hcw"


class TestRoeNearCircular(BuiltIn):
    name = "roe-near-circular"


class TestYamanakaAnkersen(BuiltIn):
    name = "yamanaka-ankersen"


class TestJ2Roe(BuiltIn):
    name = "j2-roe"


class TestNonlinear(BuiltIn):
    name = "nonlinear"


class TestSgp4(BuiltIn):
    name = "sgp4"

    def problem(self, t_s: FloatArray) -> PropagationProblem:
        roe_m = (0.0, 0.0, 15.0, -4.0, 12.0, 7.0)
        return resolve(OrbitConfig(tle=AQUA), RelativeConfig(roe_m=roe_m), t_s, Constants())


def test_all_are_here() -> None:
    """All but the one that reads a file and so has no model."""
    held = {case.name for case in BuiltIn.__subclasses__()}
    core = {s for s in registry().names("propagator") if registry().owner("propagator", s) == "core"}
    assert held == core - {"file"}
