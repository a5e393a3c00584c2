"""``posse preview``: its picture shows the labels where they are, and its file replaces only its own."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from command import run_posse
from PIL import Image
from scipy.spatial.transform import Rotation
from small_run import BOX_OBJ, SCENARIO

import posse_core
from posse_core._plugins.loading import load_plugins
from posse_core._view.frame_picture import BESIDE, KEYPOINT, SUN, VISIBLE_BOX, facts

SMALL = SCENARIO.replace("seconds: 0.05", "seconds: 0")
AQUA = SMALL.replace(
    'target: {mesh: box.obj, scale_m_per_unit: 1.0, body_axes: "x y z"}', "target: {name: aqua}"
).replace("[0, 0, 6, 0, 6, 0]", "[0, 0, 30, 0, 30, 0]")
LENS = [-0.15, 0.02, 0.001, 0.0, 0.0]


@pytest.fixture(scope="module", autouse=True)
def flat(flat_renderer_path):
    """The flat renderer among the plugins of this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(flat_renderer_path)
        load_plugins.cache_clear()
        yield
    load_plugins.cache_clear()


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in (("box.obj", BOX_OBJ), ("small.yaml", SMALL), ("aqua.yaml", AQUA)):
        Path(name).write_text(text)
    return tmp_path


def preview(*words: object) -> tuple[int, str, str]:
    return run_posse("preview", *words)


def picture(name: str = "preview.png") -> np.ndarray:
    """(H, W, 3) red-green-blue, by Pillow."""
    with Image.open(name) as image:
        return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize("lens", [None, LENS], ids=["pinhole", "lens"])
def test_keypoints_and_the_sun_are_where_the_labels_say(lens):
    given = {"camera.distortion": lens} if lens else {}
    words = [w for k, v in given.items() for w in ("-o", f"{k}={json.dumps(v)}")]
    code, _, error = preview("aqua.yaml", "--frame", 2, "--renderer", "flat", *words)
    assert code == 0, error
    shown = picture()
    with posse_core.open("aqua.yaml", renderer="flat", overrides=given) as sim:
        labels, camera = sim.frame(sim.state(2)).labels, sim.camera
        low, high = sim.spacecraft.bounds_body_m
        points = sim.spacecraft.keypoints_body_m
    rotation = Rotation.from_quat(labels.q_cam_from_body, scalar_first=True)

    def at(x_body_m):
        """Position in the picture, by OpenCV; an image of 64 × 48 pixels is enlarged 15 times."""
        coefficients = camera.distortion_coefficients
        pose = rotation.as_rotvec(), np.array(labels.t_body_cam_m)
        found, _ = cv2.projectPoints(np.array([x_body_m]), *pose, camera.matrix, coefficients)
        return 15 * found.ravel() + 7

    def colour(uv):
        u, v = np.round(uv).astype(int)
        return tuple(shown[v, u].tolist())

    seen = {name for name, keypoint in labels.keypoints.items() if keypoint.visibility == 2}
    hidden = {name for name, keypoint in labels.keypoints.items() if keypoint.visibility == 1}
    assert len(seen) > 3
    assert hidden
    for name in seen:
        assert colour(at(points[name])) == KEYPOINT, name
    for name in hidden:  # a ring: some pixel around the position, at the radius of four pixels
        assert KEYPOINT in {colour(at(points[name]) + d) for d in ((4, 0), (-4, 0), (0, 4), (0, -4))}
    length_m = 1.5 * min(float((high - low).max()) / 2, labels.range_m / 2)
    sun = length_m * np.array(labels.sun_direction_body)
    start, tip = at(np.zeros(3)), at(sun)
    assert np.linalg.norm(tip - start) > 40

    def off_sun(share):
        """How far the colour at a share of the arrow is from the arrow's; its edges are smooth."""
        return np.abs(np.subtract(colour(start + share * (tip - start)), SUN)).max()

    assert max(map(off_sun, np.linspace(0.6, 0.95, 15))) < 40
    assert min(map(off_sun, (-0.8, -0.5))) > 80


