"""The conformance kit: what every renderer and propagator must do, as pytest classes to subclass.

    # test_wire.py
    from posse_core.testing import RendererConformance

    class TestWire(RendererConformance):
        capabilities = frozenset({"deterministic"})

        def renderer(self):
            return WireRenderer(WireOptions())

A test cannot be left out in silence: overriding one fails, unless the override is marked
``pytest.mark.xfail(strict=True, reason=...)``. Needs ``pytest`` (``posse-core[test]``).

:mod:`~posse_core.testing.scenes` and :mod:`~posse_core.testing.closed_forms` are what the kit's own
tests are made of, for further tests of a renderer.
"""

from posse_core.testing import closed_forms, scenes
from posse_core.testing.propagators import PropagatorConformance
from posse_core.testing.renderers import RendererConformance

__all__ = ["PropagatorConformance", "RendererConformance", "closed_forms", "scenes"]
