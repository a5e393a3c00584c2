"""The page in headless Chromium: what it draws and does, against labels, SciPy and pycocotools."""

import json
import re
import shutil

import cuboid
import numpy as np
import pytest
from by_opencv import projected_px
from pycocotools import mask as coco_mask
from scipy.spatial.transform import Rotation

from posse_core._dataset.camera import read_camera

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

TELL = """
    told.masks = columns.index.map((_, place) => decodeMask(frameAt(place).labels.mask_rle).join(""));
    told.axes = columns.index.map((_, place) => bodyAxes(frameAt(place).labels));
    told.passing = passing({range_m: [9, 12], keypoints_visible: [4, 8]}, new Set(["plate"]));
    told.maps = columns.view_body.map(hammer);
    told.loaded = [picture.image.naturalWidth, byId("note").textContent, location.hash];
    setFilter("range_m", [0, 11]);
    told.filtered = [byId("summary").textContent, state.kept];
    byId("next").click(); byId("next").click();
    told.stepped = [state.current, byId("go").value, byId("facts").textContent];
"""

# Canvas pixels are image pixels: the stage is as large as the image, and only one thing is drawn.
DRAWN = """
    Object.assign(picture.canvas.style, {width: "160px", height: "120px"});
    const ground = "7,9,11,255";
    const drawn = (name) => {
      picture.shown = new Set([name]);
      picture.image = null;
      picture.draw();
      const data = picture.canvas.getContext("2d").getImageData(0, 0, 160, 120).data, pixels = [];
      for (let i = 0; i < data.length; i += 4)
        pixels.push(String(data.slice(i, i + 4)) === ground ? 0 : 1);
      return pixels.join("");
    };
    for (const name of ["mask", "depth", "box", "keypoints"]) told[name] = drawn(name);
    told.scale = picture.canvas.width;
"""


def bits(text):
    return np.array(list(text), dtype=np.uint8).reshape(120, 160)


@pytest.fixture(scope="module")
def told(browse, view, two_crafts):
    assert view(two_crafts).exit_code == 0
    return browse(two_crafts / "view.html", TELL)


@pytest.fixture(scope="module")
def lines(two_crafts):
    return cuboid.read_lines(two_crafts)


def test_masks_are_decoded_as_pycocotools_does(told, lines):
    assert told["errors"] == []
    for text, labels in zip(told["masks"], lines, strict=True):
        assert np.array_equal(bits(text), coco_mask.decode(labels["mask_rle"]))


def test_body_axes_are_where_the_pose_puts_them(told, lines):
    K = cuboid.CAMERA.matrix
    for axes, labels in zip(told["axes"], lines, strict=True):
        w, x, y, z = labels["q_cam_from_body"]
        size = 2 * cuboid.HALF.max() * (1.4 if labels["spacecraft"] == "plate" else 1)
        tips = np.vstack([np.zeros(3), np.eye(3)]) * size / 2
        x_cam = Rotation.from_quat([x, y, z, w]).apply(tips) + labels["t_body_cam_m"]
        expected = (x_cam / x_cam[:, 2:]) @ K[:2].T
        assert np.array(axes) == pytest.approx(expected, abs=1e-6)


def test_filters_keep_what_the_labels_say(told, lines):
    seen = [[p[2] for p in labels["keypoints"].values()].count(2) for labels in lines]
    expected = [
        place
        for place, labels in enumerate(lines)
        if 9 <= labels["range_m"] <= 12 and 4 <= seen[place] <= 8 and labels["spacecraft"] == "plate"
    ]
    assert told["passing"] == expected
    near = [place for place, labels in enumerate(lines) if labels["range_m"] <= 11]
    assert 0 < len(near) < 12
    assert told["filtered"] == [f"{len(near)} of 12 frames", near]
    current, number, facts = told["stepped"]
    assert current == near[2]
    assert number == str(lines[near[2]]["index"])
    assert f"{lines[near[2]]['range_m']:.3f} m" in facts


def test_the_map_of_directions_keeps_areas(told, lines):
    for (x, y), labels in zip(told["maps"], lines, strict=True):
        w, qx, qy, qz = labels["q_cam_from_body"]
        direction = Rotation.from_quat([qx, qy, qz, w]).inv().apply(-np.array(labels["t_body_cam_m"]))
        direction /= np.linalg.norm(direction)
        # Hammer: Lambert's azimuthal equal-area map of half the longitude, twice as wide.
        half, z = np.arctan2(direction[1], direction[0]) / 2, direction[2]
        cos = np.sqrt(1 - z**2)
        halved = np.array([cos * np.cos(half), cos * np.sin(half), z])
        away = np.arccos(halved[0])
        assert np.hypot(x / 2, y) == pytest.approx(2 * np.sin(away / 2), abs=1e-5)
        assert x / 2 * halved[2] == pytest.approx(y * halved[1], abs=1e-5)


