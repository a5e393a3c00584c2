"""What ``posse view`` writes, read without a browser."""

import base64
import json
import re
from html.parser import HTMLParser

import cuboid
import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._files.trajectory import load_trajectory

MIB = 2**20


class Blocks(HTMLParser):
    """Text of a page's script elements by id, and every address that the page names."""

    def __init__(self, text):
        super().__init__()
        self.by_id, self.addresses, self.scripts, self._id = {}, [], 0, None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        names = dict(attributes)
        self._id = names.get("id") if tag == "script" else None
        self.scripts += tag == "script"
        self.addresses += [names[key] for key in ("src", "href", "action") if key in names]

    def handle_data(self, data):
        if self._id:
            self.by_id[self._id] = self.by_id.get(self._id, "") + data

    def handle_endtag(self, tag):
        self._id = None

    def frame(self, index):
        return json.loads(self.by_id[f"frame-{index}"])


def parsed(page):
    return Blocks(page.read_text())


@pytest.fixture(scope="module")
def page(view, two_crafts, tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "page.html"
    result = view(two_crafts, "--out", out)
    assert result.exit_code == 0, result.output
    assert re.search(r": 12 frames, 12 with a preview, 0\.\d MiB\n$", result.stdout)
    return parsed(out)


def test_each_frame_has_its_labels(page, two_crafts):
    for labels in cuboid.read_lines(two_crafts):
        kept = {key: value for key, value in labels.items() if key != "part_area_px"}
        assert page.frame(labels["index"])["labels"] == kept


def test_columns_are_those_of_the_labels(page, two_crafts):
    columns = json.loads(page.by_id["dataset"])["columns"]
    for place, labels in enumerate(cuboid.read_lines(two_crafts)):
        for name in ("index", "sequence", "spacecraft", "range_m", "phase_angle_rad", "fraction_lit"):
            assert columns[name][place] == labels[name]
        seen = [point[2] for point in labels["keypoints"].values()].count(2)
        assert columns["keypoints_visible"][place] == seen


def test_directions_follow_from_the_pose(page, two_crafts):
    columns = json.loads(page.by_id["dataset"])["columns"]
    trajectory = load_trajectory(two_crafts / "trajectory.npz")
    for place, labels in enumerate(cuboid.read_lines(two_crafts)):
        w, x, y, z = labels["q_cam_from_body"]
        t = np.array(labels["t_body_cam_m"])
        camera_body = Rotation.from_quat([x, y, z, w]).inv().apply(-t)
        assert columns["view_body"][place] == pytest.approx(camera_body / np.linalg.norm(t), abs=1e-6)
        assert columns["sun_body"][place] == pytest.approx(cuboid.SUN_BODY, abs=1e-6)
        assert columns["r_chaser_rtn_m"][place] == pytest.approx(
            trajectory.r_chaser_rtn_m[place], abs=1e-6
        )
        # Camera and Sun are as far apart in RTN as in the body: the phase angle.
        cosine = np.dot(columns["sun_rtn"][place], columns["r_chaser_rtn_m"][place]) / np.linalg.norm(t)
        assert np.arccos(cosine) == pytest.approx(labels["phase_angle_rad"], abs=1e-5)
        r, v = trajectory.r_target_eci_m[place], trajectory.v_target_eci_m_s[place]
        sun = trajectory.r_sun_eci_m[place] - r
        outward = sun @ r / np.linalg.norm(sun) / np.linalg.norm(r)
        normal = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
        expected = [outward, columns["sun_rtn"][place][1], sun @ normal / np.linalg.norm(sun)]
        assert columns["sun_rtn"][place] == pytest.approx(expected, abs=1e-6)


def test_previews_are_the_images_and_depths(page, two_crafts):
    dataset = Dataset(two_crafts)
    for index in range(12):
        preview = page.frame(index)["preview"]
        jpeg = np.frombuffer(base64.b64decode(preview["jpeg"]), np.uint8)
        image = cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE).astype(float)
        assert np.abs(image - dataset.image(index)).mean() < 6
        depth_m = dataset.truth(index)["depth_m"]
        if not np.isfinite(depth_m).any():
            assert preview["depth"] is None
            continue
        png = np.frombuffer(base64.b64decode(preview["depth"]["png"]), np.uint8)
        steps = cv2.imdecode(png, cv2.IMREAD_UNCHANGED)
        x, y, w, h = preview["depth"]["box"]
        assert [x, y, w, h] == list(dataset[index].box_visible_px)
        crop = depth_m[y : y + h, x : x + w]
        assert np.array_equal(steps > 0, np.isfinite(crop))
        near_m, far_m = preview["depth"]["low"], preview["depth"]["high"]
        decoded = near_m + (steps - 1.0) / 254 * (far_m - near_m)
        np.testing.assert_allclose(
            decoded[steps > 0], crop[steps > 0], atol=(far_m - near_m) / 508 + 1e-5
        )


