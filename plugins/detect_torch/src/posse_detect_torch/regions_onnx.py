"""The operations of :mod:`posse_detect_torch.regions` in terms of ONNX's NonMaxSuppression and RoiAlign.

torch's exporter calls these functions. They take and return ONNX values, not tensors.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from onnxscript import opset18

from posse_detect_torch.regions import BINS, STRIDES

op: Any = opset18  # its types are too narrow: they distinguish constants from shapes


def nms_padded_onnx(boxes: Any, scores: Any, overlap: float, most: int) -> Any:
    """Return (B, most) indices, padded with −1.

    NonMaxSuppression returns rows of (picture, class, index), which are scattered into a padded table.
    """
    one = op.Constant(value_ints=[1])
    zero = op.Constant(value_ints=[0])
    picked = op.NonMaxSuppression(
        boxes,
        op.Unsqueeze(scores, one),
        op.Constant(value_ints=[most]),
        op.Constant(value_floats=[overlap]),
        op.Constant(value_floats=[0.0]),
    )
    picture = op.Slice(picked, zero, one, one)  # (N, 1)
    index = op.Squeeze(
        op.Slice(picked, op.Constant(value_ints=[2]), op.Constant(value_ints=[3]), one), one
    )
    batch = op.Shape(boxes, start=0, end=1)
    pictures = op.Range(op.Constant(value_int=0), op.Squeeze(batch, zero), op.Constant(value_int=1))
    mine = op.Cast(op.Equal(picture, op.Unsqueeze(pictures, zero)), to=7)  # (N, B)
    so_far = op.CumSum(mine, op.Constant(value_int=0))
    rank = op.Sub(op.GatherElements(so_far, picture, axis=1), one)  # (N, 1)
    empty = op.Expand(
        op.Constant(value_ints=[-1]), op.Concat(batch, op.Constant(value_ints=[most]), axis=0)
    )
    return op.ScatterND(empty, op.Concat(picture, rank, axis=1), index)


def roi_align_onnx(p2: Any, p3: Any, p4: Any, p5: Any, rois: Any, level: Any, sampling: int) -> Any:
    """Return (B, R, C, 7, 7): the regions of each level are aligned and scattered to their rows."""
    one = op.Constant(value_ints=[1])
    bins = op.Constant(value_ints=[BINS, BINS])
    flat = op.Reshape(rois, op.Constant(value_ints=[-1, 4]))
    of_level = op.Reshape(level, op.Constant(value_ints=[-1]))
    regions = op.Shape(rois, start=1, end=2)
    channels = op.Shape(p2, start=1, end=2)
    shape = op.Concat(op.Shape(of_level), channels, bins, axis=0)
    out = op.Expand(op.Constant(value_floats=[0.0]), shape)
    for number, features in enumerate((p2, p3, p4, p5)):
        is_mine = op.Equal(of_level, op.Constant(value_ints=[number]))
        mine = op.Transpose(op.NonZero(is_mine), perm=[1, 0])  # (n, 1)
        row = op.Squeeze(mine, one)
        aligned = op.RoiAlign(
            features,
            op.Gather(flat, row),
            op.Div(row, regions),
            coordinate_transformation_mode="half_pixel",
            mode="avg",
            output_height=BINS,
            output_width=BINS,
            sampling_ratio=sampling,
            spatial_scale=1.0 / STRIDES[number],
        )
        out = op.ScatterND(out, mine, aligned)
    return op.Reshape(out, op.Concat(op.Shape(rois, start=0, end=2), channels, bins, axis=0))


ONNX_TRANSLATIONS: dict[Any, Callable[..., Any]] = {
    torch.ops.posse.nms_padded.default: nms_padded_onnx,
    torch.ops.posse.roi_align.default: roi_align_onnx,
}
"""Custom torch operation → ONNX function, as :func:`posse_detect_torch.export.export` takes them."""
