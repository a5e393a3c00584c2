"""The kit of propagators catches what it is there for; no kit is silent or wordless."""

from __future__ import annotations

import ast
import inspect
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posse_core import testing
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion
from posse_core._plugins.options import NoOptions
from posse_core._propagators.roe import RoePropagator
from posse_core.testing import PropagatorConformance
from posse_core.testing.conformance import left_out


class Spoiled(RoePropagator):
    """The motion with one thing wrong with it."""

    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong = wrong

    def propagate(self, problem: PropagationProblem) -> Motion:
        motion = super().propagate(problem)
        if self.wrong == "inertial velocity":
            spin = np.cross([0.0, 0.0, 1.06e-3], motion.r_chaser_rtn_m)
            return replace(motion, v_chaser_rtn_m_s=motion.v_chaser_rtn_m_s + spin)
        if self.wrong == "kilometres":
            return replace(motion, r_target_eci_m=motion.r_target_eci_m / 1000)
        if self.wrong == "two-body":
            return replace(motion, r_chaser_rtn_m=motion.r_chaser_rtn_m * 1.001)
        return replace(motion, t_s=motion.t_s + 1.0)


@pytest.mark.parametrize(
    ("wrong", "test"),
    [
        (
            "inertial velocity",
            "test_the_chasers_velocity_is_the_derivative_in_the_rotating_frame",
        ),
        ("kilometres", "test_the_targets_velocity_is_the_derivative_of_its_position"),
        ("two-body", "test_two_body_motion_is_exact"),
        ("times", "test_shapes_and_numbers"),
    ],
)
def test_a_wrong_propagator_fails(wrong: str, test: str) -> None:
    class Case(PropagatorConformance):
        capabilities = frozenset({"exact-two-body"})

        def propagator(self) -> Propagator:
            return Spoiled(wrong)

    with pytest.raises(AssertionError):
        getattr(Case(), test)()


def test_leaving_a_test_out_fails() -> None:
    class Silent(PropagatorConformance):
        test_one_frame = None  # type: ignore[assignment]

        def test_shapes_and_numbers(self) -> None:
            pass

        @pytest.mark.xfail(strict=True, reason="it keeps a cache")
        def test_the_same_problem_gives_the_same_bits(self) -> None:
            super().test_the_same_problem_gives_the_same_bits()

    assert left_out(Silent) == ["test_one_frame", "test_shapes_and_numbers"]
    assert left_out(PropagatorConformance) == []
    with pytest.raises(AssertionError, match="test_one_frame, test_shapes_and_numbers"):
        Silent().test_no_test_is_left_out()


def wordless(source: str) -> list[int]:
    """Lines of the assertions that say nothing when they fail, NumPy's among them."""
    lines = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Assert) and node.msg is None:
            lines.append(node.lineno)
        if isinstance(node, ast.Call) and re.match(r"np\.testing\.assert_", ast.unparse(node.func)):
            named = {keyword.arg for keyword in node.keywords}
            if len(node.args) < 3 and "err_msg" not in named:
                lines.append(node.lineno)
    return sorted(lines)


def test_every_assertion_of_the_kit_says_what_is_wrong() -> None:
    home = Path(inspect.getfile(testing)).parent
    silent = {path.name: wordless(path.read_text("utf-8")) for path in home.glob("*.py")}
    assert {name: lines for name, lines in silent.items() if lines} == {}
    assert wordless("assert x\nassert x, 'y'\nnp.testing.assert_equal(1, 2)") == [1, 3]
