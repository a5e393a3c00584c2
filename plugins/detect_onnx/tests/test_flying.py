"""The shipped models in the loop: what a navigator makes of them, with and without a correction."""

import os
from importlib.util import find_spec

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import posse_core as posse

if find_spec("posse_render_raster") is None and "POSSE_REQUIRE_RASTER" not in os.environ:
    pytest.skip("posse-render-raster is not installed", allow_module_level=True)

FRAMES = 16


@pytest.fixture(scope="module")
def flown():
    """The first frames of fly-approach: correction or none → (F,) attitude errors, degrees."""
    errors = {}
    for correction in ("raster", None):
        changes = {
            "flight.duration_s": 10.0 * (FRAMES - 1),
            "flight.goal": {"waypoints": [{"t_s": 140, "r_rtn_m": [0, -52, 14]}]},
            "flight.measurement.correction": correction,
            "sky.earth": False,
        }
        record = posse.fly("fly-approach", renderer="raster", overrides=changes)
        known = np.isfinite(record.q_eci_from_body).all(axis=1)
        true = Rotation.from_quat(record.q_true_eci_from_body[known], scalar_first=True)
        found = Rotation.from_quat(record.q_eci_from_body[known], scalar_first=True)
        errors[correction] = record, np.degrees((true.inv() * found).magnitude())
    return errors


def test_every_frame_is_read(flown):
    for record, attitude_deg in flown.values():
        assert len(attitude_deg) == FRAMES
        assert np.isfinite(record.r_single_rtn_m).all()


def test_the_correction_mends_the_attitude(flown):
    """It takes off what the models get wrong in the view, which stays for as long as the view does."""
    corrected, plain = (np.median(flown[key][1][FRAMES // 2 :]) for key in ("raster", None))
    assert corrected < 0.5 * plain


def test_the_estimate_is_near_the_truth(flown):
    for record, _ in flown.values():
        off = np.linalg.norm(record.r_true_rtn_m - record.r_rtn_m, axis=1)
        assert off[-1] < 0.02 * np.linalg.norm(record.r_true_rtn_m[-1])
