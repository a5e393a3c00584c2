"""SDN: the thesis' parameters to the digit; anchors, targets and decoding by closed forms."""

import contextlib
import io

import numpy as np
import onnxruntime
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from posse_core import ModelCard
from posse_detect_torch import sdn, sdn_losses
from posse_detect_torch.export import difference, export
from posse_detect_torch.regions import iou_matrix, nms_padded, roi_align
from posse_detect_torch.regions_onnx import ONNX_TRANSLATIONS
from posse_detect_torch.sdn_detector import proposal_recall


@pytest.mark.parametrize(
    ("depth", "millions", "gflop"),
    # thesis, Section 5.2: 28.9 and 42.04 M; 152.63 and 190.57 GFLOP, as two for each multiply-add and
    # without the head that looks at regions
    [(18, 28.900, 152.63), (50, 42.034, 190.57)],
)
def test_size_is_the_thesis(depth, millions, gflop):
    with torch.device("meta"):
        net = sdn.Sdn(2, depth, 1).eval()
        statistics = [b for name, b in net.named_buffers() if "running" in name]
        count = sum(t.numel() for t in [*net.parameters(), *statistics])
        assert int(count / 1e3) / 1e3 == millions
        with FlopCounterMode(display=False) as counter:
            net.features(torch.zeros(1, 1, 640, 640))
    assert counter.get_total_flops() / 1e9 == pytest.approx(gflop, rel=0.015)


