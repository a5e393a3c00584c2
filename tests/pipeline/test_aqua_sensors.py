"""The built-in scenario with four sensors, made small, as a user makes it."""

import os
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from posse_core._dataset.dataset import Dataset

SMALL = {
    "times.t_s": "[900, 900.3]",
    "camera.width_px": "160",
    "camera.height_px": "120",
    "sensors.scanner.pattern.columns": "40",
    "sensors.scanner.pattern.rows": "30",
    "sensors.changes.camera.width_px": "80",
    "sensors.changes.camera.height_px": "60",
    "sensors.heat.camera.width_px": "80",
    "sensors.heat.camera.height_px": "64",
    "sensors.heat.steps": "8",
}


RENDERERS = ("raster", "mitsuba")


@pytest.fixture(scope="module")
def made(posse_in, tmp_path_factory) -> dict[str, Path]:
    """Two frames by each renderer."""
    folders = {}
    for renderer in RENDERERS:
        if find_spec(f"posse_render_{renderer}") is None:
            if os.environ.get("POSSE_REQUIRE_RASTER") == "1":
                pytest.fail(f"posse-render-{renderer} is not installed (POSSE_REQUIRE_RASTER=1)")
            pytest.skip(f"posse-render-{renderer} is not installed")
        folder = tmp_path_factory.mktemp(renderer)
        words = [word for key, value in SMALL.items() for word in ("-o", f"{key}={value}")]
        done = posse_in(folder, "run", "aqua-sensors", "--renderer", renderer, "--out", "d", *words)
        assert done.returncode == 0, done.stderr
        folders[renderer] = folder / "d"
    return folders


@pytest.mark.slow
@pytest.mark.parametrize("renderer", RENDERERS)
def test_four_sensors_read_and_prove_themselves(posse_in, made, renderer):
    folder = made[renderer]
    done = posse_in(folder.parent, "validate", "d")
    assert done.returncode == 0, done.stdout
    dataset = Dataset(folder)
    assert [*dataset.sensors] == ["changes", "heat", "right", "scanner"]
    assert len(dataset.readings(0, "scanner")) == 3
    (right,), (heat,), (changes,) = (dataset.readings(0, name) for name in ("right", "heat", "changes"))
    assert right.image.shape == (120, 160)
    assert np.isfinite(right.arrays["disparity_left_px"]).any()
    assert 150 < np.nanmedian(heat.arrays["temperature_k"]) < 400
    assert len(changes.arrays["t_us"]) > 0
    assert changes.arrays["t_us"].max() < 300_000


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["scanner", "heat"])
def test_what_needs_no_light_is_the_same_by_every_renderer(made, sensor):
    raster, mitsuba = (Dataset(made[renderer]) for renderer in RENDERERS)
    for i in range(2):
        for one, other in zip(raster.readings(i, sensor), mitsuba.readings(i, sensor), strict=True):
            assert one.labels == other.labels
            for name, array in one.arrays.items():
                np.testing.assert_array_equal(array, other.arrays[name], name)
