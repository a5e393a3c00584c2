"""The conformance kit on Mitsuba: the scalar variant and, if a libLLVM works, the compiled one."""

from __future__ import annotations

import pytest

from posse_core import ComponentError
from posse_core.testing import RendererConformance
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.renderer import MitsubaRenderer
from posse_render_mitsuba.variants import choose


@pytest.fixture(scope="module")
def llvm() -> None:
    """Skip the test if no libLLVM works, and give the causes."""
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
