"""The core's commands under the conformance kit."""

import pytest

from posse_core._plugins.loading import Plugins
from posse_core.testing import CommandConformance

REGISTRY = Plugins([]).registry


@pytest.fixture(params=REGISTRY.names("subcommand"), autouse=True, scope="class")
def name(request):
    request.cls.name = request.param


class TestCommands(CommandConformance):
    name = "run"

    def command(self):
        return REGISTRY.load("subcommand", self.name)
