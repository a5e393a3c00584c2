"""Several poses fitted at once, each as if it were alone."""

from __future__ import annotations

import cuboid
import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from posse_core._detection.fitting import Points, fitted_poses

CORNERS_M = cuboid.corners()
COUNT, KEYPOINTS = 12, len(CORNERS_M)


def some(seed: int) -> tuple[np.ndarray, np.ndarray, Points]:
    """True poses, and their keypoints, seen with errors; one of each does not count and is unknown."""
    random = np.random.default_rng(seed)
    R = Rotation.random(COUNT, random_state=seed).as_matrix()
    t = np.column_stack([random.uniform(-0.5, 0.5, (COUNT, 2)), random.uniform(6, 12, COUNT)])
    px = cuboid.CAMERA.project(CORNERS_M @ np.swapaxes(R, 1, 2) + t[:, None])
    sigma_px = random.uniform(0.5, 2.0, (COUNT, KEYPOINTS))
    px = px + sigma_px[..., None] * random.normal(size=px.shape)
    agree = np.ones((COUNT, KEYPOINTS), bool)
    agree[np.arange(COUNT), random.integers(KEYPOINTS, size=COUNT)] = False
    px[~agree] = np.nan
    return R, t, Points(CORNERS_M, px, sigma_px, agree)


def off(R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses to start from."""
    turn = Rotation.from_rotvec([0.1, -0.08, 0.12]).as_matrix()
    return turn @ R, t * [1.0, 1.0, 1.08]


def test_no_general_minimiser_finds_a_lower_cost() -> None:
    """Of Huber's: half the square of each distance up to two standard deviations, linear beyond."""
    R, t, points = some(1)
    made = fitted_poses(*off(R, t), points, cuboid.CAMERA)
    for n, pose in enumerate(made):
        counts = points.agree[n]

        def cost(x: np.ndarray, n: int = n, counts: np.ndarray = counts) -> float:
            placed_m = CORNERS_M[counts] @ (Rotation.from_rotvec(x[:3]).as_matrix() @ R[n]).T + x[3:]
            away_px = cuboid.CAMERA.project(placed_m) - points.px[n, counts]
            far = np.linalg.norm(away_px, axis=1) / points.sigma_px[n, counts]
            return float(np.where(far <= 2.0, far**2 / 2, 2.0 * far - 2.0).sum())

        assert pose is not None
        turn = Rotation.from_matrix(pose.R_cam_from_body @ R[n].T).as_rotvec()
        found = np.concatenate([turn, pose.t_body_cam_m])
        truth = np.concatenate([np.zeros(3), t[n]])
        best = min(minimize(cost, start, method="Powell").fun for start in (truth, found))
        assert cost(found) < cost(truth)
        assert cost(found) < best + 1e-3


def test_a_pose_does_not_depend_on_those_beside_it() -> None:
    R, t, points = some(2)
    starts = off(R, t)
    together = fitted_poses(*starts, points, cuboid.CAMERA)
    for n, pose in enumerate(together):
        only = np.arange(COUNT) == n
        (alone,) = fitted_poses(starts[0][only], starts[1][only], points.of(only), cuboid.CAMERA)
        assert pose is not None
        assert alone is not None
        np.testing.assert_allclose(pose.R_cam_from_body, alone.R_cam_from_body, atol=1e-9)
        np.testing.assert_allclose(pose.t_body_cam_m, alone.t_body_cam_m, atol=1e-8)
        np.testing.assert_allclose(pose.covariance, alone.covariance, rtol=1e-6)


def test_a_start_behind_the_camera_gives_none_and_harms_no_other() -> None:
    R, t, points = some(3)
    R_start, t_start = off(R, t)
    t_start[4, 2] *= -1
    made = fitted_poses(R_start, t_start, points, cuboid.CAMERA)
    assert [n for n, pose in enumerate(made) if pose is None] == [4]


def test_of_no_pose_none_is_made() -> None:
    _, _, points = some(4)
    none = np.zeros(COUNT, bool)
    assert fitted_poses(np.zeros((0, 3, 3)), np.zeros((0, 3)), points.of(none), cuboid.CAMERA) == []