def test_anchors_stand_on_every_level():
    fixed = sdn.anchors(128, torch.device("cpu"))
    assert len(fixed) == 3 * sum((128 // s) ** 2 for s in sdn.STRIDES)
    sides = fixed[:, 2:] - fixed[:, :2]
    first = 0
    for stride, scale in zip(sdn.STRIDES, sdn.SCALES, strict=True):
        count = 3 * (128 // stride) ** 2
        mine = sides[first : first + count]
        np.testing.assert_allclose(mine.prod(dim=1), scale**2, rtol=1e-5)
        np.testing.assert_allclose(mine[:3, 1] / mine[:3, 0], sdn.RATIOS, rtol=1e-5)
        first += count


boxes = st.tuples(*[st.floats(-50, 600)] * 2, *[st.floats(1, 300)] * 2).map(
    lambda b: torch.tensor([b[0], b[1], b[0] + b[2], b[1] + b[3]], dtype=torch.float64)
)


@given(boxes, boxes)
def test_deltas_bring_a_box_to_its_goal(box, goal):
    if ((goal[2:] - goal[:2]) / (box[2:] - box[:2])).log().abs().max() > 4:
        return
    there = sdn.moved(box, sdn.deltas_between(box, goal))
    np.testing.assert_allclose(there, goal, atol=1e-6)


@pytest.mark.parametrize(
    ("side", "level"), [(20, 0), (112, 1), (224, 2), (448, 3), (2000, 3), (150, 1), (170, 2)]
)
def test_a_region_is_taken_from_the_level_of_its_size(side, level):
    assert sdn.level_of(torch.tensor([[[0.0, 0, side, side]]])).item() == level


def truth():
    return torch.tensor([[[20.0, 30, 84, 90]], [[0.0, 0, 0, 0]]]), torch.tensor([[1], [-1]])


def test_anchors_are_sorted_by_overlap():
    goals, labels = truth()
    fixed = sdn.anchors(128, torch.device("cpu"))
    sort, _ = sdn_losses.anchor_targets(fixed, goals, labels, torch.Generator().manual_seed(0))
    overlap = iou_matrix(fixed, goals[0])[:, 0]
    assert overlap[sort[0] == 1].min() >= min(0.7, float(overlap.max()))
    assert sort[0][overlap.argmax()] == 1
    assert overlap[sort[0] == 0].max() < 0.3
    assert (sort >= 0).sum(dim=1).tolist() == [256, 256]
    assert not (sort[1] == 1).any()


def test_regions_are_one_positive_to_three_negative():
    goals, labels = truth()
    random = np.random.default_rng(1)
    near = goals[0, 0].numpy() + random.normal(0, 2, (2, 20, 4))
    corner = random.uniform(0, 60, (2, 300, 2))
    far = np.concatenate([corner, corner + random.uniform(5, 60, (2, 300, 2))], axis=-1)
    found = np.concatenate([near, far, np.zeros((2, 700, 4))], axis=1).astype(np.float32)
    rois, classes, goal = sdn_losses.region_targets(
        torch.from_numpy(found), goals, labels, torch.Generator().manual_seed(0), 512
    )
    overlap = iou_matrix(rois[0], goals[0])[:, 0]
    positive, negative = classes[0] == 2, classes[0] == 0
    assert positive.sum() >= 20
    assert negative.sum() == 3 * positive.sum()
    assert (overlap[positive] >= 0.5).all()
    assert (overlap[negative] < 0.5).all()
    assert ((classes[0] == sdn_losses.PADDING) | positive | negative).all()
    assert (classes[1] == sdn_losses.PADDING).all()  # no craft: nothing to distinguish
    there = sdn.moved(rois[0][positive], goal[0][positive])
    np.testing.assert_allclose(there, goals[0].expand_as(there), atol=1e-3)
    _, few, _ = sdn_losses.region_targets(
        torch.from_numpy(found), goals, labels, torch.Generator().manual_seed(0), 16
    )
    assert sorted(few[0].tolist()) == 12 * [0] + 4 * [2]


def test_every_weight_learns():
    torch.manual_seed(0)
    net = sdn.Sdn(2, 18, 2).train()
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d | nn.BatchNorm1d):
            module.eval()
    goals, labels = (value[:1] for value in truth())
    picture = torch.rand(1, 1, 128, 128)
    cost = sdn_losses.losses(net, picture, goals, labels, draw=3, regions=64)
    assert set(cost) == {"proposal class", "proposal box", "class", "box"}
    # a fresh net's regions may all miss the craft: its head learns from regions that are given
    pyramid, *_ = net.features(picture)
    predicted, moves = net.classify_regions(pyramid, goals + 1)
    (sum(cost.values()) + predicted.square().sum() + moves.square().sum()).backward()
    still = [name for name, p in net.named_parameters() if p.grad is None or not p.grad.any()]
    assert still == []


class Told(nn.Module):
    """An Sdn whose features are given; the class of a region follows from its position."""

    def __init__(self, goals):
        super().__init__()
        self.goals = goals

    def features(self, picture):
        fixed = sdn.anchors(picture.shape[-1], picture.device)
        best = iou_matrix(fixed, self.goals).max(dim=1)
        deltas = sdn.deltas_between(fixed, self.goals[best.indices])
        logits = torch.stack([torch.zeros_like(best.values), 20 * best.values - 10], dim=-1)
        return [], logits[None], deltas[None]

    def classify_regions(self, pyramid, rois):
        overlap = iou_matrix(rois, self.goals[None])  # (1, R, goals)
        logits = torch.cat([torch.full_like(overlap[..., :1], 4.0), 10 * overlap], dim=-1)
        return logits, torch.zeros(*logits.shape, 4)


def test_what_proposals_and_head_agree_on_is_found_once():
    goals = torch.tensor([[10.0, 12, 60, 70], [80, 70, 120, 118]])
    found, scores, labels, _ = sdn.Decoded(Told(goals), 0.7)(torch.zeros(1, 1, 128, 128))
    order = labels[0, :2].argsort()
    assert labels[0, :2].sort().values.tolist() == [0, 1]
    assert (labels[0, 2:] == -1).all()
    assert (scores[0, :2] > 0.99).all()
    ends = torch.cat([goals[:, :2], goals[:, 2:] - goals[:, :2]], dim=1)
    np.testing.assert_allclose(found[0, :2][order], ends, atol=1e-3)


class Regions(nn.Module):
    """Our operations, alone: suppression picks the boxes that alignment looks at."""

    def forward(self, features):
        flat = features.flatten(1)
        corner = 40 * flat[:, :200].reshape(-1, 100, 2)
        boxes = torch.cat([corner, corner + 2 + 50 * flat[:, 200:400].reshape(-1, 100, 2)], dim=-1)
        kept = nms_padded(boxes, flat[:, 400:500], 0.4, 60)
        rois = torch.gather(boxes, 1, kept.clamp(min=0)[..., None].expand(-1, -1, 4))
        level = kept.clamp(min=0) % 3  # none of the last level
        maps = [features[..., ::s, ::s].expand(-1, 3, -1, -1) * (s + 1) for s in (1, 2, 4, 8)]
        return kept, roi_align(*maps, rois, level, 2)


def test_our_operations_export_to_standard_ones(tmp_path):
    card = ModelCard("sdn", "boxes", ("a",), 32, "", "", "0")
    pictures = np.random.default_rng(0).uniform(0, 1, (3, 1, 32, 32)).astype(np.float32)

    def compare(ours, theirs):
        assert (ours["kept"] >= 0).any()
        return {name: (difference(ours[name], theirs[name]), 1e-4) for name in ours}

    path = tmp_path / "regions.onnx"
    export(Regions(), ("kept", "features"), pictures, card, path, compare, ONNX_TRANSLATIONS)
    session = onnxruntime.InferenceSession(str(path))
    with torch.no_grad():
        ours = Regions()(torch.from_numpy(pictures))
    for mine, theirs in zip(ours, session.run(None, {"picture": pictures}), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-4)


@given(st.integers(0, 2**32 - 1))
def test_the_recall_of_proposals_is_that_of_pycocotools(seed):
    random = np.random.default_rng(seed)
    true, found = [], []
    for _ in range(5):
        box = np.concatenate([random.uniform(0, 90, 2), random.uniform(10, 60, 2)])
        near = box + random.normal(0, 0.3 * box[2], (random.integers(90, 120), 4))
        near[:, 2:] = np.abs(near[:, 2:]) + 1
        true.append(box[None][: random.integers(0, 2)])
        found.append(np.concatenate([np.tile([500.0, 500, 5, 5], (random.integers(0, 120), 1)), near]))
    recall = proposal_recall(*([_ends(b) for b in boxes] for boxes in (found, true)))
    coco = COCO()
    coco.dataset = {
        "info": {},
        "images": [{"id": i} for i in range(5)],
        "annotations": [
            {"id": i + 1, "image_id": i, "category_id": 1, "bbox": b.tolist(), "area": 1, "iscrowd": 0}
            for i, boxes in enumerate(true)
            for b in boxes
        ],
        "categories": [{"id": 1, "name": "any"}],
    }
    results = [
        {"image_id": i, "category_id": 1, "bbox": b.tolist(), "score": 1 - rank / 1000}
        for i, boxes in enumerate(found)
        for rank, b in enumerate(boxes)
    ]
    with contextlib.redirect_stdout(io.StringIO()):
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(results), "bbox")
        evaluation.params.maxDets = [1, 100, 1000]
        evaluation.evaluate()
        evaluation.accumulate()
    theirs = np.maximum(evaluation.eval["recall"][0, 0, 0, 1:], 0)  # -1 where nothing is shown
    assert [recall["AR100"], recall["AR1k"]] == pytest.approx(theirs.tolist())


def _ends(boxes):
    """Left, top, right, bottom of x, y, width, height."""
    return torch.from_numpy(np.concatenate([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]], axis=1))
