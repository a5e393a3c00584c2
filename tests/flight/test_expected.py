"""What the chaser expects of a frame, and poses that are refined from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_flight import NATURAL

import posse_core as posse
from posse_core._flight.expected import Expected, PoseRefiner, expected
from posse_core._flight.readings_log import ReadingsLog

IMAGE = np.zeros((48, 64), np.uint8)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """The trajectory of a simulator, and a frame's state."""
    pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")
    path = tmp_path_factory.mktemp("natural") / "s.yaml"
    path.write_text(NATURAL.replace("name: flat, seconds: 0", "name: raster"))
    with posse.open(path) as sim:
        return sim.trajectory, sim.state(20)


def scalar_first(rotation: Rotation) -> np.ndarray:
    x, y, z, w = rotation.as_quat()
    return np.array([w, x, y, z])


def estimate(row, covariance, r_error=0.0, turn=(0.0, 0.0, 0.0)) -> posse.Estimate:
    """The true motion with errors: of the position, RTN axes, and a turn of the body, body axes."""
    w, x, y, z = row.q_eci_from_body[0]
    attitude = Rotation.from_quat([x, y, z, w]) * Rotation.from_rotvec(turn)
    return posse.Estimate(
        float(row.t_s[0]),
        row.r_chaser_rtn_m[0] + r_error,
        row.v_chaser_rtn_m_s[0],
        covariance,
        scalar_first(attitude),
        row.omega_body_rad_s[0],
    )


def test_who_knows_the_truth_expects_the_pose_and_the_sun_of_the_frame(simulated):
    trajectory, state = simulated
    row = trajectory.rows(np.array([20]))
    got = expected(estimate(row, np.zeros((12, 12))), row, row.q_eci_from_camera[0])
    np.testing.assert_allclose(got.pose.R_cam_from_body, state.craft.R_cam_from_body, atol=1e-9)
    np.testing.assert_allclose(got.pose.t_body_cam_m, state.craft.t_body_cam_m, atol=1e-6)
    np.testing.assert_allclose(got.sun_direction_cam, state.craft.sun_direction_cam, atol=1e-9)


def test_without_an_attitude_or_an_estimate_no_pose_is_expected(simulated):
    row = simulated[0].rows(np.array([20]))
    still = posse.Estimate(0.0, row.r_chaser_rtn_m[0], np.zeros(3), np.eye(6))
    for known in (None, still):
        assert expected(known, row, row.q_eci_from_camera[0]).pose is None


@pytest.mark.parametrize("what", ["sun_fraction_target", "solar_flux_w_m2"])
def test_no_sun_is_expected_in_eclipse_or_where_it_is_no_light(simulated, what):
    row = replace(simulated[0].rows(np.array([20])), **{what: np.zeros(1)})
    assert expected(None, row, row.q_eci_from_camera[0]).sun_direction_cam is None


@pytest.mark.parametrize("seed", range(3))
def test_the_covariance_is_that_of_the_errors_of_many_estimates(simulated, seed):
    """Small turns of the body and errors of the position that are correlated with them."""
    trajectory, state = simulated
    row, draw = trajectory.rows(np.array([20])), np.random.default_rng(seed)
    mixing = draw.normal(size=(12, 12)) * np.repeat([0.3, 0.01, 1e-3, 1e-5], 3)[:, None]
    errors = draw.standard_normal((2000, 12)) @ mixing.T
    sigma = mixing @ mixing.T
    q = row.q_eci_from_camera[0]
    told = expected(estimate(row, sigma), row, q).pose.covariance
    seen = []
    for error in errors:
        pose = expected(estimate(row, sigma, error[:3], error[6:9]), row, q).pose
        turn = Rotation.from_matrix(pose.R_cam_from_body @ state.craft.R_cam_from_body.T)
        seen.append([*turn.as_rotvec(), *(pose.t_body_cam_m - state.craft.t_body_cam_m)])
    scale = np.sqrt(np.diag(told))
    np.testing.assert_allclose(
        np.cov(np.array(seen).T) / np.outer(scale, scale), told / np.outer(scale, scale), atol=0.15
    )


def pose_at(range_m: float, sigma_m: float = 0.01) -> posse.PoseEstimate:
    covariance = np.diag([1e-6] * 3 + [sigma_m**2] * 3)
    return posse.PoseEstimate(
        np.eye(3), np.array([0.0, 0.0, range_m]), covariance, np.ones(4, bool), 1.0
    )


class Refined:
    """In place of meshes and a refiner: what a refiner makes of the starts that it is given."""

    def __init__(self, made: posse.Refinement | None) -> None:
        self.made, self.starts, self.sun = made, None, None

    def refined(self, image, label, poses, camera, sun_direction_cam):
        self.starts, self.sun = poses, sun_direction_cam
        return self.made


