"""Somebody's labels, rendered anew: the same poses come back, and conventions are the authors' own."""

import json
import math
import re

import cuboid
import numpy as np
import pytest
from click.testing import CliRunner
from command import run_posse
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._cli.import_poses import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.validate import validate
from posse_core._formats.poses import read_poses
from posse_core._formats.speed import SpeedWriter
from posse_core._formats.urso import read_urso
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import NoOptions
from posse_core._scenario.load import load_scenario
from posse_core._trajectory.build import make_trajectory
from posse_core._trajectory.state import frame_state


def run(*arguments):
    return CliRunner().invoke(command, [str(a) for a in arguments])


def imported(labels, *options):
    """The states of the scenario's frames, and the scenario."""
    out = labels.parent / "anew"
    result = run(labels, "--out", out, "--target", "cubesat", *options)
    assert result.exit_code == 0, result.exception
    registry = load_plugins().registry
    scenario = load_scenario(str(out / "scenario.yaml"), registry)
    trajectory = make_trajectory(scenario, registry)
    states = [frame_state(trajectory, i, scenario.constants) for i in range(len(trajectory))]
    return states, scenario, result


def write_speed(path, entries, key="q_vbs2tango"):
    poses = [
        {"filename": f"img{i:06d}.jpg", key: list(q), "r_Vo2To_vbs_true": list(r)}
        for i, (q, r) in enumerate(entries)
    ]
    path.write_text(json.dumps(poses))
    return path


def matrix(q):
    """Of a scalar-first quaternion."""
    return Rotation.from_quat([*q[1:], q[0]]).as_matrix()


def test_poses_of_our_own_export_come_back(tmp_path):
    folder = cuboid.write_dataset(tmp_path / "d")
    SpeedWriter(NoOptions()).write(Dataset(folder), folder)
    states, scenario, result = imported(folder / "speed.json")
    lines = cuboid.read_lines(folder)
    assert result.stdout.endswith("scenario.yaml: 6 poses\n")
    assert result.stderr == ""
    for state, line in zip(states, lines, strict=True):
        assert state.craft.R_cam_from_body == pytest.approx(matrix(line["q_cam_from_body"]), abs=1e-14)
        assert state.craft.t_body_cam_m == pytest.approx(line["t_body_cam_m"], abs=1e-12)
    assert scenario.camera.camera().matrix == pytest.approx(cuboid.CAMERA.matrix, abs=1e-12)
    names = (folder / "anew/images.csv").read_text().splitlines()
    assert names == ["frame,filename", *(f"{i},{line['image']}" for i, line in enumerate(lines))]


def test_a_run_with_another_craft_labels_the_same_poses(tmp_path, posse):
    """What SPEED's file says of the brick, the run's own export says of the CubeSat."""
    folder = cuboid.write_dataset(tmp_path / "d")
    SpeedWriter(NoOptions()).write(Dataset(folder), folder)
    run(folder / "speed.json", "--out", tmp_path / "anew", "--target", "cubesat")
    done = posse("run", "anew/scenario.yaml", "--renderer", "flat", "--out", "e")
    assert done.returncode == 0, done.stderr
    made = Dataset(tmp_path / "e")
    assert np.array_equal(made.camera.matrix, cuboid.CAMERA.matrix)
    assert validate(made, lambda places, frames: places).passed
    ours, theirs = (json.loads((d / "speed.json").read_text()) for d in (tmp_path / "e", folder))
    assert len(ours) == len(theirs) == 6
    for one, other in zip(ours, theirs, strict=True):
        assert one["q_vbs2tango_true"] == pytest.approx(other["q_vbs2tango_true"], abs=1e-14)
        assert one["r_Vo2To_vbs_true"] == pytest.approx(other["r_Vo2To_vbs_true"], abs=1e-12)
    assert {line.spacecraft for line in made} == {"cubesat"}


unit_or_not = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)
places = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0.5, 500))
suns = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda x: np.linalg.norm(x) > 0.01)


@given(st.lists(st.tuples(unit_or_not, places), min_size=1, max_size=3), suns)
def test_any_pose_is_seen_under_the_sun_that_was_asked_for(tmp_path_factory, entries, sun):
    entries = [(np.array(q) / np.linalg.norm(q), r) for q, r in entries]
    labels = write_speed(tmp_path_factory.mktemp("any") / "train.json", entries, "q_vbs2tango_true")
    states, _, _ = imported(labels, "--sun", *sun)
    for state, (q, r) in zip(states, entries, strict=True):
        assert state.craft.R_cam_from_body == pytest.approx(matrix(q), abs=1e-12)
        assert state.craft.t_body_cam_m == pytest.approx(r, abs=1e-12 * np.linalg.norm(r))
        to_sun = state.R_cam_from_eci @ (state.r_sun_eci_m - state.r_target_eci_m)
        assert to_sun / np.linalg.norm(to_sun) == pytest.approx(sun / np.linalg.norm(sun), abs=1e-9)
        assert state.sun_fraction_target == state.sun_fraction_camera == 1


