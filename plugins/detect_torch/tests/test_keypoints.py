"""Keypoints: decoding and loss by closed forms; from image to pose by the commands."""

import json

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from torch.utils.flop_counter import FlopCounterMode

from posse_core import Dataset, Detection, InputError, ModelCard, true_boxes
from posse_detect_onnx.models import OnnxKeypoints
from posse_detect_onnx.options import OnnxOptions
from posse_detect_torch.calibration import calibrate, widening
from posse_detect_torch.checkpoint import read_like, write_model
from posse_detect_torch.heatmap import SPREAD_PX, STRIDE, HeatMaps, cell_centres, losses, read
from posse_detect_torch.heatmap_finder import HeatmapFinder
from posse_detect_torch.options import HeatmapOptions


@pytest.mark.parametrize(("size", "millions", "gmac"), [("nano", 1.5, 0.5), ("base", 5.0, 2.0)])
def test_it_is_light(size, millions, gmac):
    net = HeatMaps(22, size).eval()
    assert sum(p.numel() for p in net.parameters()) <= millions * 1e6
    with FlopCounterMode(display=False) as counter, torch.no_grad():
        net(torch.zeros(1, 1, 256, 256))
    assert counter.get_total_flops() / 2 <= gmac * 1e9


def test_cells_cover_the_square():
    at = cell_centres(4, torch.device("cpu"))
    assert at[0] - STRIDE / 2 == -0.5
    assert at[-1] + STRIDE / 2 == 4 * STRIDE - 0.5


def normal(place_px, sigma_px, share=1.0):
    """A normal distribution over the cells of a square of 160 px: (1, 1, 40, 40)."""
    at = cell_centres(40, torch.device("cpu"))
    x, y = (torch.softmax(-(((at - place) / sigma_px) ** 2) / 2, dim=0) for place in place_px)
    return share * (y[:, None] * x[None, :])[None, None]


@pytest.mark.parametrize("sigma_px", [0.5, 1.5, 3.0])
@given(x=st.floats(30, 120), y=st.floats(30, 120))
@settings(max_examples=20)
def test_a_normal_distribution_is_read_back(sigma_px, x, y):
    """What is told is the truth's own spread and that of not knowing it."""
    points, spread, share = read(normal((x, y), np.hypot(sigma_px, SPREAD_PX)).log())
    np.testing.assert_allclose(points[0, 0, 0], [x, y], atol=0.05)
    assert float(spread[0, 0, 0]) == pytest.approx(sigma_px, rel=0.1, abs=0.1)
    assert float(share[0, 0, 0]) > 0.99
    assert float(share[0, 0, 1:].sum()) < 0.01


def test_a_second_place_takes_its_share_and_draws_nothing_away():
    two = normal((50.3, 61.7), SPREAD_PX, 0.7) + normal((120.0, 100.0), SPREAD_PX, 0.3)
    points, _, share = read(two.clamp(min=1e-30).log())
    np.testing.assert_allclose(points[0, 0, :2], [[50.3, 61.7], [120.0, 100.0]], atol=0.01)
    np.testing.assert_allclose(share[0, 0], [0.7, 0.3, 0, 0], atol=1e-3)


def test_the_truth_costs_nothing_and_other_points_do_not_count():
    logits = normal((60.3, 91.6), SPREAD_PX).clamp(min=1e-30).log().expand(1, 2, -1, -1)
    points = torch.tensor([[[60.3, 91.6], [0.0, 0]]])
    (right,) = losses(logits, points, torch.tensor([[1.0, 0]])).values()
    assert float(right) == pytest.approx(0, abs=1e-3)
    (wrong,) = losses(logits, points, torch.tensor([[0.0, 1]])).values()
    assert float(wrong) > 1
    (swapped,) = losses(logits, points.flip(-1), torch.tensor([[1.0, 0]])).values()
    assert float(swapped) > 1


@pytest.mark.parametrize("outliers", [0.0, 0.05])
def test_calibration_finds_the_law_that_errors_were_drawn_by(outliers):
    """σ = 1.5 √spread / share: errors drawn so give its three numbers back."""
    random = np.random.default_rng(0)
    spread, share = np.exp(random.uniform(-2, 2, 20_000)), random.uniform(0.2, 1, 20_000)
    away = random.normal(0, (1.5 * np.sqrt(spread) / share)[:, None], (20_000, 2))
    away[random.uniform(size=20_000) < outliers] *= 30
    found = calibrate(away, spread, share)
    np.testing.assert_allclose(found[1:], [0.5, -1.0], atol=0.03)
    assert 1.5 * 0.98 < np.exp(found[0]) < 1.5 * (1.02 if outliers == 0 else 1.25)


@given(st.floats(1.1, 2.5), st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_widened_poses_are_as_wrong_as_they_say(factor, seed):
    """Errors are so many times as large as the covariances say, and a few poses are upside down."""
    random = np.random.default_rng(seed)
    within = factor**2 * random.chisquare(6, 2000)
    within[:40] = 1e6
    assert widening(within) == pytest.approx(factor, rel=0.05)


def test_of_few_poses_and_of_cautious_ones_nothing_is_widened():
    assert widening(np.full(5, 100.0)) == widening(np.full(100, 1.0)) == widening(np.zeros(0)) == 1


def test_a_net_begins_with_what_another_knows(tmp_path):
    points = {"P1": [0.0, 0.0, 0.0], "P2": [1.0, 0.0, 0.0], "P3": [0.0, 1.0, 0.0]}
    card = ModelCard("heatmap", "keypoints", ("a",), 64, "", "", "0", {"a": points})
    known, new = HeatMaps(3, "nano"), HeatMaps(5, "nano")
    write_model(tmp_path / "known.safetensors", known.state_dict(), card)
    own = new.maps.weight.clone()
    read_like(tmp_path / "known.safetensors", new)
    for name, value in known.features.state_dict().items():
        torch.testing.assert_close(new.features.state_dict()[name], value)
    torch.testing.assert_close(new.maps.weight, own)
    write_model(tmp_path / "strange.safetensors", {"weight": torch.zeros(3)}, card)
    with pytest.raises(InputError, match="none of its tensors"):
        read_like(tmp_path / "strange.safetensors", new)


@pytest.fixture(scope="module")
def trained(posse, make_dataset, tmp_path_factory):
    """A dataset seen from one side, and a keypoint net that learned it."""
    folder = tmp_path_factory.mktemp("keypoints")
    make_dataset(folder / "d", 120)
    arguments = ("train", folder / "d", "--detector", "heatmap", "--out", folder / "o")
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
    finders = [HeatmapFinder(HeatmapOptions()), OnnxKeypoints(OnnxOptions())]
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
