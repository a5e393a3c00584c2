"""Keypoints: decoding and loss by closed forms; from image to pose by the commands."""

import json

import numpy as np
import pytest
import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from posse_core import InputError, ModelCard
from posse_detect_torch.checkpoint import read_like, write_model
from posse_detect_torch.nano import STRIDE, Nano
from posse_detect_torch.simcc import SPREAD, Decoded, SimCC, losses, steps


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
    """Boxes come from a stand-in detector that knows the labels, so that only keypoints are judged."""
    folder, model = trained
    from posse_core import Dataset, Detection, Detector
    from posse_core._detection.accuracy import accuracy
    from posse_core._detection.evaluate import evaluate
    from posse_core._detection.groups import groups
    from posse_core._detection.models import open_keypoint_finder
    from posse_core._plugins.loading import load_plugins

    exported = tmp_path / "k.onnx"
    code, out, error = posse("export-onnx", model, "--dataset", folder, "--out", exported)
    assert code == 0, error
    assert "points" in out
    dataset = Dataset(folder)
    images = {dataset.image(i).tobytes(): dataset.frame(i) for i in range(len(dataset.frames))}

    def detection(line):
        return Detection(line["spacecraft"], 1.0, np.array(line["box_visible_px"], float))

    class Labels(Detector):
        classes = ("brick", "plate")

        def load(self, path):
            pass

        def predict(self, images_seen):
            return [[detection(images[image.tobytes()])] for image in images_seen]

    registry = load_plugins().registry
    finders = [open_keypoint_finder(path, registry, {}) for path in (model, exported)]
    places = list(range(20))
    results = [
        groups(dataset, evaluate(dataset, places, Labels(None), finder), poses=True)[0].metrics
        for finder in finders
    ]
    assert results[0]["mAP"] == 1
    assert results[0]["poses found"] > 0.5
    for name, value in results[0].items():
        assert results[1][name] == pytest.approx(value, rel=2e-2, abs=1e-3), name
    # turns here are even up to 46 deg, so that always telling the middle attitude would err by 23
    assert results[0]["e_q median, deg"] < 18
    line = dataset.frame(0)
    found = finders[0].find(dataset.image(0), [detection(line)])
    assert found[0].keypoints_px.shape == (8, 2)
    assert (found[0].keypoints_sigma_px > 0).all()

    small = tmp_path / "int8.onnx"
    seen = [(dataset.image(i), np.array(dataset.frame(i)["box_visible_px"])) for i in places]
    finders[0].write_int8(exported, small, seen)
    files = exported, small
    exact, lossy = (accuracy(dataset, range(20, 40), path, "keypoints", registry) for path in files)
    (before,), (after,) = exact.values(), lossy.values()
    assert 0 < after < 1.2 * before
