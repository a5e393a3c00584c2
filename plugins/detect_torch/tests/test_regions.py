"""RoIAlign and suppression against onnxruntime's, on random boxes; gradients against differences."""

import numpy as np
import onnxruntime
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from onnx import TensorProto, helper

from posse_detect_torch.regions import STRIDES, iou_matrix, nms, nms_padded, pyramid_roi_align

SIDE = 96
F, I = TensorProto.FLOAT, TensorProto.INT64


def session(nodes, inputs, output, kind=F):
    graph = helper.make_graph(
        nodes,
        "g",
        [helper.make_tensor_value_info(name, t, None) for name, t in inputs],
        [helper.make_tensor_value_info(output, kind, None)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    return onnxruntime.InferenceSession(model.SerializeToString())


SUPPRESSION = session(
    [helper.make_node("NonMaxSuppression", ["boxes", "scores", "most", "overlap", "least"], ["kept"])],
    [("boxes", F), ("scores", F), ("most", I), ("overlap", F), ("least", F)],
    "kept",
    I,
)


def align(level: int, sampling: int):
    node = helper.make_node(
        "RoiAlign",
        ["x", "rois", "batch"],
        ["y"],
        coordinate_transformation_mode="half_pixel",
        output_height=7,
        output_width=7,
        sampling_ratio=sampling,
        spatial_scale=1 / STRIDES[level],
    )
    return session([node], [("x", F), ("rois", F), ("batch", I)], "y")


ALIGNMENTS = {(level, s): align(level, s) for level in range(4) for s in (1, 2)}


def random_boxes(random, *shape, beyond=0.0):
    ends = random.uniform(-beyond, SIDE + beyond, (*shape, 2, 2))
    return np.concatenate([ends.min(axis=-2), ends.max(axis=-2)], axis=-1).astype(np.float32)


@given(st.integers(0, 2**32 - 1), st.integers(1, 1200), st.floats(0.1, 0.9), st.integers(1, 300))
def test_suppression_is_that_of_onnxruntime(seed, count, overlap, most):
    random = np.random.default_rng(seed)
    boxes = random_boxes(random, 1, count)
    scores = random.permutation(count).astype(np.float32)[None, None] / count - 0.1  # no two alike
    theirs = SUPPRESSION.run(
        None,
        {
            "boxes": boxes,
            "scores": scores,
            "most": np.array([most]),
            "overlap": np.array([overlap], np.float32),
            "least": np.zeros(1, np.float32),
        },
    )[0][:, 2]
    ours = nms(torch.from_numpy(boxes[0]), torch.from_numpy(scores[0, 0]), overlap, most)
    assert ours.tolist() == theirs.tolist()


def test_suppression_of_a_batch_is_padded():
    boxes = torch.tensor([[[0.0, 0, 10, 10], [1, 0, 10, 10], [20, 20, 30, 30]], [[0, 0, 1, 1]] * 3])
    scores = torch.tensor([[0.5, 0.9, 0.7], [0.0, -1, 0.2]])
    assert nms_padded(boxes, scores, 0.5, 3).tolist() == [[1, 2, -1], [2, -1, -1]]


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2]))
def test_alignment_is_that_of_onnxruntime(seed, sampling):
    """Boxes that reach beyond the picture included."""
    random = np.random.default_rng(seed)
    batch, count = 2, 6
    levels = [random.normal(size=(batch, 3, SIDE // s, SIDE // s)).astype(np.float32) for s in STRIDES]
    rois = random_boxes(random, batch, count, beyond=40)
    level = random.integers(0, 4, (batch, count))
    ours = pyramid_roi_align(
        [torch.from_numpy(x) for x in levels], torch.from_numpy(rois), torch.from_numpy(level), sampling
    ).numpy()
    for image, region in np.ndindex(batch, count):
        at = int(level[image, region])
        inputs = {"x": levels[at], "rois": rois[image, region][None], "batch": np.array([image])}
        (theirs,) = ALIGNMENTS[at, sampling].run(None, inputs)[0]
        np.testing.assert_allclose(ours[image, region], theirs, atol=5e-5)


@pytest.mark.parametrize("sampling", [1, 2])
def test_the_gradient_of_alignment(sampling):
    torch.manual_seed(0)
    levels = [
        torch.randn(1, 1, 48 // s, 64 // s, dtype=torch.float64, requires_grad=True) for s in (4, 8)
    ]
    levels += [torch.randn(1, 1, 2, 2, dtype=torch.float64, requires_grad=True) for _ in range(2)]
    rois = torch.tensor([[[3.0, 5, 40, 33], [-4, 2, 70, 50]]], dtype=torch.float64)
    level = torch.tensor([[0, 1]])
    assert torch.autograd.gradcheck(
        lambda *x: pyramid_roi_align(x, rois, level, sampling)[..., ::3, ::3], levels
    )


def test_overlaps_of_all_pairs():
    a = torch.tensor([[0.0, 0, 2, 2], [1, 1, 3, 3]])
    np.testing.assert_allclose(iou_matrix(a, a), [[1, 1 / 7], [1 / 7, 1]], rtol=1e-6)