def test_nothing_is_fetched(page, view, two_crafts, tmp_path):
    assert page.addresses == []
    view(two_crafts, "--out", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert not re.search(r"https?:|//\w+\.\w|@import|url\(|fetch\(|XMLHttpRequest", text)
    assert "default-src 'none'" in text


def test_text_of_labels_stays_text(view, tmp_path):
    folder = cuboid.write_dataset(tmp_path / "d")
    lines = cuboid.read_lines(folder)
    lines[2]["remark"] = {"text": "</script><script>alert(1)</script><!--<script>"}
    cuboid.write_lines(folder, lines)
    assert view(folder).exit_code == 0
    page = parsed(folder / "view.html")
    assert page.frame(2)["labels"]["remark"] == lines[2]["remark"]
    assert page.frame(5)["labels"]["index"] == 5
    assert page.scripts == 6 + 2  # the frames, the dataset, the page's own


def test_sixteen_bit_colour_and_missing_labels(view, tmp_path):
    folder = cuboid.write_dataset(tmp_path / "d")
    lines = cuboid.read_lines(folder)
    for labels in lines:
        for key in ("keypoints", "fraction_lit", "mask_rle", "box_visible_px", "range_m"):
            del labels[key]
        labels["truth"] = None
    image = np.zeros((120, 160, 3), np.uint16)
    image[..., 2] = 65535  # red, as OpenCV orders colours
    cv2.imwrite(str(folder / lines[0]["image"]), image)
    cuboid.write_lines(folder, lines)
    assert view(folder).exit_code == 0
    page = parsed(folder / "view.html")
    columns = json.loads(page.by_id["dataset"])["columns"]
    assert columns["range_m"] == columns["keypoints_visible"] == [None] * 6
    preview = page.frame(0)["preview"]
    jpeg = np.frombuffer(base64.b64decode(preview["jpeg"]), np.uint8)
    assert cv2.imdecode(jpeg, cv2.IMREAD_COLOR)[60, 80] == pytest.approx([0, 0, 254], abs=3)
    assert preview["depth"] is None


def test_the_page_keeps_within_its_size(view, tmp_path):
    folder = cuboid.repeat(cuboid.write_dataset(tmp_path / "d"), 120)
    whole = view(folder, "--out", tmp_path / "whole.html")
    assert "120 frames, 120 with a preview" in whole.stdout
    limit = (tmp_path / "whole.html").stat().st_size * 0.7
    result = view(folder, "--max-mib", limit / MIB)
    assert result.exit_code == 0, result.output
    assert (folder / "view.html").stat().st_size <= limit
    page = parsed(folder / "view.html")
    have = [index for index in range(120) if page.frame(index)["preview"]]
    assert f"120 frames, {len(have)} with a preview" in result.stdout
    assert 10 < len(have) < 120
    assert np.diff([-1, *have, 120]).max() <= 2 * 120 / len(have)  # they are spread over all
    refused = view(folder, "--out", tmp_path / "none.html", "--max-mib", 0.1)
    assert isinstance(refused.exception, InputError)
    assert "--frames" in str(refused.exception)
    assert not (tmp_path / "none.html").exists()


def test_fewer_frames_evenly(view, tmp_path):
    folder = cuboid.repeat(cuboid.write_dataset(tmp_path / "d"), 61)
    assert view(folder, "--frames", 4).exit_code == 0
    page = parsed(folder / "view.html")
    dataset = json.loads(page.by_id["dataset"])
    assert dataset["columns"]["index"] == [0, 20, 40, 60]
    assert dataset["frames"] == 61
    assert sorted(name for name in page.by_id if name.startswith("frame-")) == sorted(
        f"frame-{index}" for index in (0, 20, 40, 60)
    )


def test_a_run_that_has_not_ended_is_shown(view, tmp_path):
    folder = cuboid.write_dataset(tmp_path / "d")
    (folder / "manifest.json").unlink()
    assert view(folder).exit_code == 0
    assert json.loads(parsed(folder / "view.html").by_id["dataset"])["manifest"] is None


@pytest.mark.parametrize("lines", [0, 7])
def test_a_dataset_that_cannot_be_shown_is_named(view, tmp_path, lines):
    folder = cuboid.write_dataset(tmp_path / "d")
    rows = cuboid.read_lines(folder)
    cuboid.write_lines(folder, [*rows, {**rows[0], "index": 6}] if lines else [], frames=lines)
    result = view(folder)
    assert isinstance(result.exception, InputError)
    assert not (folder / "view.html").exists()


def test_a_page_that_cannot_be_written_is_named(view, two_crafts, tmp_path):
    for out in (tmp_path / "no/page.html", tmp_path):
        result = view(two_crafts, "--out", out)
        assert isinstance(result.exception, InputError)
        assert str(out) in str(result.exception)
