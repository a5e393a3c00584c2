"""The conformance kit: what components of a kind must do, as pytest classes to subclass.

    # test_wire.py
    from posse_core.testing import RendererConformance

    class TestWire(RendererConformance):
        capabilities = frozenset({"deterministic"})

        def renderer(self):
            return WireRenderer(WireOptions())

A test cannot be left out silently: the kit fails if a test is overridden, unless the override is marked
``pytest.mark.xfail(strict=True, reason=...)``. The kit needs ``pytest`` (``posse-core[test]``).

:mod:`~posse_core.testing.scenes` and :mod:`~posse_core.testing.closed_forms` are the building blocks of
the kit's own tests, and can be used for further tests of a renderer.
"""

from posse_core.testing import closed_forms, scenes
from posse_core.testing.annotators import AnnotatorConformance
from posse_core.testing.attitude_laws import AttitudeLawConformance
from posse_core.testing.commands import CommandConformance
from posse_core.testing.controllers import ControllerConformance
from posse_core.testing.detectors import DetectorConformance
from posse_core.testing.executors import ExecutorConformance
from posse_core.testing.joint_laws import JointLawConformance
from posse_core.testing.navigators import NavigatorConformance
from posse_core.testing.propagators import PropagatorConformance
from posse_core.testing.refiners import RefinerConformance
from posse_core.testing.renderers import RendererConformance
from posse_core.testing.scene_sources import SceneSourceConformance
from posse_core.testing.sensors import SensorConformance
from posse_core.testing.writers import WriterConformance

__all__ = [
    "AnnotatorConformance",
    "AttitudeLawConformance",
    "CommandConformance",
    "ControllerConformance",
    "DetectorConformance",
    "ExecutorConformance",
    "JointLawConformance",
    "NavigatorConformance",
    "PropagatorConformance",
    "RefinerConformance",
    "RendererConformance",
    "SceneSourceConformance",
    "SensorConformance",
    "WriterConformance",
    "closed_forms",
    "scenes",
]