@pytest.mark.parametrize("sun", [(0, 1, 0), (0, -1, 0), (0, 0, -1)])
def test_the_sun_above_and_below_the_camera(tmp_path, sun):
    labels = write_speed(tmp_path / "train.json", [((1, 0, 0, 0), (0, 0, 9))])
    ((state,), _, _) = imported(labels, "--sun", *sun)
    to_sun = state.R_cam_from_eci @ state.r_sun_eci_m
    assert to_sun / np.linalg.norm(to_sun) == pytest.approx(sun, abs=1e-9)
    assert state.craft.t_body_cam_m == pytest.approx([0, 0, 9], abs=1e-12)


def test_camera_of_speed_plus_lies_in_the_folder_above(tmp_path):
    (tmp_path / "synthetic").mkdir()
    labels = write_speed(tmp_path / "synthetic/train.json", [((1, 0, 0, 0), (0.1, -0.2, 9))])
    K = [[2988.5795163815555, 0, 960], [0, 2988.3401159176124, 600], [0, 0, 1]]
    lens = [-0.22383, 0.514098, -0.000665, -0.000214, -0.131242]
    camera = {"Nu": 1920, "Nv": 1200, "ppx": 5.86e-6, "ppy": 5.86e-6, "fx": 0.0176, "fy": 0.0176}
    (tmp_path / "camera.json").write_text(json.dumps({**camera, "cameraMatrix": K, "distCoeffs": lens}))
    _, scenario, _ = imported(labels)
    made = scenario.camera.camera()
    assert (made.width_px, made.height_px) == (1920, 1200)
    assert np.array_equal(made.matrix, K)
    assert made.distortion_coefficients.tolist() == lens
    assert made.pixel_pitch_m == pytest.approx(5.86e-6)


def test_without_a_camera_file_the_default_is_taken_and_told(tmp_path):
    labels = write_speed(tmp_path / "train.json", [((1, 0, 0, 0), (0, 0, 9))])
    _, scenario, result = imported(labels)
    assert "no camera.json beside" in result.stderr
    assert scenario.camera.camera().width_px == 1280


# URSO


def left_handed(q1, q2, q3, q4):
    """A turn of axes by Trawny and Roumeliotis, "Indirect Kalman filter for 3D attitude estimation"."""
    e = np.array([q1, q2, q3])
    cross = np.array([[0, -q3, q2], [q3, 0, -q1], [-q2, q1, 0]])
    return (2 * q4**2 - 1) * np.eye(3) - 2 * q4 * cross + 2 * np.outer(e, e)


