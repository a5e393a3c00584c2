"""Lens distortion: its projection against OpenCV's, its inverse, and the refusal of lenses that fold
over."""

import dataclasses

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady, Distortion, Fisheye, distortion_of

SPEED_PLUS = BrownConrady(
    -0.22383016606510672, 0.51409797089106379, -0.00066499611998340662, -0.00021404771667484594,
    -0.13124227429077406,
)  # fmt: skip


def camera(distortion: Distortion | None, focal_px: float = 300.0) -> Camera:
    return Camera(320, 200, focal_px, 1.01 * focal_px, 161.3, 98.2, 0.01, distortion=distortion)


FIVE = (
    st.floats(-0.35, 0.35),
    st.floats(-0.3, 0.5),
    st.floats(-0.01, 0.01),
    st.floats(-0.01, 0.01),
    st.floats(-0.15, 0.15),
)
LENSES = st.one_of(
    st.builds(BrownConrady, *FIVE),
    st.builds(BrownConrady, *FIVE, st.floats(-0.3, 0.5), st.floats(-0.2, 0.3), st.floats(-0.1, 0.1)),
    st.builds(
        Fisheye,
        st.floats(-0.1, 0.1),
        st.floats(-0.05, 0.05),
        st.floats(-0.02, 0.02),
        st.floats(-0.005, 0.005),
    ),
)


def by_opencv(cam: Camera, points: np.ndarray) -> np.ndarray:
    """(N, 3) points in camera axes → (N, 2) pixels."""
    fisheye = isinstance(cam.distortion, Fisheye)
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    zeros = np.zeros(3)
    uv, _ = project(points[:, None], zeros, zeros, cam.matrix, cam.distortion_coefficients)
    return uv[:, 0]


def fitting(distortion: Distortion, focal_px: float) -> Camera:
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
    np.testing.assert_allclose(cam.project(points), by_opencv(cam, points), rtol=0, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(LENSES, st.floats(180, 900))
def test_rays_invert_the_projection_in_the_whole_image(distortion, focal_px):
    cam = fitting(distortion, focal_px)
    uv = np.stack(np.meshgrid(np.linspace(-0.5, 319.5, 23), np.linspace(-0.5, 199.5, 17)), -1)
    np.testing.assert_allclose(cam.project(cam.rays(uv)), uv, rtol=0, atol=1e-9)


# As cv2.calibrateCamera gives them with CALIB_RATIONAL_MODEL: large, and almost equal above and below.
RATIONAL = BrownConrady(21.3, 5.1, 1e-4, -2e-4, 0.8, 21.6, 12.3, 2.1)
WIDE = Fisheye(-0.02, 0.01, -0.003, 0.0005)


@pytest.mark.parametrize(("lens", "focal_px", "corner_deg"), [(RATIONAL, 150, 40), (WIDE, 155, 70)])
def test_wide_lenses_agree_with_opencv_to_the_corners_and_back(lens, focal_px, corner_deg):
    cam = camera(lens, focal_px)
    uv = np.concatenate([cam.border_px(), np.random.default_rng(0).uniform(0, [319, 199], (5000, 2))])
    rays = cam.rays(uv)
    assert np.degrees(np.arctan(np.hypot(*rays[:, :2].T))).max() > corner_deg
    np.testing.assert_allclose(by_opencv(cam, rays), uv, rtol=0, atol=1e-9)
    np.testing.assert_allclose(cam.project(rays), uv, rtol=0, atol=1e-9)


def test_the_axis_of_a_fisheye_is_the_principal_point():
    cam = camera(WIDE)
    assert cam.project(np.array([0.0, 0.0, 3.0])).tolist() == [cam.cx_px, cam.cy_px]
    assert cam.rays(np.array([cam.cx_px, cam.cy_px])).tolist() == [0, 0, 1]
    np.testing.assert_allclose(
        cam.project_jacobian(np.array([0.0, 0.0, 1.0])), [[300, 0, 0], [0, 303, 0]], atol=1e-12
    )


def test_coefficients_of_opencvs_lengths():
    assert distortion_of("brown-conrady", (0.1, 0.2, 0.3, 0.4)) == BrownConrady(0.1, 0.2, 0.3, 0.4)
    assert distortion_of("brown-conrady", (0.1,) * 8).coefficients.tolist() == [0.1] * 8
    assert distortion_of("brown-conrady", (0.1, 0, 0, 0, 0, *[0] * 9)) == BrownConrady(0.1)
    assert distortion_of("brown-conrady", (0,) * 5) is None
    assert distortion_of("fisheye", (0,) * 4) == Fisheye()  # an equidistant lens is no pinhole
    for model, coefficients in (("brown-conrady", (0.1, 0.2)), ("fisheye", (0.1,) * 5)):
        with pytest.raises(ValueError, match="coefficients, not"):
            distortion_of(model, coefficients)
    with pytest.raises(ValueError, match="thin prisms"):
        distortion_of("brown-conrady", (0.1,) * 12)


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
    # r / (1 + 0.3 r²) turns where 1 = 0.3 r², and (1 + 0.1 r²) r / (1 − 0.2 r²) has a pole
    assert BrownConrady(k4=0.3).reach == pytest.approx(np.sqrt(1 / 0.3))
    assert BrownConrady(k1=0.1, k4=-0.2).reach == pytest.approx(np.sqrt(5))
    # d/dθ (θ − 0.5 θ³) = 0
    assert Fisheye(k1=-0.5).reach == pytest.approx(np.tan(np.sqrt(2 / 3)))
    assert Fisheye().reach == 10.0


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
    with pytest.raises(ValueError, match=r"beyond 84\.3 degrees from the axis"):
        camera(Fisheye(), focal_px=120.0)


def test_zero_distortion_changes_nothing():
    plain, zero = camera(None), camera(BrownConrady())
    points = np.random.default_rng(1).normal([0, 0, 6], [1, 1, 1], (50, 3))
    np.testing.assert_allclose(zero.project(points), plain.project(points), rtol=0, atol=1e-12)
    assert dataclasses.replace(camera(SPEED_PLUS), distortion=None) == plain
    assert plain.stretch == (1.0, 1.0)
    assert np.all(plain.area_seen(plain.border_px()) == 1)
