"""What is behind the craft, by closed forms in the plane of the equator, where the Earth is a circle."""

import cuboid
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core.constants import Constants
from posse_core.dataset import Dataset
from posse_core.detection.background import background, backgrounds
from posse_core.errors import InputError
from posse_core.model.camera import Camera
from posse_core.model.scene import FrameState
from posse_core.selection.collect import collect

EARTH_M = Constants().earth_radius_m
NARROW = Camera(101, 101, 5e4, 5e4, 50.0, 50.0, 0.01)  # 1 mrad on each side
BOX = (49, 49, 3, 3)


def state(away, height_m, sun, turn):
    """A camera above the equator on the x axis; it looks ``away`` from the nadir, along the equator.

    ``turn`` turns everything about the poles, so that it must not matter.
    """
    forward = np.array([-np.cos(away), np.sin(away), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    R_cam_from_eci = np.stack([np.cross(down, forward), down, forward])
    R_ecef_from_eci = Rotation.from_euler("z", turn).as_matrix()
    r = np.array([EARTH_M + height_m, 0.0, 0.0])
    none = np.zeros(3)
    return FrameState(
        index=0,
        t_s=0.0,
        epoch_jd_tt=2459610.5,
        R_cam_from_body=np.eye(3),
        t_body_cam_m=np.array([0.0, 0, 10]),
        R_cam_from_eci=R_cam_from_eci,
        R_ecef_from_eci=R_ecef_from_eci,
        r_camera_eci_m=r,
        r_target_eci_m=r,
        r_sun_eci_m=1.5e11 * np.array(sun),
        r_moon_eci_m=none,
        solar_flux_w_m2=1361.0,
        sun_fraction_target=1.0,
        sun_fraction_camera=1.0,
        sun_angular_radius_rad=0.0047,
    )


@given(st.floats(-np.pi, np.pi), st.floats(2e5, 4e7), st.floats(0, 6.3))
def test_it_is_the_earth_within_the_horizon(away, height_m, turn):
    horizon = np.arcsin(EARTH_M / (EARTH_M + height_m))
    found = background(state(away, height_m, (1, 0, 0), turn), NARROW, BOX)
    if abs(abs(away) - horizon) < 2e-4:
        return
    assert found == ("Earth by day" if abs(away) < horizon else "space")


@given(st.floats(2e5, 4e7), st.floats(0, 6.3), st.sampled_from([-1, 1]))
def test_the_horizon_is_the_limb(height_m, turn, side):
    horizon = np.arcsin(EARTH_M / (EARTH_M + height_m))
    found = background(state(side * horizon, height_m, (1, 0, 0), turn), NARROW, BOX)
    assert found == "limb"


@pytest.mark.parametrize(
    ("sun", "word"),
    [((1, 0, 0), "day"), ((-1, 0, 0), "night"), ((0.02, 1, 0), "day"), ((-0.02, -1, 0), "night")],
)
def test_day_and_night(sun, word):
    assert background(state(0.0, 5e5, sun, 1.0), NARROW, BOX) == f"Earth by {word}"


def a_dataset(folder, earth):
    cuboid.write_dataset(folder)
    (folder / "scenario.yaml").write_text(f"sky: {{earth: {str(earth).lower()}}}\n")
    return Dataset(folder)


def test_a_sky_without_an_earth_is_space(tmp_path):
    with_earth, without = a_dataset(tmp_path / "a", True), a_dataset(tmp_path / "b", False)
    before = backgrounds(with_earth, list(with_earth.frames))
    assert len(set(before)) > 1  # the hand-made motion looks anywhere
    assert set(backgrounds(without, list(without.frames))) == {"space"}
    collect([without, with_earth], [], None, tmp_path / "both", lambda frames, count: frames)
    both = Dataset(tmp_path / "both")
    assert backgrounds(both, list(both.frames)) == ["space"] * 6 + before
    (both.folder / "scenario-1.yaml").unlink()
    assert backgrounds(both, list(both.frames)) == ["space"] * 6 + [None] * 6
    (with_earth.folder / "scenario.yaml").write_text("sky: 3")
    with pytest.raises(InputError, match="not a resolved scenario"):
        backgrounds(with_earth, list(with_earth.frames))
