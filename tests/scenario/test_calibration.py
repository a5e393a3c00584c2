"""Calibrations as their programs write them, against the projections of OpenCV and pycolmap."""

import contextlib
import json
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest
import yaml
from by_opencv import projected_px
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from posse_core._cli.import_poses import command as import_poses
from posse_core._dataset.camera import write_camera
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady, Fisheye
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import validated
from posse_core._scenario.camera import CameraConfig
from posse_core._scenario.load import dump_scenario, load_scenario

K = np.array([[612.5, 0, 331.25], [0, 613.75, 238.5], [0, 0, 1]])
SIZE = (640, 480)
FIVE = [-0.28, 0.07, 1e-4, -2e-4, 0.01]
EIGHT = [0.3, -0.1, 1e-4, -2e-4, 0.02, 0.5, 0.1, -0.02]
FOUR = [-0.02, 0.01, -0.003, 0.0005]
POINTS_M = np.random.default_rng(0).uniform([-0.8, -0.6, 2], [0.8, 0.6, 4], (60, 3))


def camera_of(file: str | Path, **beside) -> Camera:
    keys = {"calibration": str(file), **beside}
    config = validated(CameraConfig, keys, lambda key: ".".join(map(str, key)))
    assert config.calibration is None
    return config.camera()


def matrix(value: list[float], rows: int, cols: int) -> dict:
    return {"rows": rows, "cols": cols, "data": value}


def cv2_file(path: Path, lens: list[float], size: bool = True, **more) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Mon 02 Jan 2006 15:04:05")
    if size:
        storage.write("image_width", SIZE[0])
        storage.write("image_height", SIZE[1])
    for key, value in more.items():
        storage.write(key, value)
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", np.array(lens)[:, None])
    storage.release()
    return path


# What programs write


