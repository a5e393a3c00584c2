"""The core's scene sources under the conformance kit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from small_run import BOX_OBJ

from posse_core._plugins.loading import Plugins
from posse_core.testing import SceneSourceConformance

REGISTRY = Plugins([]).registry
FILES: Mapping[str, Mapping[str, Any]] = {
    "mesh": {"mesh": "box.obj", "scale_m_per_unit": 1.0, "body_axes": "x y z"},
    "package": {"package": "package"},
}
"""Name of a source that reads files → its options."""


HEAVY = ("aqua", "cluster", "family", "tango")
"""Those of many triangles, which take seconds to build."""
PARAMS = [
    pytest.param(name, marks=pytest.mark.slow if name in HEAVY else ())
    for name in REGISTRY.names("scene")
]


@pytest.fixture(params=PARAMS, autouse=True, scope="class")
def source(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    (folder / "box.obj").write_text(BOX_OBJ)
    if request.param == "package":
        box, package = str(folder / "box.obj"), str(folder / "package")
        options = ["--out", package, "--scale", "1", "--axes", "x y z"]
        done = CliRunner().invoke(REGISTRY.load("subcommand", "import"), [box, *options])
        assert done.exit_code == 0, done.output
    request.cls.name, request.cls.folder = request.param, folder


class TestScenes(SceneSourceConformance):
    name = "aqua"
    folder = Path()

    def source(self):
        keys = {
            key: str(self.folder / value) if key in ("mesh", "package") else value
            for key, value in FILES.get(self.name, {}).items()
        }
        return REGISTRY.create("scene", self.name, REGISTRY.options("scene", self.name, keys))
