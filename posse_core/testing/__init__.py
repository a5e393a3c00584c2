"""The conformance kit: what every renderer and propagator must do, as pytest classes to subclass.

    # test_wire.py
    from posse_core.testing import RendererConformance

    class TestWire(RendererConformance):
        capabilities = frozenset({"deterministic"})

        def renderer(self):
            return WireRenderer(WireOptions())

A test cannot be left out in silence: overriding one fails, unless the override is marked
``pytest.mark.xfail(strict=True, reason=...)``. Needs ``pytest`` (``posse-core[test]``).
"""

from posse_core.testing.propagators import PropagatorConformance
from posse_core.testing.renderers import RendererConformance

__all__ = ["PropagatorConformance", "RendererConformance"]
