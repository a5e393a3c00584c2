"""Frames that show several craft: each is learned, by its own box and its own keypoints."""

import json

import company
import numpy as np
import pytest
import torch

from posse_core import Dataset, ModelCard, seen_bodies, true_boxes
from posse_detect_torch import PoseDataset
from posse_detect_torch.heatmap_finder import HeatmapLesson
from posse_detect_torch.nano_detector import NanoLesson
from posse_detect_torch.options import HeatmapOptions, NanoOptions
from posse_detect_torch.sdn_detector import proposal_recall

SIZE = 64
SCALE = SIZE / company.CAMERA.width_px


@pytest.fixture(scope="module")
def dataset(tmp_path_factory, posse):
    folder = company.write_dataset(tmp_path_factory.mktemp("company") / "d", frames=16)
    code, _, error = posse("partition", folder)
    assert code == 0, error
    return Dataset(folder)


def card_of(dataset, task):
    return ModelCard.of_dataset(dataset, net="", task=task, input_px=SIZE, version="")


def test_all_bodies_of_a_frame_are_in_its_sample(dataset, tmp_path):
    options = NanoOptions(input_px=SIZE, augment=False)
    lesson = NanoLesson(dataset, tmp_path, card_of(dataset, "boxes").classes, options)
    most = max(len(seen_bodies(dataset[i])) for i in dataset.part("train"))
    assert most == 3
    for position, index in enumerate(dataset.part("train")):
        sample = lesson.sample(position, np.random.default_rng(0))
        assert sample["boxes"].shape == (most, 4)
        truths = true_boxes(dataset[index])
        assert sample["labels"].tolist() == [
            *(lesson.classes.index(truth.label) for truth in truths),
            *[-1] * (most - len(truths)),
        ]
        above_px = (company.CAMERA.width_px - company.CAMERA.height_px) / 2  # the square is padded
        for box, truth in zip(sample["boxes"], truths, strict=False):
            x, y, width, height = truth.box_px
            corners = np.array([x, y + above_px, x + width, y + above_px + height])
            np.testing.assert_allclose(box, SCALE * corners, atol=1e-4)


def test_each_body_has_a_square_and_keypoints_of_its_own(dataset, tmp_path):
    card = card_of(dataset, "keypoints")
    options = HeatmapOptions(input_px=SIZE, augment=False)
    lesson = HeatmapLesson(dataset, tmp_path, card, options)
    bodies = [body for i in dataset.part("train") for body in seen_bodies(dataset[i]).values()]
    assert len(lesson) == len(bodies)
    for position, body in enumerate(bodies):
        sample = lesson.sample(position, np.random.default_rng(0))
        mine = card.keypoint_outputs[body.spacecraft]
        known = sample["weights"] > 0
        assert not known[: mine.start].any()
        assert not known[mine.stop :].any()
        # The square keeps angles and proportions: any two points are as far apart, up to one scale.
        found = sample["points"][mine][known[mine]]
        true = np.array([p[:2] for p in body.keypoints.values()])[known[mine]]
        apart, apart_px = found - found[0], true - true[0]
        scale = np.linalg.norm(apart) / np.linalg.norm(apart_px)
        assert scale == pytest.approx(SIZE / (1.3 * max(body.box_visible_px[2:])), rel=0.05)
        np.testing.assert_allclose(apart, scale * apart_px, atol=1e-3)


def test_a_net_is_trained_and_judged_on_them(dataset, posse, tmp_path):
    """By the commands; that it learns is the concern of the test of one craft."""
    small = ("-o", f"input_px={SIZE}", "-o", "epochs=1", "-o", "batch=4")
    models = {}
    for detector in ("nano", "heatmap"):
        out = tmp_path / detector
        code, told, error = posse("train", dataset.folder, "--detector", detector, "--out", out, *small)
        assert code == 0, error
        models[detector] = told.strip()
    code, out, error = posse(
        *("eval", dataset.folder, "--part", "all", "--json"),
        *("--model", models["nano"], "--keypoints", models["heatmap"]),
    )
    assert code == 0, error
    metrics = json.loads(out)["groups"][0]["metrics"]
    assert {"AP.plate", "AP.winged", "poses estimated"} <= metrics.keys()


def test_recall_of_proposals_is_over_all_boxes():
    boxes = torch.tensor([[0.0, 0, 10, 10], [20, 20, 30, 30], [40, 0, 50, 10]])
    found = [torch.cat([boxes[:1], boxes[:1] + 100]), boxes[1:] + 1]
    recall = proposal_recall(found, [boxes[:2], boxes[2:]])
    assert recall == {"AR100": pytest.approx(2 / 3), "AR1k": pytest.approx(2 / 3)}
    assert proposal_recall([boxes], [boxes[:0]])["AR100"] == 0


def test_a_pose_sample_is_of_the_target_alone(dataset):
    samples = PoseDataset(dataset.folder, "all")
    for sample, line in zip(samples, dataset, strict=True):
        assert samples.classes[int(sample.label)] == "winged"
        box = line.box_visible_px
        assert sample.box_px.isnan().all() if box is None else sample.box_px.tolist() == list(box)
