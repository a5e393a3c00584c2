"""What is behind the craft, by closed forms in the plane of the equator, where the Earth is a circle."""

import cuboid
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._constants import Constants
from posse_core._dataset.dataset import Dataset
from posse_core._detection.background import background, backgrounds
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._selection.collect import collect

EARTH_M = Constants().earth_radius_m
NARROW = Camera(101, 101, 5e4, 5e4, 50.0, 50.0, 0.01)  # 1 mrad on each side
BOX = (49, 49, 3, 3)


def seen(away, height_m, sun, turn):
    """From above the equator on the x axis, a camera looks ``away`` from the nadir, along the equator.

    ``turn`` turns everything about the poles, so that it must not matter.
    """
    forward = np.array([-np.cos(away), np.sin(away), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    R_from_cam = np.stack([np.cross(down, forward), down, forward], axis=1)
    R = Rotation.from_euler("z", turn).as_matrix()
    r_camera_m = np.array([EARTH_M + height_m, 0.0, 0.0])
    return background(R @ R_from_cam, R @ r_camera_m, R @ (1.5e11 * np.array(sun)), NARROW, BOX)


@given(st.floats(-np.pi, np.pi), st.floats(2e5, 4e7), st.floats(0, 6.3))
def test_it_is_the_earth_within_the_horizon(away, height_m, turn):
    horizon = np.arcsin(EARTH_M / (EARTH_M + height_m))
    found = seen(away, height_m, (1, 0, 0), turn)
    if abs(abs(away) - horizon) < 2e-4:
        return
    assert found == ("Earth by day" if abs(away) < horizon else "space")


@given(st.floats(2e5, 4e7), st.floats(0, 6.3), st.sampled_from([-1, 1]))
def test_the_horizon_is_the_limb(height_m, turn, side):
    horizon = np.arcsin(EARTH_M / (EARTH_M + height_m))
    found = seen(side * horizon, height_m, (1, 0, 0), turn)
    assert found == "limb"


@pytest.mark.parametrize(
    ("sun", "word"),
    [((1, 0, 0), "day"), ((-1, 0, 0), "night"), ((0.02, 1, 0), "day"), ((-0.02, -1, 0), "night")],
)
def test_day_and_night(sun, word):
    assert seen(0.0, 5e5, sun, 1.0) == f"Earth by {word}"


def a_dataset(folder, earth):
    cuboid.write_dataset(folder)
    (folder / "scenario.yaml").write_text(f"sky: {{earth: {str(earth).lower()}}}\n")
    return Dataset(folder)


def test_a_sky_without_an_earth_is_space(tmp_path):
    with_earth, without = a_dataset(tmp_path / "a", True), a_dataset(tmp_path / "b", False)
    before = backgrounds(with_earth, list(with_earth))
    assert len(set(before)) > 1  # the hand-made motion looks anywhere
    assert set(backgrounds(without, list(without))) == {"space"}
    collect([without, with_earth], [], None, tmp_path / "both", lambda frames, count: frames)
    both = Dataset(tmp_path / "both")
    assert backgrounds(both, list(both)) == ["space"] * 6 + before
    (both.folder / "sources/1/scenario.yaml").unlink()
    assert backgrounds(both, list(both)) == ["space"] * 6 + [None] * 6
    (with_earth.folder / "scenario.yaml").write_text("sky: 3")
    with pytest.raises(InputError, match=r"sky\.earth is missing"):
        backgrounds(with_earth, list(with_earth))
