"""Poses from clicked points against the poses that made them, and what is told of wrong points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from posse_core._model.camera import Camera
from posse_core._model.distortion import distortion_of
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._photos.solve import solve_photo

CORNERS = {
    f"B{1 + i}": np.array(corner) * [2.0, 1.2, 0.8] - [1.0, 0.6, 0.4]
    for i, corner in enumerate(np.ndindex(2, 2, 2))
}
POINTS = {**CORNERS, "A1": np.array([0.0, 0.0, 1.6]), "S1": np.array([0.0, 3.0, 0.1])}
SIGMA_PX = 0.5
LENSES = {
    "pinhole": None,
    "brown-conrady": distortion_of("brown-conrady", (-0.2, 0.05, 0.001, -0.002, 0.0)),
    "fisheye": distortion_of("fisheye", (-0.02, 0.01, -0.003, 0.0005)),
}


def craft_of(points):
    part = Part(
        "bus",
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        np.array([[0, 1, 2]], np.int32),
        np.tile(np.float32([0, 0, 1]), (3, 1)),
        np.zeros((3, 2), np.float32),
        "grey",
    )
    return Spacecraft("box", (part,), {"grey": Material("grey")}, points)


def camera_of(lens="pinhole"):
    return Camera(1600, 1200, 1500.0, 1490.0, 805.0, 590.0, 0.01, distortion=LENSES[lens])


def some_pose(rng):
    R = Rotation.random(random_state=rng.integers(1 << 31)).as_matrix()
    return R, np.array([rng.uniform(-2, 2), rng.uniform(-1.5, 1.5), rng.uniform(9, 14)])


def clicked(camera, pose, points, rng=None, sigma_px=SIGMA_PX):
    R, t = pose
    seen = {name: camera.project(R @ point + t) for name, point in points.items()}
    assert np.isfinite(list(seen.values())).all()
    return {name: px + (0 if rng is None else rng.normal(0, sigma_px, 2)) for name, px in seen.items()}


@pytest.mark.parametrize("lens", LENSES)
def test_poses_come_back_within_their_covariance(lens):
    """The normalised squared error of 150 poses is a χ² of 6 times 150 degrees of freedom."""
    rng, camera, craft = np.random.default_rng(5), camera_of(lens), craft_of(POINTS)
    total, count = 0.0, 150
    for _ in range(count):
        R, t = some_pose(rng)
        solved = solve_photo("a", clicked(camera, (R, t), POINTS, rng), craft, camera, SIGMA_PX)
        pose = solved.pose
        assert pose is not None
        error = np.concatenate(
            [Rotation.from_matrix(pose.R_cam_from_body @ R.T).as_rotvec(), pose.t_body_cam_m - t]
        )
        total += error @ np.linalg.solve(pose.covariance, error)
        assert solved.residuals_px == pytest.approx(
            np.array(solved.points_px)
            - [camera.project(pose.R_cam_from_body @ p + pose.t_body_cam_m) for p in POINTS.values()]
        )
    # Huber's weights widen the covariance a little where a residual is beyond two deviations.
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * count)
    assert 0.9 * low < total < high


def test_without_noise_the_pose_is_exact():
    camera, pose = camera_of("fisheye"), some_pose(np.random.default_rng(1))
    solved = solve_photo("a", clicked(camera, pose, POINTS), craft_of(POINTS), camera, SIGMA_PX)
    assert (solved.faults, solved.remark) == ((), "")
    np.testing.assert_allclose(solved.pose.R_cam_from_body, pose[0], atol=1e-7)
    np.testing.assert_allclose(solved.pose.t_body_cam_m, pose[1], atol=1e-6)
    assert solved.rms_px < 1e-5


def test_an_exchanged_pair_is_named_and_left_out_of_the_pose():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        camera, pose = camera_of(), some_pose(rng)
        points = clicked(camera, pose, POINTS, rng)
        one, other = rng.choice(list(POINTS), 2, replace=False)
        if np.linalg.norm(points[one] - points[other]) < 20:
            continue
        points[one], points[other] = points[other], points[one]
        solved = solve_photo("a", points, craft_of(POINTS), camera, SIGMA_PX)
        (fault,) = solved.faults
        assert "exchanged" in fault
        assert {one, other} == {word for word in fault.split() if word in POINTS}
        # The others fix the pose all the same.
        assert np.linalg.norm(solved.pose.t_body_cam_m - pose[1]) < 0.2
        left_out = {n for n, fits in zip(solved.names, solved.pose.inliers, strict=True) if not fits}
        assert left_out == {one, other}


def test_a_point_far_off_is_named_with_its_distance():
    rng = np.random.default_rng(2)
    camera, pose = camera_of(), some_pose(rng)
    points = clicked(camera, pose, POINTS)
    points["A1"] = points["A1"] + [40.0, 0.0]
    solved = solve_photo("a", points, craft_of(POINTS), camera, SIGMA_PX)
    (fault,) = solved.faults
    assert fault.startswith("A1 is 40.0 px from")
    np.testing.assert_allclose(solved.pose.t_body_cam_m, pose[1], atol=1e-5)


def some_of(points, *names):
    return {name: points[name] for name in names}


@pytest.mark.parametrize(
    ("names", "word"),
    [
        (("B1", "B2", "A1"), "has 3 of the 4 points"),
        (("L1", "L2", "L3", "L4", "L5"), "on one line"),
    ],
)
def test_points_that_cannot_give_a_pose_say_why(names, word):
    line = {f"L{i}": np.array([i - 3.0, 0.3 * i, 0.2 * i]) for i in range(1, 6)}
    camera, craft = camera_of(), craft_of({**POINTS, **line})
    points = clicked(camera, some_pose(np.random.default_rng(3)), {**POINTS, **line})
    solved = solve_photo("a", some_of(points, *names), craft, camera, SIGMA_PX)
    assert solved.pose is None
    (fault,) = solved.faults
    assert word in fault


def test_points_in_a_plane_far_away_fit_two_attitudes():
    """Far away perspective vanishes, and a tilted square looks like the one tilted the other way."""
    turn = Rotation.from_rotvec([1.0, -0.4, 0.2]).as_matrix()
    square = {f"S{1 + i}": turn @ [x - 0.5, y - 0.5, 0.0] for i, (x, y) in enumerate(np.ndindex(2, 2))}
    camera, craft = camera_of(), craft_of(square)
    R = Rotation.from_rotvec([0.5, 0.0, 0.0]).as_matrix() @ turn.T
    rng = np.random.default_rng(4)
    far = clicked(camera, (R, np.array([0.0, 0.0, 40.0])), square, rng, 0.5)
    solved = solve_photo("a", far, craft, camera, 0.5)
    assert solved.pose is None
    (fault,) = solved.faults
    apart_deg = float(fault.partition("attitudes, ")[2].partition("°")[0])
    assert apart_deg == pytest.approx(2 * np.degrees(0.5), abs=10)
    # Near by it does not.
    near = clicked(camera, (R, np.array([0.0, 0.0, 2.0])), square, rng, 0.1)
    solved = solve_photo("a", near, craft, camera, 0.1)
    assert solved.faults == ()
    np.testing.assert_allclose(solved.pose.R_cam_from_body, R, atol=5e-3)


def test_an_uncertain_pose_is_no_label():
    """Points within 10 cm at 30 m, clicked to a pixel, tell the attitude to tens of degrees."""
    small = {name: 0.05 * point for name, point in CORNERS.items()}
    camera, pose = camera_of(), (np.eye(3), np.array([0.0, 0.0, 30.0]))
    points = clicked(camera, pose, small, np.random.default_rng(6))
    solved = solve_photo("a", points, craft_of(small), camera, 1.0)
    assert solved.pose is None
    assert solved.faults


def test_few_points_are_remarked():
    camera, pose = camera_of(), some_pose(np.random.default_rng(7))
    points = clicked(camera, pose, some_of(POINTS, "B1", "B4", "A1", "S1", "B6"))
    solved = solve_photo("a", points, craft_of(POINTS), camera, SIGMA_PX)
    assert solved.faults == ()
    assert "5 points" in solved.remark
    np.testing.assert_allclose(solved.pose.t_body_cam_m, pose[1], atol=1e-5)
