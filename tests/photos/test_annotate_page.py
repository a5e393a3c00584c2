"""The page of ``posse annotate``, driven in headless Chromium by real events."""

from __future__ import annotations

import json

import numpy as np
import pytest
from browser import opened
from scipy.spatial.transform import Rotation

LOADED = "new Promise((done) => { const wait = () => image ? done() : setTimeout(wait, 20); wait(); })"


@pytest.fixture
def page(photos, annotate):
    done = annotate()
    assert done.exit_code == 0, done.output
    return photos.folder / "annotate.html"


def window(tab, place_px):
    """Where a position of the photograph is in the window, which the page's view of it tells."""
    x, y, *_ = tab.place("#photo")
    scale, left, top = tab.tell("[screen.scale, screen.left, screen.top]")
    return x + left + scale * (place_px[0] + 0.5), y + top + scale * (place_px[1] + 0.5)


def choose(tab, name):
    rows = tab.tell(
        "[...document.querySelectorAll('#points tbody tr')].map((r) => r.cells[0].textContent)"
    )
    selector = f"#points tbody tr:nth-child({rows.index(name) + 1}) td"
    tab.tell(f"document.querySelector({json.dumps(selector)}).scrollIntoView()")
    tab.press(selector)


def saved(tab, folder):
    (folder / "points.json").unlink(missing_ok=True)
    tab.press("#save")
    for _ in range(100):
        if (folder / "points.json").exists():
            return json.loads((folder / "points.json").read_text())
        tab.tell("new Promise((done) => setTimeout(done, 50))")
    raise AssertionError("nothing was saved")


def test_points_clicked_on_photographs_become_poses(page, photos, annotate, tmp_path):
    truth, scales = photos.points(), []
    with opened(page, tmp_path) as tab:
        for photo in list(truth)[:2]:
            tab.tell(LOADED)
            assert tab.tell("document.querySelector('#photos').value") == photo
            middle = np.mean(list(truth[photo].values()), axis=0)
            tab.wheel(*window(tab, middle), -100)
            scales.append(tab.tell("screen.scale"))
            for name, place in truth[photo].items():
                choose(tab, name)
                tab.click(*window(tab, place))
            tab.key("PageDown", 34)
        value = saved(tab, tmp_path)
        assert tab.errors == []
    assert value["spacecraft"] == "craft"
    assert list(value["photos"]) == list(truth)[:2]
    for (photo, points), scale in zip(value["photos"].items(), scales, strict=True):
        assert set(points) == set(truth[photo])
        for name, place in points.items():
            # Within the pixel of the screen.
            assert np.abs(np.subtract(place, truth[photo][name])).max() < 0.5 / scale + 0.01
    done = annotate("--points", tmp_path / "points.json", "--sigma-px", 0.3)
    assert done.exit_code == 0, (done.output, done.exception)
    for record in json.loads((photos.folder / "labelled" / "poses.json").read_text()):
        line = photos.labels[record["filename"].removeprefix("images/")]
        (w, x, y, z), (a, b, c, d) = record["q_cam_from_body"], line["q_cam_from_body"]
        turn = Rotation.from_quat([x, y, z, w]) * Rotation.from_quat([b, c, d, a]).inv()
        assert turn.magnitude() < np.radians(1.0)
        assert record["t_body_cam_m"] == pytest.approx(line["t_body_cam_m"], rel=0.01, abs=0.02)


def test_a_keypoint_is_chosen_on_the_mesh_moved_by_keys_and_removed(page, photos, tmp_path):
    name = list(photos.points()["000000.png"])[3]
    with opened(page, tmp_path) as tab:
        tab.tell(LOADED)
        x, y, *_ = tab.place("#mesh")
        u, v = tab.tell(f"view.toCanvas(view.keypoints.get({json.dumps(name)}))")
        tab.click(x + u, y + v)
        assert tab.tell("chosen") == name
        tab.click(*window(tab, (400, 300)))
        assert tab.tell("chosen") != name  # the next one's turn
        choose(tab, name)
        scale = tab.tell("screen.scale")
        before = saved(tab, tmp_path)["photos"]["000000.png"][name]
        for _ in range(3):
            tab.key("ArrowRight", 39)
        tab.key("ArrowUp", 38)
        after = saved(tab, tmp_path)["photos"]["000000.png"][name]
        assert np.subtract(after, before) == pytest.approx([3 / scale, -1 / scale], abs=0.03)
        tab.click(*window(tab, (-20, 300)))  # beside the photograph
        assert saved(tab, tmp_path)["photos"]["000000.png"][name] == after
        tab.key("Delete", 46)
        assert saved(tab, tmp_path)["photos"] == {}
        assert tab.errors == []


def test_saved_points_are_opened_again(page, photos, write_points, tmp_path):
    points = photos.points()
    path = write_points(points)
    (tmp_path / "other").mkdir()
    with opened(page, tmp_path / "other") as tab:
        tab.tell(LOADED)
        document = tab.send("DOM.getDocument")["root"]["nodeId"]
        node = tab.send("DOM.querySelector", nodeId=document, selector="#file")["nodeId"]
        tab.send("DOM.setFileInputFiles", nodeId=node, files=[str(path)])
        tab.tell("new Promise((done) => setTimeout(done, 200))")
        value = saved(tab, tmp_path / "other")
        wrong = path.with_name("wrong.json")
        wrong.write_text(json.dumps({"spacecraft": "another", "photos": {}}))
        tab.send("DOM.setFileInputFiles", nodeId=node, files=[str(wrong)])
        tab.tell("new Promise((done) => setTimeout(done, 200))")
        assert "another" in tab.tell("document.querySelector('#saved').textContent")
        assert tab.errors == []
    assert value["photos"] == points


def test_without_the_photographs_beside_it_the_page_says_so(page, photos, tmp_path):
    (photos.folder / "000000.png").unlink()
    with opened(page, tmp_path) as tab:
        tab.tell("new Promise((done) => setTimeout(done, 300))")
        assert "000000.png is not beside this page" in tab.tell(
            "document.querySelector('#note').textContent"
        )