def test_the_image_itself_is_shown_where_it_is_beside_the_page(told):
    assert told["loaded"] == [160, "", "#frame=0"]


def test_overlays_cover_the_labelled_pixels(browse, view, two_crafts, lines, tmp_path):
    page = tmp_path / "page.html"
    assert view(two_crafts, "--out", page).exit_code == 0
    text = page.read_text()
    folder = json.loads(text.split('id="dataset">')[1].split("</script>")[0])["folder"]
    page.write_text(text.replace(json.dumps(folder), '"elsewhere/"'))
    told = browse(page, DRAWN + "told.note = byId('note').textContent;")
    assert told["errors"] == []
    assert told["note"].startswith("preview;")
    assert told["scale"] == 160
    labels = lines[0]
    mask = coco_mask.decode(labels["mask_rle"])
    assert np.array_equal(bits(told["mask"]), mask)
    assert np.array_equal(bits(told["depth"]), mask)
    x, y, w, h = labels["box_visible_px"]
    box = bits(told["box"])
    inner = box[y + 2 : y + h - 2, x + 2 : x + w - 2]
    assert not inner.any()
    rows, columns = np.nonzero(box)
    assert [columns.min(), rows.min(), columns.max(), rows.max()] == [x - 1, y - 1, x + w, y + h]
    dots = bits(told["keypoints"])
    for u, v, visibility in labels["keypoints"].values():
        assert visibility == 0 or dots[round(v) - 3 : round(v) + 4, round(u) - 3 : round(u) + 4].any()


def test_without_image_and_preview_it_says_so(browse, view, tmp_path):
    folder = cuboid.write_dataset(tmp_path / "d")
    page = folder / "view.html"
    assert view(folder).exit_code == 0
    shutil.rmtree(folder / "images")
    page.write_text(re.sub(r'"preview":\{.*\}</script>', '"preview":null}</script>', page.read_text()))
    told = browse(
        page, "told.note = byId('note').textContent; picture.shown.add('depth'); picture.draw();"
    )
    assert told == {
        "errors": [],
        "note": "the image is not beside this page, and the page has no preview of it",
    }


def test_a_long_list_holds_only_what_is_seen(browse, view, tmp_path):
    folder = cuboid.repeat(cuboid.write_dataset(tmp_path / "d"), 300)
    assert view(folder).exit_code == 0
    told = browse(
        folder / "view.html",
        """
        told.kept = state.kept.length;
        drawStrip();
        told.small = byId("belt").children.length;
        byId("strip").scrollLeft = 1e9;
        drawStrip();
        told.then = [...byId("belt").children].map((thumb) => thumb.textContent);
        """,
    )
    assert told["errors"] == []
    assert told["kept"] == 300
    assert 3 < told["small"] < 30
    assert 3 < len(told["then"]) < 30
    assert told["then"][-1] == "299"


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("brown-conrady", [-0.2, 0, 0.01, -0.01, 0]),
        ("brown-conrady", [0.3, -0.1, 0.001, -0.002, 0.02, 0.5, 0.1, -0.02]),
        ("fisheye", [-0.02, 0.01, -0.003, 0.0005]),
    ],
)
def test_body_axes_follow_the_lens(browse, view, two_crafts, lines, tmp_path, model, coefficients):
    """By OpenCV; the pose is the labels', whose keypoints are a pinhole's."""
    shutil.copytree(two_crafts, tmp_path / "d")
    value = json.loads((tmp_path / "d/camera.json").read_text())
    value["distModel"], value["distCoeffs"] = model, coefficients
    (tmp_path / "d/camera.json").write_text(json.dumps(value))
    assert view(tmp_path / "d").exit_code == 0
    told = browse(
        tmp_path / "d/view.html",
        "told.axes = columns.index.map((_, place) => bodyAxes(frameAt(place).labels));",
    )
    camera = read_camera(tmp_path / "d/camera.json")
    for axes, labels in zip(told["axes"], lines, strict=True):
        w, x, y, z = labels["q_cam_from_body"]
        size = 2 * cuboid.HALF.max() * (1.4 if labels["spacecraft"] == "plate" else 1)
        tips = np.vstack([np.zeros(3), np.eye(3)]) * size / 2
        x_cam = Rotation.from_quat([x, y, z, w]).apply(tips) + labels["t_body_cam_m"]
        expected = projected_px(camera, x_cam)
        reached = np.hypot(*(x_cam[:, :2] / x_cam[:, 2:]).T) < camera.distortion.reach
        assert [tip is not None for tip in axes] == (reached & (x_cam[:, 2] > 0)).tolist()
        drawn = np.array([tip for tip in axes if tip is not None]).reshape(-1, 2)
        assert drawn == pytest.approx(expected[reached], abs=1e-6)
