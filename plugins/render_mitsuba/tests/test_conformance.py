"""The conformance kit on Mitsuba, in plain C++ and, where a libLLVM works, compiled."""

from __future__ import annotations

import pytest

from posse_core import ComponentError
from posse_core.testing import RendererConformance
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.renderer import MitsubaRenderer
from posse_render_mitsuba.variants import choose


@pytest.fixture(scope="module")
def llvm() -> None:
    """Skip where no libLLVM works, with the causes."""
    try:
        choose("llvm")
    except ComponentError as error:
        pytest.skip(str(error))


class TestScalar(RendererConformance):
    capabilities = frozenset({"path-traced", "deterministic", "environment"})

    def renderer(self) -> MitsubaRenderer:
        return MitsubaRenderer(MitsubaOptions(variant="scalar"))


@pytest.mark.usefixtures("llvm")
class TestLlvm(RendererConformance):
    capabilities = frozenset({"path-traced", "deterministic", "environment"})

    def renderer(self) -> MitsubaRenderer:
        return MitsubaRenderer(MitsubaOptions(variant="llvm"))
