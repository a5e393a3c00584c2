"""A rendered pair under OpenCV's semi-global matching: a sanity figure; matching is no authority."""

import cv2
import numpy as np
import pytest

import posse_core as posse
from posse_core._model.labels import VISIBLE


def test_semi_global_matching_finds_the_disparity_in_the_median():
    """Within a pixel in both of two views of a textured Aqua."""
    pytest.importorskip("posse_render_raster")
    scenario = {
        "target": {"name": "aqua"},
        "orbit": {
            "elements": {
                "epoch_utc": "2022-01-31T02:02:27.58",
                "a_m": 7080000,
                "e": 0.001,
                "i_deg": 98,
                "raan_deg": 334,
                "argp_deg": 52,
                "mean_anomaly_deg": 318,
            }
        },
        "relative": {"roe_m": [0, 0, -16, -12, -16, -12]},
        "times": {"t_s": [0, 600]},
        "sky": {"earth": False, "stars": None},
        "camera": {"width_px": 480, "height_px": 360, "hfov_deg": 50},
        "sensor": {"auto_exposure": {}},
        "renderer": "raster",
        "sensors": {"right": {"type": "stereo", "baseline_m": 0.5}},
    }
    matcher = cv2.StereoSGBM.create(
        minDisparity=0, numDisparities=64, blockSize=5, P1=200, P2=800, uniquenessRatio=5
    )
    with posse.open(scenario) as sim:
        for index in range(2):
            shot = sim.frame(sim.state(index))
            (reading,) = shot.readings["right"]
            found_px = matcher.compute(shot.image, reading.image) / 16
            exact_px = reading.arrays["disparity_left_px"]
            matched = (found_px > 0) & (reading.arrays["visibility_in_right"] == VISIBLE)
            off_px = np.abs(found_px - exact_px)[matched]
            assert matched.sum() > 5000
            assert np.median(off_px) < 1.0
