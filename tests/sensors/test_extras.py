"""A sensor whose files need a library that is not installed says what to install, before any frame."""

import sys

import pytest

from posse_core._errors import ComponentError
from posse_core._plugins.loading import load_plugins
from posse_core._run.plan import make_plan
from posse_core._scenario.load import load_scenario


@pytest.mark.parametrize(
    ("sensor", "options", "library"),
    [
        ("lidar", {"formats": ["las"]}, "laspy"),
        ("lidar", {"formats": ["ply", "pcd"]}, "pypcd4"),
        ("radiance", {"formats": ["exr"]}, "OpenEXR"),
        ("events", {"formats": ["h5"]}, "h5py"),
        ("events", {"formats": ["aedat4"]}, "dv_processing"),
    ],
)
def test_the_extra_that_installs_a_library_is_named(sensor, options, library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)  # importing it fails
    registry = load_plugins().registry
    scenario = load_scenario("aqua", registry, {"frames": 2, "sensors.s": {"type": sensor, **options}})
    with pytest.raises(ComponentError, match=rf"{library}.*pip install posse-core\[{sensor}\]"):
        make_plan(scenario, registry)
