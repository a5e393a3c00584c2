"""The core's annotators under the conformance kit."""

import pytest

from posse_core._plugins.loading import Plugins
from posse_core.testing import AnnotatorConformance

REGISTRY = Plugins([]).registry


@pytest.fixture(params=REGISTRY.names("annotator"), autouse=True, scope="class")
def name(request):
    request.cls.name = request.param


class TestAnnotators(AnnotatorConformance):
    name = "box"

    def annotator(self):
        return REGISTRY.create("annotator", self.name)
