"""The core's executor under the conformance kit."""

from posse_core._plugins.loading import Plugins
from posse_core.testing import ExecutorConformance

REGISTRY = Plugins([]).registry


class TestLocal(ExecutorConformance):
    def executor(self, workers):
        options = REGISTRY.options("executor", "local", {"workers": workers})
        return REGISTRY.create("executor", "local", options)
