"""Edges by hand, and those of an image that is turned."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Picture, scales
from posse_core._refinement.edges import correlation, edges, evened, turned_edges
from posse_core._refinement.light import drawn_apart, fitted
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Studio
from posse_core._refinement.trail import edge_fit
from posse_core.testing import refiners
from tests.support.raycast_images import CAMERA, HERE, SUN, light_of

SIZE = 64
CRAFT = refiners._craft()


def half_plane(angle_rad: float, step: float = 1.0) -> np.ndarray:
    """(h, w, 1) an image that is brighter to one side of a line through its middle.

    angle_rad: from x to the line's normal, towards y.
    """
    y, x = np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2
    beyond = x * np.cos(angle_rad) + y * np.sin(angle_rad)
    return np.float32(step * np.clip(beyond + 0.5, 0, 1))[..., None]


@given(angle_rad=st.floats(-np.pi, np.pi))
def test_an_edge_is_the_product_of_its_normal_with_itself(angle_rad: float) -> None:
    found = edges(half_plane(angle_rad), 2.0)[SIZE // 2, SIZE // 2]
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    expected = np.array([c * c, np.sqrt(2) * c * s, s * s])
    assert found / np.linalg.norm(found) == pytest.approx(expected, abs=0.03)


def test_an_edge_from_bright_to_dark_is_one_from_dark_to_bright() -> None:
    image = half_plane(0.4)
    np.testing.assert_allclose(edges(image, 2.0), edges(1 - image, 2.0), atol=1e-5)


def test_an_edge_counts_by_its_step_and_not_by_the_square() -> None:
    bright, faint = (edges(half_plane(0.4, step), 2.0) for step in (1.0, 0.25))
    np.testing.assert_allclose(faint, bright / 4, atol=1e-3)


def test_beside_nothing_else_a_faint_edge_counts_more_than_its_step() -> None:
    bright, faint = (evened(edges(half_plane(0.4, step), 2.0)) for step in (1.0, 0.25))
    assert np.linalg.norm(faint) > 0.5 * np.linalg.norm(bright)


@pytest.mark.parametrize("turn_rad", [0.3, 1.2, 3.0, -2.0])
def test_edges_turn_as_the_image_does(turn_rad: float) -> None:
    """The image is turned by another library's warp, and its edges are found anew."""
    image = np.zeros((SIZE, SIZE), np.float32)
    cv2.rectangle(image, (20, 26), (44, 38), 1.0, -1)
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    c, s, middle = np.cos(turn_rad), np.sin(turn_rad), (SIZE - 1) / 2
    turn = np.array([[c, -s], [s, c]])
    shift = np.array([middle, middle]) - turn @ np.array([middle, middle])
    to_turned = np.column_stack([turn, shift])
    warped = cv2.warpAffine(image, to_turned, (SIZE, SIZE), flags=cv2.INTER_CUBIC)
    of_turned = edges(warped[..., None], 2.0)
    laid = cv2.warpAffine(edges(image[..., None], 2.0), to_turned, (SIZE, SIZE))
    off = turned_edges(laid, turn_rad) - of_turned
    assert np.linalg.norm(off) < 0.05 * np.linalg.norm(of_turned)


def test_edges_that_correlate_by_less_than_most_true_poses_do_leave_less_of_a_chance() -> None:
    assert [edge_fit(each) for each in (1.0, 0.8, 0.6)] == [1, 1, 1]
    assert edge_fit(0.2) == pytest.approx(1 / 16)
    assert edge_fit(-1.0) == pytest.approx(0.2**4)


@given(
    angle_rad=st.floats(-np.pi, np.pi), off_rad=st.floats(-np.pi / 2, np.pi / 2), gain=st.floats(0.1, 9)
)
def test_the_correlation_is_that_of_all_numbers_once_their_means_are_taken_off(
    angle_rad: float, off_rad: float, gain: float
) -> None:
    one, other = (edges(half_plane(each), 2.0) for each in (angle_rad, angle_rad + off_rad))
    a, b = (np.float64(each.reshape(-1, 3)) for each in (one, other))
    expected = np.corrcoef((a - a.mean(axis=0)).ravel(), (b - b.mean(axis=0)).ravel())[0, 1]
    found = correlation(one.reshape(-1, 3), np.float32(gain) * other.reshape(-1, 3))
    assert found == pytest.approx(expected, abs=1e-5)


def test_no_edges_correlate_with_nothing() -> None:
    flat = np.zeros((9, 3), np.float32)
    assert correlation(flat, np.float32(np.eye(9)[:, :3])) == 0


def test_before_clouds_edges_correlate_most_with_those_at_the_true_pose() -> None:
    """Clouds are as bright as the spacecraft, whose materials are not known, and light is fitted anew at
    each pose."""
    bright, coverage = light_of(CRAFT)
    noise = np.random.default_rng(5).normal(size=coverage.shape)
    patches = cv2.GaussianBlur(noise, (0, 0), 6)
    clouds = 0.1 + 0.5 * (patches > 0.5 * patches.std())
    seen = np.float32(0.8 * bright + (1 - coverage) * clouds)
    studio = Studio(RefinerSetting(CRAFT, CAMERA, refiners._renderer), RenderCompareOptions().renderer)
    picture = Picture(seen, CAMERA, None, is_linear=True)

    def correlated(place: Placement) -> float:
        crop = picture.crop(place, studio.hull_m, scales(100.0, (48.0,))[0])
        assert crop is not None
        shown = drawn_apart(crop, studio, place, SUN)
        light = fitted(crop, shown, SUN, 0.0, 1.0, 0.0)
        return LitComparer(crop, studio, light).edge_correlation(place)

    there = correlated(HERE)
    assert there > 0.6
    for axis in np.eye(3):
        for turn_deg in (-90, -40, 40, 90, 180):
            turn = Rotation.from_rotvec(np.radians(turn_deg) * axis).as_matrix()
            assert correlated(HERE.turned(turn)) < there