def refiner(made):
    shapes = Refined(made)
    camera = posse.Camera(64, 48, 60.0, 60.0, 31.5, 23.5, 0.01)
    return shapes, PoseRefiner(shapes, "box", camera, least_trust=0.5)


def test_a_pose_is_refined_from_the_expected_one_and_from_those_that_were_found():
    made = posse.Refinement(pose_at(20.1), True, 0.9, 0.5)
    shapes, refining = refiner(made)
    expects, found, sun = pose_at(20.0), pose_at(21.0), np.array([0.0, 0.0, -1.0])
    assert refining.pose(IMAGE, [found], Expected(expects, sun)) is made.pose
    assert shapes.starts == [expects, found]
    assert shapes.sun is sun
    assert refining.pose(IMAGE, [found], Expected()) is made.pose
    assert shapes.starts == [found]


@pytest.mark.parametrize(
    "made",
    [
        None,
        posse.Refinement(pose_at(20.0), False, 0.5, 0.5, certainty_left=1.0),
        posse.Refinement(pose_at(20.0, sigma_m=5.0), True, 0.9, 0.5),
    ],
    ids=["nothing", "a start", "not trusted"],
)
def test_a_start_or_a_pose_that_is_not_trusted_is_no_reading(made):
    assert refiner(made)[1].pose(IMAGE, [], Expected(pose_at(20.0))) is None


def test_without_any_start_nothing_is_refined():
    shapes, refining = refiner(posse.Refinement(pose_at(20.0), True, 0.9, 0.5))
    assert refining.pose(IMAGE, [], Expected()) is None
    assert shapes.starts is None


def test_poses_of_images_are_refined_when_a_sequence_is_tracked(tmp_path):
    """From keypoints with 2 px of noise, at 45 m of a camera of 160 x 120 pixels. What the raster drew
    is refined by the raster, so the gain is the largest that there can be."""
    pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")
    scenario = NATURAL.replace("name: flat, seconds: 0", "name: raster")
    (tmp_path / "s.yaml").write_text(
        scenario.replace("duration_s: 590, count: 60", "t_s: [0, 10, 20, 30]")
    )
    dataset = posse.run(tmp_path / "s.yaml", tmp_path / "d")
    read = {"measurement.source": "truth", "measurement.use": "pose", "measurement.sigma_px": 2.0}
    plain = posse.track(dataset, overrides=read)
    refined = posse.track(dataset, overrides={**read, "measurement.refiner": "render-compare"})
    np.testing.assert_array_equal(refined.r_single_rtn_m, plain.r_single_rtn_m)
    off_m = [
        np.median(np.linalg.norm(record.r_rtn_m - record.r_true_rtn_m, axis=1))
        for record in (plain, refined)
    ]
    assert off_m[1] < off_m[0] / 3


def test_a_refined_pose_comes_back_from_the_log_of_readings(tmp_path):
    pose = replace(pose_at(20.0), inliers=np.zeros(0, bool))
    readings = posse.Readings(3, 30.0, 30.2, np.array([1.0, 0, 0, 0]), pose=pose, pose_alone=None)
    log = ReadingsLog(tmp_path)
    log.append(readings)
    back = log.recover({3})[3]
    np.testing.assert_array_equal(back.pose.covariance, pose.covariance)
    assert back.pose.inliers.dtype == bool
    assert back.pose_alone is None


@pytest.mark.parametrize(
    ("measurement", "words"),
    [
        ({"refiner": "render-compare"}, "refiner is for poses, and use is 'keypoints'"),
        (
            {"refiner": "render-compare", "use": "pose", "correction": "raster"},
            "correction and refiner both improve the pose",
        ),
        ({"refiner": "rendr-compare", "use": "pose"}, "rendr-compare.*did you mean 'render-compare'"),
        ({"refiner": {"name": "render-compare", "mz": 1}, "use": "pose"}, "unknown key.*'ms'"),
    ],
)
def test_a_refiner_that_cannot_be_is_told_by_its_key(measurement, words):
    with pytest.raises(posse.InputError, match=f"flight.measurement.*{words}"):
        posse.open("fly-hold", overrides={"flight.measurement": measurement})


def test_a_spacecraft_with_joints_has_no_mesh_to_refine_by(tmp_path):
    pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")
    with pytest.raises(posse.InputError, match=r"flight\.measurement\.refiner: 'aqua' has joints"):
        posse.fly(
            "fly-approach",
            renderer="raster",
            overrides={
                "joints.wing": "sun-tracking",
                "flight.measurement": {
                    "source": "truth",
                    "use": "pose",
                    "refiner": "render-compare",
                },
            },
        )
