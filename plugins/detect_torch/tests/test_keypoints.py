"""Keypoints: decoding and loss by closed forms; from image to pose by the commands."""

import json

import cv2
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from posse_core import Dataset, Detection, InputError, ModelCard, true_boxes
from posse_detect_onnx.models import OnnxKeypoints
from posse_detect_onnx.options import OnnxOptions
from posse_detect_torch.checkpoint import read_like, write_model
from posse_detect_torch.nano import STRIDE, Nano
from posse_detect_torch.options import SimccOptions
from posse_detect_torch.simcc import SPREAD, Decoded, SimCC, losses, steps
from posse_detect_torch.simcc_finder import SimccFinder


def test_it_is_light():
    net = SimCC(22).eval()
    assert sum(p.numel() for p in net.parameters()) <= 2e6
    with FlopCounterMode(display=False) as counter, torch.no_grad():
        net(torch.zeros(1, 1, 256, 256))
    assert counter.get_total_flops() / 2 <= 0.5e9


def test_steps_cover_the_square():
    at = steps(4, torch.device("cpu"))
    assert at[0] - STRIDE / 2 == -0.5
    assert at[-1] + STRIDE / 2 == 4 * STRIDE - 0.5


class Told(nn.Module):
    def __init__(self, mean, sigma):
        super().__init__()
        at = steps(20, torch.device("cpu"))
        self.logits = tuple(-(((at - m) / sigma) ** 2)[None, None] / 2 for m in mean)

    def forward(self, picture):
        return self.logits


@pytest.mark.parametrize("sigma", [1.0, 4.0, 12.0])
def test_a_normal_distribution_is_read_back(sigma):
    """What is told is the truth's own spread and that of not knowing it."""
    told = Told((70.3, 81.6), np.hypot(sigma, SPREAD))
    points, deviation, _ = Decoded(told)(torch.zeros(1, 1, 160, 160))
    np.testing.assert_allclose(points[0, 0], [70.3, 81.6], atol=0.02)
    assert float(deviation) == pytest.approx(sigma, rel=0.03)


def test_the_truth_costs_nothing_and_other_points_do_not_count():
    told = Told((60.3, 91.6), SPREAD).logits
    logits = tuple(x.expand(1, 2, -1) for x in told)
    points = torch.tensor([[[60.3, 91.6], [0.0, 0]]])
    right = losses(logits, points, torch.tensor([[1.0, 0]]))
    assert float(sum(right.values())) == pytest.approx(0, abs=1e-2)
    wrong = losses(logits, points, torch.tensor([[0.0, 1]]))
    assert min(map(float, wrong.values())) > 1
    swapped = losses(logits, points.flip(-1), torch.tensor([[1.0, 0]]))
    assert min(map(float, swapped.values())) > 1


def test_a_net_begins_with_what_another_knows(tmp_path):
    card = ModelCard("nano", "boxes", ("a",), 64, "", "", "0")
    boxes, points = Nano(1), SimCC(3)
    write_model(tmp_path / "boxes.safetensors", boxes.state_dict(), card)
    own = points.points.weight.clone()
    read_like(tmp_path / "boxes.safetensors", points)
    for name, value in boxes.pyramid.state_dict().items():
        torch.testing.assert_close(points.pyramid.state_dict()[name], value)
    torch.testing.assert_close(points.points.weight, own)
    write_model(tmp_path / "strange.safetensors", {"weight": torch.zeros(3)}, card)
    with pytest.raises(InputError, match="none of its tensors"):
        read_like(tmp_path / "strange.safetensors", points)


@pytest.fixture(scope="module")
def trained(posse, make_dataset, tmp_path_factory):
    """A dataset seen from one side, and a keypoint net that learned it."""
    folder = tmp_path_factory.mktemp("keypoints")
    make_dataset(folder / "d", 120)
    arguments = ("train", folder / "d", "--detector", "simcc", "--out", folder / "o")
    settings = ("-o", "input_px=64", "-o", "epochs=9", "-o", "batch=8", "-o", "augment=false")
    code, _, error = posse(*arguments, *settings)
    assert code == 0, error
    return folder / "d", folder / "o" / "model.safetensors"


def curve(model):
    import safetensors

    with safetensors.safe_open(str(model.with_name("last.safetensors")), "pt") as file:
        return json.loads(file.metadata()["posse_training"])


def test_it_learns(trained):
    history = curve(trained[1])
    assert history[-1]["valid median error, %"] < 0.5 * history[0]["valid median error, %"]


def test_from_image_to_pose_with_and_without_torch(posse, trained, tmp_path):
    """In the labelled boxes, so that only keypoints are judged; OpenCV makes the poses."""
    folder, model = trained
    exported = tmp_path / "k.onnx"
    code, out, error = posse("export-onnx", model, "--dataset", folder, "--out", exported)
    assert code == 0, error
    assert "points" in out
    dataset = Dataset(folder)
    finders = [SimccFinder(SimccOptions()), OnnxKeypoints(OnnxOptions())]
    for finder, path in zip(finders, (model, exported), strict=True):
        finder.load(path)

    def found_in(index, finder):
        (box,) = true_boxes(dataset[index])
        (found,) = finder.find(dataset.image(index), [Detection(box.label, 1.0, box.box_px)])
        return found

    turns_deg = []
    for index in range(20):
        line = dataset[index]
        by_torch, by_onnx = (found_in(index, finder) for finder in finders)
        assert by_torch.keypoints_px.shape == (8, 2)
        assert (by_torch.keypoints_sigma_px > 0).all()
        np.testing.assert_allclose(by_onnx.keypoints_px, by_torch.keypoints_px, atol=0.2)
        np.testing.assert_allclose(by_onnx.keypoints_sigma_px, by_torch.keypoints_sigma_px, atol=0.2)
        points_m = finders[0].keypoints_body_m[by_torch.label]
        seen = by_torch.keypoints_px, dataset.camera.matrix, None
        _, turn, t_m = cv2.solvePnP(points_m, *seen, flags=cv2.SOLVEPNP_SQPNP)
        if t_m[2, 0] > 0:
            w, x, y, z = line.q_cam_from_body
            away = Rotation.from_rotvec(turn[:, 0]) * Rotation.from_quat([x, y, z, w]).inv()
            turns_deg.append(np.rad2deg(away.magnitude()))
    assert len(turns_deg) > 10
    # turns here are even up to 46 deg, so that always telling the middle attitude would err by 23
    assert np.median(turns_deg) < 18

    def median_error_px(path):
        finder = OnnxKeypoints(OnnxOptions())
        finder.load(path)
        away = [
            np.linalg.norm(found_in(index, finder).keypoints_px - np.array(labelled)[:, :2], axis=1)
            for index in range(20, 40)
            for labelled in [list(dataset[index].keypoints.values())]
        ]
        return np.median(away)

    small = tmp_path / "int8.onnx"
    seen = [(dataset.image(i), true_boxes(dataset[i])[0].box_px) for i in range(20)]
    finders[0].write_int8(exported, small, seen)
    assert 0 < median_error_px(small) < 1.2 * median_error_px(exported)