@pytest.mark.parametrize("suffix", ["yaml", "yml", "xml", "json"])
@pytest.mark.parametrize(
    ("lens", "expected"),
    [
        (FIVE, BrownConrady(*FIVE)),
        (EIGHT, BrownConrady(*EIGHT)),
        ([*FIVE, *[0] * 9], BrownConrady(*FIVE)),
        ([0] * 5, None),
    ],
)
def test_opencvs_files(tmp_path, suffix, lens, expected):
    camera = camera_of(cv2_file(tmp_path / f"c.{suffix}", lens))
    assert np.array_equal(camera.matrix, K)
    assert (camera.width_px, camera.height_px) == SIZE
    assert camera.distortion == expected
    uv, _ = cv2.projectPoints(POINTS_M, np.zeros(3), np.zeros(3), K, np.array(lens, float))
    np.testing.assert_allclose(camera.project(POINTS_M), uv[:, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("suffix", ["yaml", "xml", "json"])
def test_opencvs_fisheye_is_told_by_the_file_or_beside_it(tmp_path, suffix):
    told = camera_of(cv2_file(tmp_path / f"told.{suffix}", FOUR, fisheye_model=1))
    uv, _ = cv2.fisheye.projectPoints(POINTS_M[:, None], np.zeros(3), np.zeros(3), K, np.array(FOUR))
    np.testing.assert_allclose(told.project(POINTS_M), uv[:, 0], rtol=0, atol=1e-9)
    untold = cv2_file(tmp_path / f"untold.{suffix}", FOUR)
    assert camera_of(untold, distortion_model="fisheye") == told
    assert camera_of(untold, distortion_model="brown-conrady").distortion == BrownConrady(*FOUR)
    with pytest.raises(InputError, match=r"untold\..*: four coefficients .* add distortion_model"):
        camera_of(untold)


@pytest.mark.parametrize(
    ("model", "lens", "expected"),
    [
        ("plumb_bob", FIVE, BrownConrady(*FIVE)),
        ("rational_polynomial", EIGHT, BrownConrady(*EIGHT)),
        ("equidistant", FOUR, Fisheye(*FOUR)),
    ],
)
def test_ros_files_and_messages(tmp_path, model, lens, expected):
    """camera_calibration_parsers writes the first, ``ros2 topic echo --once`` the second."""
    size = {"image_width": 640, "image_height": 480}
    file = {
        **size,
        "camera_name": "narrow",
        "camera_matrix": matrix(K.ravel().tolist(), 3, 3),
        "distortion_model": model,
        "distortion_coefficients": matrix(lens, 1, len(lens)),
        "rectification_matrix": matrix(np.eye(3).ravel().tolist(), 3, 3),
        "projection_matrix": matrix([*range(12)], 3, 4),
    }
    message = {"header": {"frame_id": "x"}, "height": 480, "width": 640, "distortion_model": model}
    message |= {"d": lens, "k": K.ravel().tolist(), "r": [1.0] * 9, "p": [1.0] * 12, "binning_x": 0}
    (tmp_path / "file.yaml").write_text(yaml.safe_dump(file, sort_keys=False))
    (tmp_path / "message.yaml").write_text(yaml.safe_dump(message, sort_keys=False) + "---\n")
    for name in ("file.yaml", "message.yaml"):
        camera = camera_of(tmp_path / name)
        assert np.array_equal(camera.matrix, K)
        assert (camera.width_px, camera.height_px) == SIZE
        assert camera.distortion == expected


KALIBR = """\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0001, -0.0002]
  distortion_model: radtan
  intrinsics: [612.5, 613.75, 331.25, 238.5]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.02, 0.01, -0.003, 0.0005]
  distortion_model: equidistant
  intrinsics: [612.5, 613.75, 331.25, 238.5]
  resolution: [640, 480]
  rostopic: /cam1/image_raw
"""


def test_kalibrs_chain(tmp_path):
    path = tmp_path / "camchain.yaml"
    path.write_text(KALIBR)
    with pytest.raises(
        InputError, match=r"camchain\.yaml: has cameras cam0, cam1; .*camchain\.yaml#cam0"
    ):
        camera_of(path)
    radtan, equi = camera_of(f"{path}#cam0"), camera_of(f"{path}#cam1")
    assert np.array_equal(radtan.matrix, K)
    assert radtan.distortion == BrownConrady(*FIVE[:4])
    assert equi.distortion == Fisheye(*FOUR)
    with pytest.raises(InputError, match="has no camera 'cam2' but cam0, cam1"):
        camera_of(f"{path}#cam2")
    path.write_text(KALIBR.split("cam1:")[0])
    assert camera_of(path) == radtan


@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("SIMPLE_PINHOLE", [600, 331.7, 239.1]),
        ("PINHOLE", [600, 610, 331.7, 239.1]),
        ("SIMPLE_RADIAL", [600, 331.7, 239.1, -0.1]),
        ("RADIAL", [600, 331.7, 239.1, -0.1, 0.02]),
        ("OPENCV", [600, 610, 331.7, 239.1, -0.1, 0.02, 1e-3, -2e-3]),
        ("FULL_OPENCV", [600, 610, 331.7, 239.1, *EIGHT]),
        ("SIMPLE_RADIAL_FISHEYE", [600, 331.7, 239.1, -0.02]),
        ("RADIAL_FISHEYE", [600, 331.7, 239.1, -0.02, 0.01]),
        ("OPENCV_FISHEYE", [600, 610, 331.7, 239.1, *FOUR]),
    ],
)
def test_colmaps_cameras_as_pycolmap_writes_and_projects_them(tmp_path, model, parameters):
    theirs = pycolmap.Camera(model=model, width=640, height=480, params=parameters, camera_id=3)
    model_of_one = pycolmap.Reconstruction()
    model_of_one.add_camera(theirs)
    model_of_one.write_text(str(tmp_path))
    ours = camera_of(tmp_path / "cameras.txt")
    assert ours == camera_of(f"{tmp_path / 'cameras.txt'}#3")
    expected = theirs.img_from_cam(POINTS_M) - 0.5  # the first pixel's centre is (0.5, 0.5)
    np.testing.assert_allclose(ours.project(POINTS_M), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("lens", [None, BrownConrady(*EIGHT), Fisheye(*FOUR)])
def test_a_dataset_s_camera(tmp_path, lens):
    camera = Camera(640, 480, 612.5, 613.75, 331.25, 238.5, 0.0072, 1e-5, lens)
    write_camera(camera, tmp_path / "camera.json")
    read = camera_of(tmp_path / "camera.json")
    assert read.sensor_width_m == pytest.approx(0.0072)
    assert read.line_time_s == 1e-5
    assert read.distortion == lens
    np.testing.assert_array_equal(read.project(POINTS_M), camera.project(POINTS_M))
    np.testing.assert_allclose(read.project(POINTS_M), projected_px(camera, POINTS_M), atol=1e-9)


@pytest.mark.parametrize("key", ["ppx", "lineTime_s"])
@pytest.mark.parametrize("value", [[], [1e-5, 1e-5]])
def test_a_length_or_time_is_one_number(tmp_path, key, value):
    path = tmp_path / "camera.json"
    write_camera(Camera(640, 480, 612.5, 613.75, 331.25, 238.5, 0.0072, 1e-5), path)
    path.write_text(json.dumps({**json.loads(path.read_text()), key: value}))
    with pytest.raises(InputError, match=f"{key}: has {len(value)} numbers instead of 1"):
        camera_of(path)


# In a scenario


SCENARIO = """\
target: {name: aqua}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7123931.35, e: 8.98e-5, i_deg: 98.23,
             raan_deg: 334.40, argp_deg: 52.44, mean_anomaly_deg: 318.10}
renderer: {name: none}
camera: {calibration: lab/c.yaml, sensor_width_mm: 7.2, scale: 0.5}
sensors: {side: {type: camera, camera: {calibration: lab/chain.yaml#cam1}}}
"""


class _Registry:
    """The process's registry, with a renderer."""

    def __init__(self) -> None:
        self._registry = load_plugins().registry

    def options_model(self, kind, name):
        return self._registry.options_model(
            *("executor", "local") if kind == "renderer" else (kind, name)
        )

    def spec(self, kind, name):
        return self._registry.spec(kind, name)


@pytest.fixture
def lab(tmp_path):
    (tmp_path / "lab").mkdir()
    cv2_file(tmp_path / "lab/c.yaml", FIVE)
    (tmp_path / "lab/chain.yaml").write_text(KALIBR)
    (tmp_path / "s.yaml").write_text(SCENARIO)
    return tmp_path


def test_a_scenario_holds_the_numbers_and_not_the_file(lab):
    """The file is beside the scenario, and is no longer needed once it is read."""
    scenario = load_scenario(str(lab / "s.yaml"), _Registry())
    camera = scenario.camera.camera()
    assert (camera.width_px, camera.height_px) == (320, 240)
    assert camera.cx_px == (331.25 + 0.5) / 2 - 0.5
    assert camera.sensor_width_m == pytest.approx(0.0072)
    assert scenario.sensors["side"].options["camera"]["distortion"] == FOUR
    text = dump_scenario(scenario)
    assert "lab/" not in text
    assert "chain" not in text
    (lab / "dumped.yaml").write_text(text)
    for file in ("c.yaml", "chain.yaml"):
        (lab / "lab" / file).unlink()
    assert load_scenario(str(lab / "dumped.yaml"), _Registry()) == scenario


def test_keys_beside_a_calibration_override_it(lab):
    def camera(**keys):
        given = {f"camera.{key}": value for key, value in keys.items()}
        return load_scenario(str(lab / "s.yaml"), _Registry(), given).camera.camera()

    assert camera(distortion=None).distortion is None
    assert camera(distortion=FOUR, distortion_model="fisheye").distortion == Fisheye(*FOUR)
    assert camera(centre_px=None).cx_px == 159.5
    assert camera(hfov_deg=None, preset=None) == camera()
    with pytest.raises(InputError, match="camera: give calibration or hfov_deg, not both"):
        camera(hfov_deg=60)


def test_a_calibration_given_by_an_option_replaces_the_camera_s_numbers(lab):
    dumped = lab / "dumped.yaml"
    dumped.write_text(dump_scenario(load_scenario(str(lab / "s.yaml"), _Registry())))
    given = {"camera.calibration": "lab/chain.yaml#cam1", "camera.line_time_s": 1e-5}
    camera = load_scenario(str(dumped), _Registry(), given).camera.camera()
    assert (camera.width_px, camera.line_time_s, camera.distortion) == (640, 1e-5, Fisheye(*FOUR))
    given["camera.preset"] = "speed"
    with pytest.raises(InputError, match="give calibration or preset, not both"):
        load_scenario(str(dumped), _Registry(), given)


def test_poses_are_imported_with_any_calibration(lab):
    entry = {"filename": "a.png", "q_vbs2tango_true": [1, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0.1, 9]}
    (lab / "train.json").write_text(json.dumps([entry]))
    chain = f"{lab / 'lab/chain.yaml'}#cam1"
    words = [str(lab / "train.json"), "--out", str(lab / "p"), "--target", "aqua", "--camera", chain]
    result = CliRunner().invoke(import_poses, words)
    assert result.exit_code == 0, result.output
    value = yaml.safe_load((lab / "p/scenario.yaml").read_text())["camera"]
    assert (value["distortion_model"], value["distortion"]) == ("fisheye", FOUR)
    assert value["centre_px"] == [331.25, 238.5]


# What is refused


GOOD = {
    "image_width": 640,
    "image_height": 480,
    "camera_matrix": K.tolist(),
    "distortion_coefficients": FIVE,
}
ENTITIES = (
    '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "bb">]><opencv_storage><K>&b;</K></opencv_storage>'
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not a calibration"),
        ("[1, 2]", "not a calibration"),
        ("a: 1", "none of camera_matrix"),
        ("a: &a [*a]", "contains itself"),
        ("a: !!python/object:os.system x", "the tag"),
        ("[" * 10_000, "nested deeper"),
        ('{"K": ' + "[" * 10_000, "not JSON|nested"),
        (ENTITIES, "document type"),
        ("<a><b></a>", "not XML: mismatched tag"),
        ("<a>" * 10_000, "not XML"),
        ("1 SIMPLE_WEIRD 640 480 1 1 1", "no known model; known ones are SIMPLE_PINHOLE"),
        ("1 PINHOLE 640 480 600 600 320", "has 5 numbers instead of 6"),
        ("1 PINHOLE 640 480 600 x 320 240", "no number"),
        (
            "1 PINHOLE 640 480 600 600 320 240\n2 PINHOLE 640 480 600 600 320 240",
            "cameras 1, 2; name one",
        ),
        (KALIBR.replace("pinhole", "omni"), "camera_model is 'omni'"),
        (KALIBR.replace("equidistant", "fov"), "'fov' cannot be read"),
        (KALIBR.replace("intrinsics: [612.5", "intrinsics: [-612.5"), "a length is not above 0"),
        (KALIBR.replace("[640, 480]", "[640]"), "has 1 numbers instead of 2"),
        (KALIBR.replace("[640, 480]", "[640.5, 480]"), "640.5 x 480 is not a size"),
    ],
)
def test_what_is_no_calibration_is_refused_in_one_line(tmp_path, text, words):
    (tmp_path / "c.any").write_text(text)
    source = f"{tmp_path / 'c.any'}{'#cam1' if 'cam1' in text else ''}"
    with pytest.raises(InputError, match=words) as told:
        camera_of(source)
    assert str(told.value).startswith(str(tmp_path / "c.any"))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"camera_matrix": [[600, 3, 320], [0, 600, 240], [0, 0, 1]]}, "has a skew of 3"),
        ({"camera_matrix": [[600, 0, 320], [0, 600, 240], [0, 1, 1]]}, "is not a camera matrix"),
        ({"camera_matrix": [[600, 0], [0, 600]]}, "has 4 numbers instead of 9"),
        ({"camera_matrix": "x"}, "no number"),
        ({"camera_matrix": {"data": None}}, "has 0 numbers instead of 9"),
        ({"distortion_coefficients": [0.1, float("nan"), 0, 0, 0]}, "not finite"),
        ({"distortion_coefficients": [0.1, 1e300, 0, 0, 0]}, "1e\\+12 or larger"),
        ({"distortion_coefficients": [0.1, True, 0, 0, 0]}, "has 4 numbers instead of 5"),
        ({"distortion_coefficients": [0.1, 0, 0]}, "has 4, 5 or 8 coefficients, not 3"),
        ({"distortion_coefficients": [0.1] * 12}, "thin prisms"),
        ({"distortion_model": "thin_prism_fisheye"}, "'thin_prism_fisheye' cannot be read"),
        ({"image_width": 0}, "0 x 480 is not a size"),
        ({"ppx": -1}, "ppx: a length is not above 0"),
        ({"image_width": 200}, "centre_px: is 131.75 px outside the image"),
        ({"distortion_coefficients": [-9, 0, 0, 0, 0]}, "distortion: the distortion folds over"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(tmp_path, change, words):
    (tmp_path / "c.yaml").write_text(yaml.safe_dump({**GOOD, **change}))
    with pytest.raises(InputError, match=words) as told:
        camera_of(tmp_path / "c.yaml")
    assert "\n" not in str(told.value)


def test_a_file_without_the_image_s_size(tmp_path):
    path = cv2_file(tmp_path / "c.yaml", FIVE, size=False)
    with pytest.raises(InputError, match=r"c\.yaml does not tell the size of the image; give width_px"):
        camera_of(path)
    assert camera_of(path, width_px=640, height_px=480).width_px == 640


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"missing\.yaml: cannot be read: there is no such file"):
        camera_of(tmp_path / "missing.yaml")
    with pytest.raises(InputError, match="is a folder"):
        camera_of(tmp_path)


@given(st.data())
def test_damaged_files_end_in_an_input_error_or_a_camera(tmp_path_factory, data):
    """Bytes of a sound file of each kind are replaced, taken out and doubled."""
    folder = tmp_path_factory.mktemp("damaged")
    kind = data.draw(st.sampled_from(["yaml", "xml", "json", "kalibr", "colmap"]))
    path = folder / f"c.{kind}"
    if kind in ("kalibr", "colmap"):
        path.write_text(KALIBR if kind == "kalibr" else "1 OPENCV 640 480 600 610 331 239 0 0 0 0\n")
    else:
        cv2_file(path, FIVE)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        to = data.draw(st.integers(at, min(len(content), at + 30)))
        content[at:to] = data.draw(
            st.sampled_from(
                [b"", b"-", b"1e999", b"nan", b"[", b"&a", b"*a", b"<", b"]", b"\0", b"\xff"]
            )
        ) + data.draw(st.sampled_from([b"", bytes(content[at:to]) * 2]))
    path.write_bytes(content)
    with contextlib.suppress(InputError):
        assert camera_of(path).width_px >= 1
