"""What the annotators write of a view."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools import mask as coco
from scipy.spatial.transform import Rotation

from posse_core._interfaces.look import Look, Standpoint
from posse_core._model.mount import Mount
from posse_core._plugins.loading import Plugins

NAMES = [
    "albedo",
    "box",
    "depth",
    "keypoints",
    "mask",
    "normals",
    "optical-flow",
    "parts",
    "pose",
    "scene-flow",
]


@pytest.fixture(scope="module")
def annotate():
    """Labels of the annotator of a name, as the pipeline makes them."""
    registry = Plugins([]).registry
    annotators = {name: registry.create("annotator", name) for name in registry.names("annotator")}
    assert sorted(annotators) == NAMES

    def call(name, scene, frame, view):
        casts = SimpleNamespace(views=lambda craft: (view,))
        look = Look(Standpoint(frame, Mount(), 0, "annotator"), scene, lambda camera: casts)
        labels = annotators[name].annotate(look)
        json.dumps(dict(labels.values), allow_nan=False)
        return labels

    return call


@pytest.fixture(scope="module")
def frame(make_frame):
    return make_frame(np.array([0.0, 0, 8]), np.eye(3), np.array([0.0, 0, -1]))


@pytest.fixture(scope="module")
def view(make_view):
    part_id = np.full((6, 9), -1)
    part_id[1:4, 2:7] = 0
    part_id[3:5, 4:6] = 2
    return make_view(part_id, x0=11, y0=5, silhouette_px=38)


@given(st.integers(0, 2**32 - 1))
def test_the_box_is_the_masks(annotate, scene, frame, make_view, seed):
    rng = np.random.default_rng(seed)
    h, w = rng.integers(1, 20), rng.integers(1, 30)
    x0, y0 = int(rng.integers(30 - w + 1)), int(rng.integers(20 - h + 1))
    part_id = np.where(rng.random((h, w)) < 0.1, 0, -1)
    part_id[h // 2, w // 2] = 1
    view = make_view(part_id, x0, y0)
    box = annotate("box", scene, frame, view).values["box_visible_px"]
    mask = annotate("mask", scene, frame, view).values["mask_rle"]
    assert box == coco.toBbox(mask).tolist()
    assert all(isinstance(number, int) for number in box)


def test_boxes(annotate, scene, frame, view):
    assert annotate("box", scene, frame, view).values == {
        "box_visible_px": [13, 6, 5, 4],
        "box_whole_px": [10.75, 5.5, 3.5, 2.75],
    }


def test_mask(annotate, scene, frame, view):
    values = annotate("mask", scene, frame, view).values
    assert values["mask_area_px"] == coco.area(values["mask_rle"]) == 17
    assert values["fraction_visible"] == 17 / 38
    assert values["fraction_lit"] == (3 * 3 + 1) / 17  # columns 2, 4, 6 of the plate, 4 of the rest


def test_parts(annotate, scene, frame, view):
    labels = annotate("parts", scene, frame, view)
    assert labels.values == {"part_area_px": {"bus": 13, "panel": 0, "boom": 4}}
    assert (labels.arrays["part_id"] == view.part_id).all()
    assert labels.arrays["part_id"].dtype == np.int16


def test_depth_and_normals(annotate, scene, frame, view):
    np.testing.assert_array_equal(annotate("depth", scene, frame, view).arrays["depth_m"], view.depth_m)
    normals = annotate("normals", scene, frame, view).arrays["normal_cam"]
    np.testing.assert_array_equal(normals, view.normal_cam)


def test_keypoints_behind_the_camera_have_no_place(annotate, scene, frame, view):
    keypoints = annotate("keypoints", scene, frame, view).values["keypoints"]
    assert list(keypoints.items()) == [
        ("T1", [1.25, 2.5, 2]),
        ("S1", [-3.0, 4.0, 0]),
        ("A1", [None, None, 0]),
    ]


def test_nothing_in_the_image(annotate, scene, frame, make_view):
    nothing = make_view(np.full((0, 0), -1))
    assert annotate("box", scene, frame, nothing).values["box_visible_px"] is None
    values = annotate("mask", scene, frame, nothing).values
    assert values["mask_area_px"] == 0
    assert values["fraction_visible"] is None
    assert values["fraction_lit"] is None
    assert annotate("parts", scene, frame, nothing).values["part_area_px"] == {
        "bus": 0,
        "panel": 0,
        "boom": 0,
    }
    beyond = make_view(np.full((0, 0), -1), silhouette_px=12)
    assert annotate("mask", scene, frame, beyond).values["fraction_visible"] == 0


@given(st.integers(0, 2**32 - 1))
def test_pose(annotate, scene, make_frame, view, seed):
    rng = np.random.default_rng(seed)
    R, t, sun = Rotation.random(None, rng), rng.normal(size=3) * 50, rng.normal(size=3)
    sun /= np.linalg.norm(sun)
    values = annotate("pose", scene, make_frame(t, R.as_matrix(), sun), view).values
    w, x, y, z = values["q_cam_from_body"]
    assert w >= 0
    assert (Rotation.from_quat([x, y, z, w]) * R.inv()).magnitude() < 1e-12
    assert values["t_body_cam_m"] == t.tolist()
    assert values["range_m"] == pytest.approx(np.linalg.norm(t), rel=1e-12)
    np.testing.assert_allclose(R.apply(values["sun_direction_body"]), sun, atol=1e-12)
    cosine = -t @ sun / np.linalg.norm(t)
    assert values["phase_angle_rad"] == pytest.approx(np.arccos(cosine), abs=1e-7)


def test_phase_angle_near_opposition_keeps_its_digits(annotate, scene, make_frame, view):
    for angle in (0.0, 1e-9, np.pi - 1e-9):
        sun = np.array([np.sin(angle), 0, -np.cos(angle)])
        values = annotate("pose", scene, make_frame(np.array([0, 0, 9.0]), np.eye(3), sun), view).values
        assert values["phase_angle_rad"] == pytest.approx(angle, abs=1e-15)
