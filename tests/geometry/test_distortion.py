"""Lens distortion: its projection against OpenCV's, its inverse, and the refusal of lenses that fold
over."""

import dataclasses

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady

SPEED_PLUS = BrownConrady(
    -0.22383016606510672, 0.51409797089106379, -0.00066499611998340662, -0.00021404771667484594,
    -0.13124227429077406,
)  # fmt: skip


def camera(distortion: BrownConrady | None, focal_px: float = 300.0) -> Camera:
    return Camera(320, 200, focal_px, 1.01 * focal_px, 161.3, 98.2, 0.01, distortion=distortion)


LENSES = st.builds(
    BrownConrady,
    st.floats(-0.35, 0.35),
    st.floats(-0.3, 0.5),
    st.floats(-0.01, 0.01),
    st.floats(-0.01, 0.01),
    st.floats(-0.15, 0.15),
)


def fitting(distortion: BrownConrady, focal_px: float) -> Camera:
    """A camera with this lens; the example is rejected if the lens folds over inside the image."""
    try:
        return camera(distortion, focal_px)
    except ValueError:
        assume(False)
        raise


@settings(max_examples=40, deadline=None)
@given(LENSES, st.floats(180, 900))
def test_projection_agrees_with_opencv(distortion, focal_px):
    cam = fitting(distortion, focal_px)
    rays = cam.rays(cam.border_px()[::7]) * np.linspace(0.3, 1, len(cam.border_px()[::7]))[:, None] ** [
        1,
        1,
        0,
    ]
    points = rays * 7.3
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), cam.matrix, cam.distortion_coefficients
    )
    np.testing.assert_allclose(cam.project(points), expected[:, 0], rtol=0, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(LENSES, st.floats(180, 900))
def test_rays_invert_the_projection_in_the_whole_image(distortion, focal_px):
    cam = fitting(distortion, focal_px)
    uv = np.stack(np.meshgrid(np.linspace(-0.5, 319.5, 23), np.linspace(-0.5, 199.5, 17)), -1)
    np.testing.assert_allclose(cam.project(cam.rays(uv)), uv, rtol=0, atol=1e-9)


def test_rays_agree_with_opencvs_iteration():
    cam = camera(SPEED_PLUS)
    uv = cam.border_px()
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-15)
    expected = cv2.undistortPoints(
        uv[:, None], cam.matrix, cam.distortion_coefficients, R=None, P=None, criteria=criteria
    )[:, 0]
    np.testing.assert_allclose(cam.rays(uv)[:, :2], expected, rtol=0, atol=1e-11)


@settings(max_examples=40, deadline=None)
@given(LENSES)
def test_no_two_directions_within_reach_share_an_image_position(distortion):
    """The image of each ring of directions, out to the reach, winds exactly once around the points of a
    smaller ring."""
    reach = min(distortion.reach, 3.0)
    turn = np.linspace(0, 2 * np.pi, 181)
    for radius in np.linspace(0.1, 0.999, 6) * reach:
        x, y = distortion.distort(radius * np.cos(turn), radius * np.sin(turn))
        assert np.isfinite(x).all()
        inner = distortion.distort(
            np.array(0.95 * radius * np.cos(turn[7])), np.array(0.95 * radius * np.sin(turn[7]))
        )
        angle = np.unwrap(np.arctan2(y - inner[1], x - inner[0]))
        assert round((angle[-1] - angle[0]) / (2 * np.pi)) == 1
        assert np.all(np.diff(angle) > -1e-9)


def test_reach_ends_where_a_radial_lens_folds_over():
    # d/dr (r − 0.3 r³) = 0
    assert BrownConrady(k1=-0.3).reach == pytest.approx(np.sqrt(1 / 0.9))
    assert BrownConrady(k1=0.3).reach == 10.0  # 84 degrees
    assert np.isnan(BrownConrady(k1=-0.3).distort(np.array(1.06), np.array(0.0))).all()
    assert np.isnan(BrownConrady(k1=-0.3).undistort(np.array(0.71), np.array(0.0))).all()


@settings(max_examples=40, deadline=None)
@given(LENSES, st.floats(180, 900))
def test_jacobians_agree_with_finite_differences_of_the_projection(distortion, focal_px):
    cam = fitting(distortion, focal_px)
    uv = np.array([[3.0, 5.0], [160.0, 100.0], [300.0, 180.0]])
    points = cam.rays(uv) * 9.0
    step = 1e-5 * np.eye(3)
    differences = np.stack([cam.project(points + d) - cam.project(points - d) for d in step], -1) / 2e-5
    np.testing.assert_allclose(cam.project_jacobian(points), differences, rtol=1e-5, atol=1e-5)
    area = np.linalg.det(differences[..., :2] * 9.0) / (cam.fx_px * cam.fy_px)
    np.testing.assert_allclose(cam.area_seen(uv) * area, 1, rtol=1e-6)
    low, high = cam.stretch
    spread = np.linalg.eigvalsh(differences[..., :2] * 9.0 / [[[cam.fx_px], [cam.fy_px]]])
    assert low - 1e-4 < spread.min()
    assert spread.max() < high + 1e-4


def test_a_lens_that_folds_over_in_the_image_is_refused():
    assert camera(BrownConrady(k1=-0.3), focal_px=300.0)
    with pytest.raises(ValueError, match=r"folds over inside the image: .* up to 46\.5 degrees"):
        camera(BrownConrady(k1=-0.3), focal_px=250.0)


def test_zero_distortion_changes_nothing():
    plain, zero = camera(None), camera(BrownConrady())
    points = np.random.default_rng(1).normal([0, 0, 6], [1, 1, 1], (50, 3))
    np.testing.assert_allclose(zero.project(points), plain.project(points), rtol=0, atol=1e-12)
    assert dataclasses.replace(camera(SPEED_PLUS), distortion=None) == plain
    assert plain.stretch == (1.0, 1.0)
    assert np.all(plain.area_seen(plain.border_px()) == 1)