def write_urso(folder, rows, names=True):
    path = folder / "train_poses_gt.csv"
    lines = ["x,y,z,q1,q2,q3,q4", *(",".join(map(repr, map(float, row))) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    if names:
        (folder / "train_images.csv").write_text("".join(f"{7 * i}_rgb.png\n" for i in range(len(rows))))
    return path


@given(unit_or_not, places)
def test_urso_points_fall_where_its_authors_draw_them(tmp_path_factory, q, place):
    """They project left-handed camera axes with a negative vertical focal length, and the mesh's y axis
    to the other side."""
    q = np.array(q) / np.linalg.norm(q)
    path = write_urso(tmp_path_factory.mktemp("urso"), [(*place, *q)])
    (pose,) = read_urso(path)
    assert pose.image == "0_rgb.png"
    points = np.concatenate([np.eye(3), [[0.3, -0.2, 0.1], [0, 0, 0]]])
    theirs = (points * [1, -1, 1]) @ left_handed(*q).T + place
    ours = points @ matrix(pose.q_cam_from_body).T + np.array(pose.t_body_cam_m)
    f = 640.0
    drawn = np.stack([f * theirs[:, 0] + 640 * theirs[:, 2], -f * theirs[:, 1] + 480 * theirs[:, 2]], -1)
    expected = np.stack([f * ours[:, 0] + 640 * ours[:, 2], f * ours[:, 1] + 480 * ours[:, 2]], -1)
    assert ours[:, 2] == pytest.approx(theirs[:, 2], abs=1e-9)
    assert expected == pytest.approx(drawn, abs=1e-6)


def test_urso_of_a_craft_turned_to_the_right(tmp_path):
    """Its nose, x, was away from the camera and now points right; z is up, so left, y, is away."""
    ahead_right_up_in_camera = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    yaw = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    q = Rotation.from_matrix((ahead_right_up_in_camera @ yaw).T).as_quat()
    assert left_handed(*q) == pytest.approx(ahead_right_up_in_camera @ yaw, abs=1e-12)
    (pose,) = read_urso(write_urso(tmp_path, [(0, 0, 20, *q)]))
    right, down, ahead = np.eye(3)
    x, y, z = matrix(pose.q_cam_from_body).T
    assert [*x, *y, *z] == pytest.approx([*right, *ahead, *-down], abs=1e-12)


def test_urso_as_a_scenario(tmp_path):
    half = math.sqrt(0.5)
    labels = write_urso(tmp_path, [(1, 2, 20, 0, 0, 0, 1), (0, 0, 30, 0, half, 0, half)], names=False)
    states, _, _ = imported(labels)
    assert states[0].craft.R_cam_from_body == pytest.approx(np.eye(3), abs=1e-12)
    assert states[0].craft.t_body_cam_m == pytest.approx([1, -2, 20])  # up is not down
    assert states[1].craft.R_cam_from_body == pytest.approx(matrix([half, 0, -half, 0]), abs=1e-12)


# What cannot be read


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not poses of SPEED"),
        ("[]", "has no poses"),
        ('[{"filename": "a.jpg"}]', r"0\.q_vbs2tango.*missing"),
        (
            '[{"filename": "a", "q_vbs2tango": [1, 0, 0], "r_Vo2To_vbs_true": [0, 0, 1]}]',
            r"0\.q_vbs2tango\.3: missing",
        ),
        (
            '[{"filename": "a", "q_vbs2tango": [1, 1, 0, 0], "r_Vo2To_vbs_true": [0, 0, 1]}]',
            "a: the quat",
        ),
        (
            '[{"filename": "a", "q_vbs2tango": [1, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0, -1]}]',
            "a: the quat",
        ),
        (
            '[{"filename": "a", "q_vbs2tango": [NaN, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0, 1]}]',
            r"0\.q_vbs2tango\.0: input should be a finite number",
        ),
    ],
)
def test_files_that_hold_no_poses(tmp_path, text, words):
    path = tmp_path / "train.json"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as error:
        read_poses(path)
    assert "train.json" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("table", "names", "words"),
    [
        ("x,y,q1,q2,q3,q4\n0,0,0,0,0,1\n", "a\n", "train_poses_gt.csv: has no column 'z'"),
        ("x,y,z,q1,q2,q3,q4\n0,0,9-0,0,0,0,1\n", "a\n", "row 1: z is '9-0'; give a number"),
        ("x,y,z,q1,q2,q3,q4\n0,0,9,0,0,0,1\n0,0,9\n", "a\nb\n", "row 2: q1 is ''; give a number"),
        ("x,y,z,q1,q2,q3,q4\n0,0,9,0,0,0,1\n" * 2, "a\n", "row 2: x is 'x'"),
        ("x,y,z,q1,q2,q3,q4\n" + "0,0,9,0,0,0,1\n" * 2, "a\n", "train_images.csv: has 1 names"),
        ("x,y,z,q1,q2,q3,q4\n" + "0" * 200_000 + ",0\n", "a\n", "train_poses_gt.csv: not a table"),
    ],
)
def test_tables_of_urso_that_hold_no_poses(tmp_path, table, names, words):
    (tmp_path / "train_poses_gt.csv").write_text(table)
    (tmp_path / "train_images.csv").write_text(names)
    with pytest.raises(InputError, match=re.escape(words)) as error:
        read_poses(tmp_path / "train_poses_gt.csv")
    assert "Error" not in str(error.value)


def test_refusals_write_nothing(tmp_path):
    labels = write_speed(tmp_path / "train.json", [((1, 0, 0, 0), (0, 0, 9))])
    (tmp_path / "there").mkdir()
    for options, words in (
        (("--out", tmp_path / "there", "--target", "aqua"), "exists already"),
        (("--out", tmp_path / "new", "--target", "aqqa"), "did you mean 'aqua'"),
        (("--out", tmp_path / "new", "--target", "aqua", "--sun", 0, 0, 0), "no direction"),
        (("--out", tmp_path / "new", "--target", "aqua", "--camera", tmp_path / "c.json"), "c.json"),
    ):
        result = run(labels, *options)
        assert isinstance(result.exception, InputError), result.exception
        assert words in str(result.exception)
        assert not (tmp_path / "new").exists()
    with pytest.raises(InputError, match="there is no such file"):
        read_poses(tmp_path / "none.json")


