"""Whether a picture has the bits, the light and the channels of its sensor."""

import numpy as np
import pytest
from small_flight import NATURAL

import posse_core as posse
from posse_core._evaluation.case import Case
from posse_core._evaluation.photometry import format_faults
from posse_core._evaluation.pictures import PictureChecks
from posse_core._evaluation.scenarios import Scenarios
from posse_core._scenario.sensor import SensorConfig


def test_sixteen_bits_that_are_only_eight_are_found():
    sensor = SensorConfig(bit_depth=16, color="mono")
    true = np.random.default_rng(0).integers(0, 2**16, (40, 50), np.uint16)
    assert list(format_faults(true, sensor)) == []
    for cut in (true >> 8 << 8, (true >> 8) * 257):
        assert list(format_faults(cut, sensor)) == [
            "the picture has 16 bits, but only 8 of them are used"
        ]
    assert "no value above 255" in next(format_faults(true >> 8, sensor))


def test_frames_of_nearly_the_same_view_are_not_taken_for_each_other(tmp_path):
    """The drawing of one fits the pictures of all five better than the others' drawings do."""
    pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")
    scenario = NATURAL.replace("name: flat, seconds: 0", "name: raster")
    (tmp_path / "s.yaml").write_text(scenario.replace("count: 60", "count: 5"))
    dataset = posse.run(tmp_path / "s.yaml", tmp_path / "d")
    checks = PictureChecks(Scenarios(dataset))
    for labels in dataset:
        checks.check(Case(dataset, labels))
    places, _ = checks.results
    assert places.checked == 5
    assert not places.faults
