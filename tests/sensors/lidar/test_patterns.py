"""Where the beams point, and when."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from posse_core._errors import InputError
from posse_core._sensors.lidar.beams import scanned
from posse_core._sensors.lidar.options import GivenOptions, LidarOptions, RasterOptions, SpiralOptions


def test_a_raster_goes_row_by_row_from_the_top_left():
    options = RasterOptions(columns=5, rows=3, width_deg=20, height_deg=10, duration_s=0.3, rays=4)
    beams = scanned(options)
    x, y, z = beams.axis.T
    np.testing.assert_allclose(np.degrees(np.arctan2(x, z)), np.tile([-10, -5, 0, 5, 10], 3), atol=1e-12)
    np.testing.assert_allclose(np.degrees(np.arcsin(y)), np.repeat([-5, 0, 5], 5), atol=1e-12)
    np.testing.assert_allclose(beams.after_s, np.arange(15) * 0.02)
    assert beams.rays.shape == (15, 4, 3)


def test_one_column_and_one_row_are_on_the_axis():
    beams = scanned(RasterOptions(columns=1, rows=1))
    np.testing.assert_array_equal(beams.axis, [[0, 0, 1]])


def test_a_spiral_has_equal_steps_along_it():
    beams = scanned(SpiralOptions(shape="spiral", radius_deg=8, turns=20, beams=4000, duration_s=2.0))
    x, y, z = beams.axis.T
    np.testing.assert_array_equal(beams.axis[0], [0, 0, 1])
    off = np.arctan2(np.hypot(x, y), z)
    assert np.degrees(off[-1]) == pytest.approx(8)
    assert (np.diff(off) > 0).all()
    around = np.unwrap(np.arctan2(y, x)[1:])
    assert around[-1] / (2 * np.pi) == pytest.approx(20, abs=0.02)
    # An Archimedean spiral: the angle off the axis grows with the angle about it.
    np.testing.assert_allclose(off[1:] / off[-1], around / around[-1], atol=1e-3)
    steps = np.linalg.norm(np.diff(beams.axis, axis=0), axis=1)[200:]
    assert np.ptp(steps) / steps.mean() < 0.05
    np.testing.assert_allclose(beams.after_s, np.arange(4000) * 2 / 4000)


@pytest.mark.parametrize("suffix", ["csv", "npz"])
def test_beams_of_a_table(tmp_path, suffix):
    t_s, r_beam = np.array([0.0, 0.25, 0.125]), np.array([[0, 0, 2.0], [0.6, 0, 0.8], [0, -3, 4]])
    path = tmp_path / f"beams.{suffix}"
    if suffix == "npz":
        np.savez(path, t_s=t_s, r_beam=r_beam)
    else:
        rows = np.column_stack([t_s, r_beam])
        np.savetxt(path, rows, delimiter=",", header="t_s,r_beam_x,r_beam_y,r_beam_z", comments="")
    beams = scanned(GivenOptions(shape="given", path=path, rays=1))
    np.testing.assert_allclose(beams.axis, [[0, 0, 1], [0.6, 0, 0.8], [0, -0.6, 0.8]], atol=1e-15)
    np.testing.assert_array_equal(beams.after_s, t_s)


def test_a_table_that_cannot_be_used_is_named(tmp_path):
    def refused(message, **arrays):
        path = tmp_path / "beams.npz"
        np.savez(path, **arrays)
        with pytest.raises(InputError, match=message) as caught:
            scanned(GivenOptions(shape="given", path=path))
        assert str(path) in str(caught.value)

    one = np.array([[0.0, 0, 1]])
    refused("has no r_beam", t_s=np.zeros(1))
    refused("has no t_s", r_beam=one)
    refused("r_beam is zero", t_s=np.zeros(2), r_beam=np.array([[0.0, 0, 1], [0, 0, 0]]))
    refused("300000 beams of 19 rays are more", t_s=np.zeros(300_000), r_beam=np.tile(one, (300_000, 1)))
    with pytest.raises(InputError, match="there is no such file"):
        scanned(GivenOptions(shape="given", path=tmp_path / "absent.csv"))


def test_what_does_not_fit_into_memory_is_refused():
    with pytest.raises(ValidationError, match="1000000 beams of 19 rays are more than the 4000000 rays"):
        LidarOptions.model_validate({"pattern": {"shape": "raster", "columns": 1000, "rows": 1000}})


def test_a_pattern_without_a_shape_is_told_the_shapes():
    with pytest.raises(ValidationError, match="raster, spiral, given or flash"):
        LidarOptions.model_validate({"pattern": {"columns": 10}})
