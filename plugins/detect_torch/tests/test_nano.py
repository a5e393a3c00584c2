"""The light detector's net: size, decoding, losses."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.utils.flop_counter import FlopCounterMode

from posse_detect_torch.export import compare_detections
from posse_detect_torch.nano import STRIDE, Decoded, Nano, boxes_at, generalised_iou, losses
from posse_detect_torch.nano_detector import tied_scores


@pytest.mark.parametrize("size", [320, 416])
def test_it_is_light_enough_for_use_on_board(size):
    net = Decoded(Nano(2), 16).eval()
    assert sum(p.numel() for p in net.parameters()) <= 1.5e6
    with FlopCounterMode(display=False) as counter, torch.no_grad():
        net(torch.rand(1, 1, size, size))
    assert counter.get_total_flops() / 2 <= 1e9


class Told(torch.nn.Module):
    """A net whose maps are given."""

    def __init__(self, logits, distances):
        super().__init__()
        self.maps = logits, distances

    def forward(self, picture):
        return self.maps


def test_peaks_become_boxes_best_first():
    logits = torch.full((1, 2, 8, 8), -9.0)
    logits[0, 0, 2, 3], logits[0, 1, 6, 5] = 1.0, 2.0
    logits[0, 1, 6, 4] = 1.9  # a neighbour is no peak
    distances = torch.log(torch.arange(1.0, 5))[None, :, None, None].expand(1, 4, 8, 8)
    boxes, scores, labels, _ = Decoded(Told(logits, distances), 3)(torch.zeros(1, 1, 64, 64))
    assert labels[0, :2].tolist() == [1, 0]
    np.testing.assert_allclose(scores[0, :2], [1 / (1 + np.exp(-2)), 1 / (1 + np.exp(-1))], rtol=1e-6)
    assert scores[0, 2] < 1e-3
    # 1, 2, 3, 4 strides to left, top, right, bottom of the places' centres (44, 52) and (28, 20)
    np.testing.assert_allclose(boxes[0, 0], [44 - 8, 52 - 16, 32, 48], atol=1e-4)
    np.testing.assert_allclose(boxes[0, 1], [28 - 8, 20 - 16, 32, 48], atol=1e-4)


corner = st.tuples(*[st.integers(0, 20)] * 2, *[st.integers(1, 20)] * 2)


@given(corner, corner)
def test_generalised_overlap_counts_pixels(a, b):
    masks = np.zeros((2, 40, 40), bool)
    for mask, (x, y, w, h) in zip(masks, (a, b), strict=True):
        mask[y : y + h, x : x + w] = True
    union, both = (masks[0] | masks[1]).sum(), (masks[0] & masks[1]).sum()
    ys, xs = np.nonzero(masks[0] | masks[1])
    hull = (np.ptp(ys) + 1) * (np.ptp(xs) + 1)
    boxes = [torch.tensor([x, y, x + w, y + h], dtype=torch.float64) for x, y, w, h in (a, b)]
    assert float(generalised_iou(*boxes)) == pytest.approx(both / union - (hull - union) / hull)


def perfect(box, label, size=8):
    """Maps that say just where a box is."""
    place = (torch.arange(size) + 0.5) * STRIDE
    x, y = place[None, :].expand(size, size), place[:, None].expand(size, size)
    away = torch.stack([x - box[0], y - box[1], box[2] - x, box[3] - y]).clamp(min=1e-3)
    logits = torch.full((1, 2, size, size), -20.0)
    column, row = (int((box[i] + box[i + 2]) / 2 // STRIDE) for i in (0, 1))
    logits[0, label, row, column] = 20.0
    return logits, torch.log(away / STRIDE)[None]


def test_right_maps_cost_nothing_and_wrong_ones_do():
    box = torch.tensor([8.0, 12, 52, 60])
    right = perfect(box, 1)
    cost = losses(*right, box[None, None], torch.tensor([[1]]))
    assert float(sum(cost.values())) < 1e-3
    assert float(losses(*right, box[None, None], torch.tensor([[0]]))["heat"]) > 1
    moved = losses(*right, box[None, None] + 8, torch.tensor([[1]]))
    assert float(moved["overlap"]) > 0.2
    assert float(moved["sides"]) > 0.2


def test_a_picture_without_craft_teaches_silence():
    logits = torch.zeros(1, 2, 8, 8, requires_grad=True)
    distances = torch.zeros(1, 4, 8, 8, requires_grad=True)
    cost = losses(logits, distances, torch.zeros(1, 1, 4), torch.tensor([[-1]]))
    sum(cost.values()).backward()
    assert (logits.grad > 0).all()
    assert not distances.grad.any()


def test_a_box_that_shrank_to_a_point_is_pulled_back():
    distances = torch.full((1, 4, 8, 8), -12.0, requires_grad=True)
    box = torch.tensor([[[8.0, 12, 52, 60]]])
    logits = torch.zeros(1, 2, 8, 8)
    sum(losses(logits, distances, box, torch.tensor([[0]])).values()).backward()
    assert distances.grad.min() < -0.1
    assert boxes_at(distances.detach()).shape == (1, 64, 4)


def told_outputs(logits, count):
    """What a net with this map (12, 12) of logits and boxes of one size says of a picture."""
    maps = torch.from_numpy(logits)[None, None].float()
    net = Decoded(Told(maps, torch.zeros(1, 4, 12, 12)), count)
    names = ("boxes", "scores", "labels", "raw")
    return {
        name: value.numpy() for name, value in zip(names, net(torch.zeros(1, 1, 96, 96)), strict=True)
    }


def peaks(*places):
    logits = np.full((12, 12), -4.0)
    for row, column, value in places:
        logits[row, column] = value
    return logits


@pytest.mark.parametrize("beside", [1, 3], ids=["neighbours", "strangers"])
def test_a_last_digit_may_move_the_peak_between_neighbours_that_tie(beside):
    """Two cells differ by 1 in 10⁷: torch prefers one, ONNX the other. Of strangers both are listed."""
    first = peaks((5, 5, -3.0), (5, 5 + beside, np.float32(-3.0 - 3e-7)))
    second = peaks((5, 5, np.float32(-3.0 - 3e-7)), (5, 5 + beside, -3.0))
    ours, theirs = told_outputs(first, 4), told_outputs(second, 4)
    ties = tied_scores(ours["raw"][0, :1], 4)
    found = compare_detections(ours, theirs, ties)
    assert all(value <= allowed for value, allowed in found.values())
    away, allowed = compare_detections(ours, theirs)["boxes, px"]
    assert (away > allowed) == (beside == 1)


def test_a_detection_that_is_elsewhere_is_no_tie():
    """A plateau of the background is one, with scores of its own."""
    ours, theirs = told_outputs(peaks((5, 5, -1.0)), 4), told_outputs(peaks((5, 6, -1.0)), 4)
    away, allowed = compare_detections(ours, theirs, tied_scores(ours["raw"][0, :1], 4))["boxes, px"]
    assert away == STRIDE > allowed


def test_the_end_of_a_full_list_may_be_another():
    """Three peaks for two places: which of two equal ones is last is chance."""
    ours = told_outputs(peaks((1, 1, 2.0), (5, 5, np.float32(-1 + 1e-6)), (9, 9, -1.0)), 2)
    theirs = told_outputs(peaks((1, 1, 2.0), (5, 5, np.float32(-1 - 1e-6)), (9, 9, -1.0)), 2)
    assert ours["boxes"][0, 1, 0] != theirs["boxes"][0, 1, 0]
    ties = tied_scores(ours["raw"][0, :1], 2)
    assert compare_detections(ours, theirs, ties)["boxes, px"][0] == 0
    assert compare_detections(ours, theirs)["boxes, px"][0] > 0.1
