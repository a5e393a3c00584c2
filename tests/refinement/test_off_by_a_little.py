"""From a pose that is off by a little, the light is found, and where the drawing lies."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core._evaluation.poses import pose_errors
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Picture, scales
from posse_core._refinement.light import drawn_apart, fitted, together
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.registration import Registered
from posse_core._refinement.studio import Studio
from posse_core.testing import refiners
from tests.support.raycast_images import CAMERA, HERE, SUN, fits, light_of, with_booms


def test_the_light_is_found_where_booms_are_drawn_beside_where_they_are() -> None:
    """They are two pixels wide, and the pose is off by two degrees and a fiftieth of the range."""
    craft = with_booms(0.012, (0.02, 0.02, 0.02))
    off = HERE.turned(Rotation.from_rotvec(np.radians([1.2, 1.2, 1.2])).as_matrix()).at_range(0.98)
    (_, light, _), *_ = fits(craft, 0.8 * light_of(craft)[0], place=off, apart_px=2.0)
    assert light.lights.sun == pytest.approx(0.8, rel=0.15)


def placed(off: Placement) -> Registered:
    """Where a drawing at a pose lies in an image of the truth, at the coarsest scale."""
    craft = refiners._craft()
    vertices_m = np.concatenate([part.vertices_body_m for part in craft.parts])
    picture = Picture(np.float32(0.8 * light_of(craft)[0]), CAMERA, None, is_linear=True)
    scale = scales(picture.extent_px(off, vertices_m), (48.0,))[0]
    crop = picture.crop(off, vertices_m, scale)
    assert crop is not None
    setting = RefinerSetting(craft, CAMERA, refiners._renderer)
    with contextlib.closing(Studio(setting, RenderCompareOptions().renderer)) as studio:
        shown = drawn_apart(crop, studio, off, SUN)
        light = fitted(crop, shown, SUN, 0.4, 2.0)
        return LitComparer(crop, studio, light).registered(together(shown, light.lights), off)


@pytest.mark.parametrize(("turn_deg", "share"), [(12, 1.0), (-12, 1.1), (6, 0.9), (-17, 0.95)])
def test_a_drawing_is_found_where_it_is_turned_and_farther(turn_deg: float, share: float) -> None:
    """The pose is also a tenth of the spacecraft's size beside the truth."""
    about = Rotation.from_rotvec(np.radians(turn_deg) * np.array([0, 0, 1])).as_matrix()
    aside_m = HERE.t_body_cam_m + np.array([0.1, -0.06, 0])
    off = Placement(about @ HERE.R_cam_from_body, share * aside_m)
    found = placed(off)
    e_t, e_q = pose_errors(*HERE, *found.placement)
    assert found.rise > 0.05
    assert e_t < 0.05
    assert np.degrees(e_q) < 4.5


def test_a_drawing_that_lies_where_it_should_stays_there() -> None:
    found = placed(HERE)
    assert found.rise < 0.01
    e_t, e_q = pose_errors(*HERE, *found.placement)
    assert e_t < 0.01
    assert np.degrees(e_q) < 0.1