def test_every_body_has_its_box_axes_and_joints():
    """A CubeSat and an arm beside the target, each in a colour of its own."""
    company = """
bodies:
  inspector: {spacecraft: {name: cubesat}, relative: {roe_m: [0, 0.5, 27, 0, 27, 0]}}
  gripper:
    spacecraft: {name: arm}
    mount: {position_m: [0.4, 0.3, 1.2]}
    joints: {elbow: {law: fixed, value_deg: 30}}
"""
    Path("company.yaml").write_text(AQUA + company)
    size = {"camera.width_px": 320, "camera.height_px": 240}
    words = [word for key, value in size.items() for word in ("-o", f"{key}={value}")]
    code, _, error = preview("company.yaml", "--renderer", "flat", *words)
    assert code == 0, error
    shown = picture()
    with posse_core.open("company.yaml", renderer="flat", overrides=size) as sim:
        frame = sim.frame(sim.state(0))
    labels = frame.labels
    boxes = [body.box_visible_px for body in labels.instances.values()]
    assert None not in boxes
    for box, colour in zip(boxes, (VISIBLE_BOX, *BESIDE), strict=False):
        x, y, width, height = (3 * side for side in box)
        u, v = np.arange(x + 2, x + width - 2), np.arange(y + 2, y + height - 2)
        sides = [shown[v, x], shown[v, x + width - 1], shown[y, u], shown[y + height - 1, u]]
        drawn = np.concatenate([(side == colour).all(axis=-1) for side in sides])
        assert drawn.mean() > 0.3  # other boxes, arrows and names lie over it
    (row,) = (row for row in facts(frame, "flat", auto_exposure=False) if row[0] == "gripper (arm)")
    assert "joint elbow 30.00 deg" in row


def test_nothing_else_is_written_and_the_last_preview_is_replaced(folder):
    before = {path.name for path in folder.iterdir()}
    for words in ((), ("--frame", 3)):
        code, said, error = preview("small.yaml", "--renderer", "flat", *words)
        assert (code, error) == (0, "")
        assert said.startswith("preview.png: frame ")
        assert said.rstrip().endswith("rendered by flat")
    assert {path.name for path in folder.iterdir()} - before == {"preview.png"}
    with Image.open("preview.png") as image:
        assert image.info["Software"] == "posse preview"


def test_a_file_of_the_users_is_replaced_only_by_its_name():
    mine = Path("preview.png")
    Image.new("L", (4, 4)).save(mine)
    content = mine.read_bytes()
    code, _, error = preview("small.yaml", "--renderer", "flat")
    assert code == 2
    assert error == "posse: preview.png: is not an earlier preview; name it by --out to replace it\n"
    assert mine.read_bytes() == content
    assert preview("small.yaml", "--renderer", "flat", "--out", mine)[0] == 0
    assert picture().shape[1] == 960


def test_a_renderer_of_the_users_stays():
    """With -o for the renderer, raster does not take its place."""
    code, said, error = preview("small.yaml", "-o", "renderer.radiance_w_m2_sr=1")
    assert code == 0, error
    assert said.rstrip().endswith("rendered by flat")


def test_a_time_is_previewed():
    code, said, error = preview("small.yaml", "--renderer", "flat", "--time", 12.5)
    assert code == 0, error
    assert "at t = 12.5 s" in said


def test_sensors_with_an_image_stand_beside_the_cameras():
    stereo = "-o", "sensors.right={type: stereo, baseline_m: 0.2}"
    lidar = "-o", "sensors.scanner={type: lidar, pattern: {shape: raster, columns: 4, rows: 3}}"
    code, _, error = preview("small.yaml", "--renderer", "flat", *lidar, "--out", "lidar.png")
    assert code == 0, error
    assert picture("lidar.png").shape[1] == 960  # only named
    code, _, error = preview("small.yaml", "--renderer", "flat", *lidar, *stereo, "--out", "both.png")
    assert code == 0, error
    both = picture("both.png")
    assert both.shape[1] == 960 + 320
    assert both[30:240, 960:].max() > 0
    assert both[240:720, 960:].max() == 0  # 320 × 240, with nothing below


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nowhere",), "no scenario named 'nowhere'"),
        (("small.yaml", "--frame", 99, "--renderer", "flat"), "99"),
        (("small.yaml", "--frame", -1), "--frame"),
        (("small.yaml", "--frame", 1, "--time", 3), "leave one of them out"),
        (("small.yaml", "--time", "nan"), "--time nan: give a number of seconds"),
        (("small.yaml", "--renderer", "flt"), "did you mean 'flat'?"),
        (("small.yaml", "--out", "p.jpg"), "--out p.jpg: the file's name must end in .png"),
        (("small.yaml", "--out", "none/p.png"), "--out none/p.png: there is no folder none"),
        (("small.yaml", "-o", "camera.width=3"), "option camera.width"),
    ],
)
def test_bad_input_is_said_in_one_line(words, said, folder):
    before = set(folder.iterdir())
    code, out, error = preview(*words)
    assert (code, out) == (2, "")
    (line,) = error.splitlines()
    assert said in line
    assert set(folder.iterdir()) == before


def test_a_renderer_that_fails_ends_with_code_3(monkeypatch, folder):
    monkeypatch.setenv("FLAT_RAISE", "0")
    code, _, error = preview("small.yaml", "--renderer", "flat")
    assert code == 3
    (line,) = error.splitlines()
    assert line == "posse: renderer 'flat' failed: RuntimeError: the lamp is broken"
    assert not (folder / "preview.png").exists()
