"""Whether a picture has the bits, the light and the channels of its sensor."""

import numpy as np

from posse_core._evaluation.photometry import format_faults
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