CENTRE_BODY_M = np.array([0.1, -0.2, 0.3])


def labels_of_motion(folder, t_s, n_rad_s):
    """What a camera that looks back along the track sees of a body that turns at a constant rate, its
    labels' origin off its centre of mass; and the chaser's velocity (F, 3), RTN axes.

    The chaser is on a relative ellipse by Clohessy and Wiltshire's equations.
    """
    a_m, b_m, u = 0.4, 0.3, n_rad_s * t_s
    r_rtn_m = np.stack([a_m * np.cos(u), 8 - 2 * a_m * np.sin(u), b_m * np.sin(u)], axis=-1)
    v_m_s = n_rad_s * np.stack([-a_m * np.sin(u), -2 * a_m * np.cos(u), b_m * np.cos(u)], axis=-1)
    centre_cam_m = np.stack([-r_rtn_m[:, 2], r_rtn_m[:, 0], r_rtn_m[:, 1]], axis=-1)
    turns = Rotation.from_rotvec(np.outer(0.016 * t_s, [0.6, 0, 0.8]))
    origin_cam_m = centre_cam_m - turns.apply(CENTRE_BODY_M)
    entries = zip(turns.as_quat()[:, [3, 0, 1, 2]].tolist(), origin_cam_m.tolist(), strict=True)
    return write_speed(folder / "motion.json", list(entries)), r_rtn_m, v_m_s


def test_poses_one_after_another_are_a_motion_on_an_orbit(tmp_path):
    """Pose by pose as before; the target on a circle by Kepler's law, the chaser at its own velocity."""
    t_s = 5.0 * np.arange(60)
    labels, r_rtn_m, v_m_s = labels_of_motion(tmp_path, t_s, np.sqrt(3.986004418e14 / 7.0e6**3))
    options = ("--every", 5, "--centre-of-mass", *CENTRE_BODY_M)
    states, scenario, _ = imported(labels, *options, "--sun", 1, 0.2, -0.3)
    registry = load_plugins().registry
    made = make_trajectory(scenario, registry)
    np.testing.assert_allclose(made.t_s, t_s)
    assert set(made.sequence) == {0}
    np.testing.assert_allclose(made.r_chaser_rtn_m, r_rtn_m, atol=1e-9)
    np.testing.assert_allclose(made.v_chaser_rtn_m_s, v_m_s, atol=1e-6)
    r, v = made.r_target_eci_m, made.v_target_eci_m_s
    np.testing.assert_allclose(np.linalg.norm(r, axis=1), 7.0e6)
    np.testing.assert_allclose(np.sum(v**2, axis=1), 3.986004418e14 / 7.0e6)
    np.testing.assert_allclose((r[2:] - r[:-2]) / 10, v[1:-1], rtol=1e-5, atol=0.1)
    for i in (0, 30):
        q, r_cam = (json.loads(labels.read_text())[i][k] for k in ("q_vbs2tango", "r_Vo2To_vbs_true"))
        assert states[i].craft.R_cam_from_body == pytest.approx(matrix(q), abs=1e-12)
        centre = np.array(r_cam) + matrix(q) @ CENTRE_BODY_M
        assert states[i].craft.t_body_cam_m == pytest.approx(centre, abs=1e-9)
    to_sun = states[0].R_cam_from_eci @ states[0].r_sun_eci_m
    assert to_sun / np.linalg.norm(to_sun) == pytest.approx(np.array([1, 0.2, -0.3]) / np.sqrt(1.13))


def test_one_pose_is_no_motion(tmp_path):
    labels = write_speed(tmp_path / "train.json", [((1, 0, 0, 0), (0, 0, 9))])
    result = run(labels, "--out", tmp_path / "anew", "--target", "cubesat", "--every", 5)
    assert isinstance(result.exception, InputError)
    assert "--every: there is one pose" in str(result.exception)
    assert not (tmp_path / "anew").exists()


@pytest.mark.parametrize("every", ["1e300", "1e-300", "nan"])
def test_a_motion_of_no_time_or_of_all_time_is_refused(tmp_path, every):
    labels, _, _ = labels_of_motion(tmp_path, 5.0 * np.arange(4), 0.001)
    code, _, error = run_posse(
        "import-poses", labels, "--out", tmp_path / "anew", "--target", "cubesat", "--every", every
    )
    assert code == 2
    (line,) = error.splitlines()
    assert "--every" in line
    assert not (tmp_path / "anew").exists()
